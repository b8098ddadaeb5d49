/* render/gl/staging.h - how vertices get into a buffer of the GPU.
 *
 * A ring of memory that stays mapped (GL_ARB_buffer_storage): bytes are written there, and a copy
 * is queued behind what is already being drawn, so neither the driver nor we wait, and the buffer
 * itself may lie where only the GPU reaches. The ring is cut into segments; one is written again
 * when the fence behind its last copy has been passed. Older drivers copy by themselves
 * (glBufferSubData). */
#pragma once
#include "render/gl/program.h"

#include <stddef.h>
#include <stdint.h>

enum { RGL_STAGING_SEGMENTS = 8 };

typedef struct {
    GLuint buffer;   /* 0: not made yet */
    uint8_t *memory; /* [RGL_STAGING_SEGMENTS segments], mapped; NULL: the driver copies */
    GLsync passed[RGL_STAGING_SEGMENTS]; /* NULL: free */
    uint32_t segment;
    size_t used; /* bytes of that segment */
} rgl_staging;

void rgl_staging_fini(rgl_staging *staging);

/* True if the driver can; then buffers that are uploaded to may be without any storage flag. */
bool rgl_staging_is_mapped(void);

/* Puts bytes into a buffer; what is drawn from now on sees them, what was drawn before does not.
 * errors   MOSPT_EIO: the driver does not answer any more */
bool rgl_staging_upload(rgl_staging *staging, GLuint buffer, size_t offset, const void *bytes,
                        size_t size, mospt_err *err);
