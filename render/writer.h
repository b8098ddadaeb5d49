/* render/writer.h - the thread that encodes frames while the next ones are drawn.
 *
 * A few pictures go round: the owner fills one and hands it over; the thread adds it to the reel
 * and gives it back. The reel is the thread's from start to finish. */
#pragma once
#include "render/reel.h"

enum { REND_NOTE_SIZE = 1024 };

typedef struct rend_writer rend_writer;

/* reel     borrowed
 * errors   MOSPT_ENOMEM, MOSPT_EIO: no thread could be started */
bool rend_writer_start(rend_reel *reel, size_t picture_size, rend_writer **out, mospt_err *err);

/* A picture to fill; waits until one is free. NULL: the thread has met an error, see finish. */
void *rend_writer_slot(rend_writer *writer);

/* Hands over the picture of rend_writer_slot(), with its note. */
void rend_writer_put(rend_writer *writer, const char *note);

/* Waits until all is written, and ends the thread; false with its error. Call once. */
bool rend_writer_finish(rend_writer *writer, mospt_err *err);
void rend_writer_destroy(rend_writer *writer);

/* Seconds that the thread has worked, after rend_writer_finish(). */
double rend_writer_busy_s(const rend_writer *writer);
