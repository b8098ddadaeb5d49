#include "render/gl/staging.h"

#include <string.h>

/* Large enough that a copy is worth its call, small enough that waiting for one is short. */
#define SEGMENT_SIZE ((size_t)4 << 20)
#define RING_SIZE (RGL_STAGING_SEGMENTS * SEGMENT_SIZE)
#define WAIT_NS UINT64_C(10000000000) /* a driver that takes longer has gone */

bool rgl_staging_is_mapped(void)
{
    return epoxy_has_gl_extension("GL_ARB_buffer_storage");
}

void rgl_staging_fini(rgl_staging *staging)
{
    for (int s = 0; s < RGL_STAGING_SEGMENTS; s++)
        glDeleteSync(staging->passed[s]);
    glDeleteBuffers(1, &staging->buffer); /* unmaps it */
    *staging = (rgl_staging){0};
}

/* Without memory for a ring, too, the driver copies. */
static void make_ring(rgl_staging *s)
{
    const GLbitfield flags = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    GL(glGenBuffers(1, &s->buffer));
    if (!rgl_staging_is_mapped()) return;
    GL(glBindBuffer(GL_COPY_READ_BUFFER, s->buffer));
    glBufferStorage(GL_COPY_READ_BUFFER, (GLsizeiptr)RING_SIZE, NULL, flags);
    if (glGetError() == GL_NO_ERROR)
        s->memory = glMapBufferRange(GL_COPY_READ_BUFFER, 0, (GLsizeiptr)RING_SIZE, flags);
}

static bool wait_for(GLsync *passed, mospt_err *err)
{
    if (*passed == NULL) return true;
    GLenum state = glClientWaitSync(*passed, GL_SYNC_FLUSH_COMMANDS_BIT, WAIT_NS);
    glDeleteSync(*passed);
    *passed = NULL;
    if (state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED) return true;
    return mospt_err_set(err, MOSPT_EIO, mospt_nowhere(),
                         "the graphics driver does not answer; the dataset is unharmed, start "
                         "again");
}

static bool turn_to_next(rgl_staging *s, mospt_err *err)
{
    s->passed[s->segment] = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    s->segment = (s->segment + 1) % RGL_STAGING_SEGMENTS;
    s->used = 0;
    return wait_for(&s->passed[s->segment], err);
}

bool rgl_staging_upload(rgl_staging *staging, GLuint buffer, size_t offset, const void *bytes,
                        size_t size, mospt_err *err)
{
    if (staging->buffer == 0) make_ring(staging);
    GL(glBindBuffer(GL_COPY_WRITE_BUFFER, buffer));
    if (staging->memory == NULL) {
        GL(glBufferSubData(GL_COPY_WRITE_BUFFER, (GLintptr)offset, (GLsizeiptr)size, bytes));
        return true;
    }
    GL(glBindBuffer(GL_COPY_READ_BUFFER, staging->buffer));
    for (size_t done = 0, part; done < size; done += part) {
        if (staging->used == SEGMENT_SIZE && !turn_to_next(staging, err)) return false;
        part = SEGMENT_SIZE - staging->used;
        if (part > size - done) part = size - done;
        size_t place = staging->segment * SEGMENT_SIZE + staging->used;
        memcpy(staging->memory + place, (const uint8_t *)bytes + done, part);
        GL(glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, (GLintptr)place,
                               (GLintptr)(offset + done), (GLsizeiptr)part));
        staging->used += part;
    }
    return true;
}
