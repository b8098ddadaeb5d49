#include "render/gl/text.h"

#include "render/gl/program.h"

#include <fontconfig/fontconfig.h>
#include <ft2build.h>
#include FT_FREETYPE_H
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Latin-1: what file names and figures are made of. */
enum { FIRST = 32, LAST = 255, GLYPHS = LAST - FIRST + 1, COLUMNS = 16 };

typedef struct {
    float x, y, u, v;
    float colour[4];
} corner;

struct rgl_text {
    GLuint atlas, program, vao, vertices;
    GLint screen;
    int cell_width, cell_height, ascent; /* pixels */
    corner *corners;                     /* [capacity], owned */
    size_t count, capacity;
};

/* Path of the system's monospace font, owned; NULL if there is none. */
static char *find_font(int *index)
{
    char *path = NULL;
    FcConfig *config = FcInitLoadConfigAndFonts();
    FcPattern *wanted = FcNameParse((const FcChar8 *)"monospace");
    if (config != NULL && wanted != NULL) {
        FcResult result;
        FcChar8 *file = NULL;
        FcConfigSubstitute(config, wanted, FcMatchPattern);
        FcDefaultSubstitute(wanted);
        FcPattern *match = FcFontMatch(config, wanted, &result);
        if (match != NULL && FcPatternGetString(match, FC_FILE, 0, &file) == FcResultMatch)
            path = strdup((const char *)file);
        if (match == NULL || FcPatternGetInteger(match, FC_INDEX, 0, index) != FcResultMatch)
            *index = 0;
        if (match != NULL) FcPatternDestroy(match);
    }
    if (wanted != NULL) FcPatternDestroy(wanted);
    if (config != NULL) FcConfigDestroy(config);
    FcFini();
    return path;
}

/* Copies a glyph into its cell of the atlas, cut off at the cell's edges. */
static void copy_glyph(const rgl_text *t, FT_GlyphSlot slot, int place, uint8_t *pixels)
{
    int stride = t->cell_width * COLUMNS;
    int left = place % COLUMNS * t->cell_width, top = place / COLUMNS * t->cell_height;
    for (int row = 0; row < (int)slot->bitmap.rows; row++)
        for (int column = 0; column < (int)slot->bitmap.width; column++) {
            int x = column + slot->bitmap_left, y = row + t->ascent - slot->bitmap_top;
            if (x < 0 || x >= t->cell_width || y < 0 || y >= t->cell_height) continue;
            pixels[(top + y) * stride + left + x] =
                slot->bitmap.buffer[row * slot->bitmap.pitch + column];
        }
}

static bool rasterise(rgl_text *t, FT_Face face, mospt_err *err)
{
    t->cell_width = (int)((face->size->metrics.max_advance + 63) >> 6);
    if (FT_Load_Char(face, 'M', FT_LOAD_DEFAULT) == 0)
        t->cell_width = (int)((face->glyph->advance.x + 63) >> 6);
    t->ascent = (int)((face->size->metrics.ascender + 63) >> 6);
    t->cell_height = t->ascent + (int)((63 - face->size->metrics.descender) >> 6);
    size_t size = (size_t)t->cell_width * COLUMNS * (size_t)t->cell_height * (GLYPHS / COLUMNS);
    uint8_t *pixels = calloc(size + 1, 1);
    if (pixels == NULL) return mospt_err_nomem(err, size);
    for (int g = 0; g < GLYPHS; g++)
        if (FT_Load_Char(face, (FT_ULong)(FIRST + g), FT_LOAD_RENDER) == 0 &&
            face->glyph->bitmap.pixel_mode == FT_PIXEL_MODE_GRAY)
            copy_glyph(t, face->glyph, g, pixels);
    GL(glGenTextures(1, &t->atlas));
    GL(glBindTexture(GL_TEXTURE_2D, t->atlas));
    GL(glPixelStorei(GL_UNPACK_ALIGNMENT, 1));
    GL(glTexImage2D(GL_TEXTURE_2D, 0, GL_R8, t->cell_width * COLUMNS,
                    t->cell_height * (GLYPHS / COLUMNS), 0, GL_RED, GL_UNSIGNED_BYTE, pixels));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST));
    GL(glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST));
    free(pixels);
    return true;
}

static bool load_font(rgl_text *t, float size_px, mospt_err *err)
{
    int index = 0;
    char *path = find_font(&index);
    FT_Library library = NULL;
    FT_Face face = NULL;
    bool ok = path != NULL && FT_Init_FreeType(&library) == 0 &&
              FT_New_Face(library, path, index, &face) == 0 &&
              FT_Set_Pixel_Sizes(face, 0, (FT_UInt)fmaxf(size_px, 6)) == 0;
    if (ok) ok = rasterise(t, face, err);
    else
        mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                      "no monospace font can be read, so no text is shown");
    if (face != NULL) FT_Done_Face(face);
    if (library != NULL) FT_Done_FreeType(library);
    free(path);
    return ok;
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
    if (!load_font(t, size_px, err) ||
        !rgl_program_create("", RGL_TEXT_VERTEX, RGL_TEXT_FRAGMENT, &t->program, err)) {
        rgl_text_destroy(t);
        return false;
    }
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
    free(text->corners);
    free(text);
}

float rgl_text_line_height(const rgl_text *text)
{
    return (float)text->cell_height;
}

float rgl_text_advance(const rgl_text *text)
{
    return (float)text->cell_width;
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

/* The next character; only one- and two-byte UTF-8 can be Latin-1. */
static int next_character(const unsigned char **at)
{
    unsigned c = *(*at)++;
    if (c < 0x80) return c >= FIRST ? (int)c : '?';
    unsigned value = (c & 0x1f) << 6 | (**at & 0x3f);
    bool two = c >= 0xc2 && c <= 0xc3 && (**at & 0xc0) == 0x80;
    while ((**at & 0xc0) == 0x80)
        (*at)++;
    return two ? (int)value : '?';
}

static bool add_words(rgl_text *t, const rgl_label *label, mospt_err *err)
{
    float size[2] = {(float)t->cell_width, (float)t->cell_height}, x = floorf(label->x),
          y = floorf(label->y);
    for (const unsigned char *at = (const unsigned char *)label->words; *at != '\0'; x += size[0]) {
        int place = next_character(&at) - FIRST;
        if (place == 0) continue;
        float texel[2] = {(float)(place % COLUMNS * t->cell_width),
                          (float)(place / COLUMNS * t->cell_height)};
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
