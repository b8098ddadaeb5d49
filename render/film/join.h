/* render/film/join.h - films of the same kind, one after the other, without encoding anything
 * again. threads  any */
#pragma once
#include "mospt/err.h"

/* Told after each input; returns false to stop. NULL: nobody wants to know. */
typedef bool rfilm_joined(void *user, size_t done, size_t count);

/* Writes all frames of the inputs into one film that can start playing before it is all there.
 * inputs      [count] files, in order; codec, size and settings must agree
 * container   as for rfilm_encoder_open()
 * frames      out: how many there are; NULL: not wanted
 * errors      MOSPT_EIO, MOSPT_EFORMAT (an input is no film, or differs from the first),
 *             MOSPT_EINVAL, MOSPT_ENOMEM, MOSPT_ECANCELLED */
bool rfilm_join(const char *const *inputs, size_t count, const char *path, const char *container,
                rfilm_joined *joined, void *user, uint64_t *frames, mospt_err *err);
