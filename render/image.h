/* render/image.h - pictures on disk. */
#pragma once
#include "mospt/err.h"

/* Writes a PNG under a temporary name beside `path`, then renames: no half-written picture ever
 * bears the name.
 * rgb      [width * height * 3], top row first
 * errors   MOSPT_EIO, MOSPT_ENOMEM */
bool rend_image_write(const char *path, const uint8_t *rgb, uint32_t width, uint32_t height,
                      mospt_err *err);

/* The same with 16 bits a channel.
 * rgb      [width * height * 3], in the machine's order of bytes */
bool rend_image_write16(const char *path, const uint16_t *rgb, uint32_t width, uint32_t height,
                        mospt_err *err);
