#include "render/gl/text.h"

#include "render/gl/program.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    float x, y, u, v;
    float colour[4];
} corner;

struct rgl_text {
    GLuint atlas, program, vao, vertices;
    GLint screen;
    rgl_font font;
    corner *corners; /* [capacity], owned */
    size_t count, capacity;
};

static void upload_atlas(rgl_text *t)
{
    const rgl_font *f = &t->font;
    GL(glGenTextures(1, &t->atlas));
    GL(glBindTexture(GL_TEXTURE_2D, t->atlas));
    GL(glPixelStorei(GL_UNPACK_ALIGNMENT, 1));
    GL(glTexImage2D(GL_TEXTURE_2D, 0, GL_R8, f->cell_width * f->columns, f->cell_height * f->rows,
                    0, GL_RED, GL_UNSIGNED_BYTE, f->atlas));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST));
}

static void make_buffers(rgl_text *t)
{
    GL(glGenVertexArrays(1, &t->vao));
    GL(glGenBuffers(1, &t->vertices));
    GL(glBindVertexArray(t->vao));
    GL(glBindBuffer(GL_ARRAY_BUFFER, t->vertices));
    GL(glEnableVertexAttribArray(0));
    GL(glEnableVertexAttribArray(1));
    GL(glVertexAttribPointer(0, 4, GL_FLOAT, GL_FALSE, sizeof(corner), NULL));
    GL(glVertexAttribPointer(1, 4, GL_FLOAT, GL_FALSE, sizeof(corner),
                             (const void *)offsetof(corner, colour)));
    t->screen = glGetUniformLocation(t->program, "screen");
}

bool rgl_text_create(float size_px, rgl_text **out, mospt_err *err)
{
    rgl_text *t = calloc(1, sizeof *t);
    if (t == NULL) return mospt_err_nomem(err, sizeof *t);
    if (!rgl_font_init(size_px, &t->font, err) ||
        !rgl_program_create("", RGL_TEXT_VERTEX, RGL_TEXT_FRAGMENT, &t->program, err)) {
        rgl_text_destroy(t);
        return false;
    }
    upload_atlas(t);
    make_buffers(t);
    *out = t;
    return true;
}

void rgl_text_destroy(rgl_text *text)
{
    if (text == NULL) return;
    glDeleteTextures(1, &text->atlas);
    glDeleteProgram(text->program);
    glDeleteBuffers(1, &text->vertices);
    glDeleteVertexArrays(1, &text->vao);
    rgl_font_fini(&text->font);
    free(text->corners);
    free(text);
}

rgl_metrics rgl_text_metrics(const rgl_text *text)
{
    return rgl_font_metrics(&text->font);
}

/* Two triangles; u below 0 is a plain panel. */
static bool add_quad(rgl_text *t, const rgl_label *label, float x, float y, const float size[2],
                     const float texel[2], mospt_err *err)
{
    static const float unit[6][2] = {{0, 0}, {1, 0}, {0, 1}, {0, 1}, {1, 0}, {1, 1}};
    if (t->count + 6 > t->capacity) {
        size_t capacity = t->capacity > 0 ? 2 * t->capacity : 6 * 256;
        corner *larger = realloc(t->corners, capacity * sizeof *larger);
        if (larger == NULL) return mospt_err_nomem(err, capacity * sizeof *larger);
        t->corners = larger, t->capacity = capacity;
    }
    for (int i = 0; i < 6; i++) {
        corner *c = &t->corners[t->count++];
        *c = (corner){
            .x = x + unit[i][0] * size[0], .y = y + unit[i][1] * size[1], .u = -1, .v = -1};
        if (texel != NULL)
            c->u = texel[0] + unit[i][0] * size[0], c->v = texel[1] + unit[i][1] * size[1];
        memcpy(c->colour, label->colour, sizeof c->colour);
    }
    return true;
}

static bool add_words(rgl_text *t, const rgl_label *label, mospt_err *err)
{
    float size[2] = {(float)t->font.cell_width, (float)t->font.cell_height};
    float x = floorf(label->x), y = floorf(label->y);
    for (const unsigned char *at = (const unsigned char *)label->words; *at != '\0'; x += size[0]) {
        int place[2];
        if (!rgl_font_next(&t->font, &at, place)) continue;
        float texel[2] = {(float)place[0], (float)place[1]};
        if (!add_quad(t, label, x, y, size, texel, err)) return false;
    }
    return true;
}

bool rgl_text_draw(rgl_text *text, uint32_t width, uint32_t height, const rgl_label *labels,
                   uint32_t count, mospt_err *err)
{
    text->count = 0;
    for (uint32_t i = 0; i < count; i++) {
        const float size[2] = {labels[i].panel_size[0], labels[i].panel_size[1]};
        bool panel = size[0] > 0 && size[1] > 0;
        bool ok = panel ? add_quad(text, &labels[i], labels[i].x, labels[i].y, size, NULL, err)
                        : add_words(text, &labels[i], err);
        if (!ok) return false;
    }
    if (text->count == 0) return true;
    GL(glViewport(0, 0, (GLsizei)width, (GLsizei)height));
    GL(glDisable(GL_DEPTH_TEST));
    GL(glEnable(GL_BLEND));
    GL(glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA));
    GL(glUseProgram(text->program));
    GL(glUniform2f(text->screen, (float)width, (float)height));
    GL(glActiveTexture(GL_TEXTURE0));
    GL(glBindTexture(GL_TEXTURE_2D, text->atlas));
    GL(glBindVertexArray(text->vao));
    GL(glBindBuffer(GL_ARRAY_BUFFER, text->vertices));
    GL(glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(text->count * sizeof *text->corners),
                    text->corners, GL_STREAM_DRAW));
    GL(glDrawArrays(GL_TRIANGLES, 0, (GLsizei)text->count));
    GL(glDisable(GL_BLEND));
    return true;
}
