/* tests/pcl_ours.h - our reader as C++ can call it. */
#pragma once
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Reads all positions of a file.
 * xyz      out, [*count][3], owned by the caller, who frees it
 * reason   out, a sentence, where the file cannot be read
 * returns  0: could not be read */
int pcl_ours_read(const char *path, double **xyz, size_t *count, char *reason, size_t reason_size);

#ifdef __cplusplus
}
#endif
