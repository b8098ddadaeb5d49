#include "render/gl/font.h"

#include <fontconfig/fontconfig.h>
#include <ft2build.h>
#include FT_FREETYPE_H
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Latin-1: what file names and figures are made of. In place of its control characters, dashes,
 * quotation marks and the like: those of Windows-1252. */
enum { FIRST = 32, LAST = 255, GLYPHS = LAST - FIRST + 1, COLUMNS = 16, ROWS = GLYPHS / COLUMNS };
enum { MARKS_FIRST = 0x80, MARKS = 32 };
static const uint16_t marks[MARKS] = {
    0x20ac, 0,      0x201a, 0x0192, 0x201e, 0x2026, 0x2020, 0x2021, 0x02c6, 0x2030, 0x0160,
    0x2039, 0x0152, 0,      0x017d, 0,      0,      0x2018, 0x2019, 0x201c, 0x201d, 0x2022,
    0x2013, 0x2014, 0x02dc, 0x2122, 0x0161, 0x203a, 0x0153, 0,      0x017e, 0x0178};

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
static void copy_glyph(rgl_font *f, FT_GlyphSlot slot, int place, int ascent)
{
    int stride = f->cell_width * COLUMNS;
    int left = place % COLUMNS * f->cell_width, top = place / COLUMNS * f->cell_height;
    for (int row = 0; row < (int)slot->bitmap.rows; row++)
        for (int column = 0; column < (int)slot->bitmap.width; column++) {
            int x = column + slot->bitmap_left, y = row + ascent - slot->bitmap_top;
            if (x < 0 || x >= f->cell_width || y < 0 || y >= f->cell_height) continue;
            f->atlas[(top + y) * stride + left + x] =
                slot->bitmap.buffer[row * slot->bitmap.pitch + column];
        }
}

static bool rasterise(rgl_font *f, FT_Face face, mospt_err *err)
{
    f->cell_width = (int)((face->size->metrics.max_advance + 63) >> 6);
    if (FT_Load_Char(face, 'M', FT_LOAD_DEFAULT) == 0)
        f->cell_width = (int)((face->glyph->advance.x + 63) >> 6);
    int ascent = (int)((face->size->metrics.ascender + 63) >> 6);
    f->cell_height = ascent + (int)((63 - face->size->metrics.descender) >> 6);
    f->columns = COLUMNS, f->rows = ROWS;
    size_t size = (size_t)f->cell_width * COLUMNS * (size_t)f->cell_height * ROWS;
    f->atlas = calloc(size + 1, 1);
    if (f->atlas == NULL) return mospt_err_nomem(err, size);
    for (int g = 0; g < GLYPHS; g++) {
        int mark = FIRST + g - MARKS_FIRST;
        FT_ULong character = (FT_ULong)(FIRST + g);
        if (mark >= 0 && mark < MARKS) character = marks[mark] != 0 ? marks[mark] : ' ';
        if (FT_Load_Char(face, character, FT_LOAD_RENDER) == 0 &&
            face->glyph->bitmap.pixel_mode == FT_PIXEL_MODE_GRAY)
            copy_glyph(f, face->glyph, g, ascent);
    }
    return true;
}

bool rgl_font_init(float size_px, rgl_font *out, mospt_err *err)
{
    int index = 0;
    char *path = find_font(&index);
    rgl_font font = {0};
    FT_Library library = NULL;
    FT_Face face = NULL;
    bool ok = path != NULL && FT_Init_FreeType(&library) == 0 &&
              FT_New_Face(library, path, index, &face) == 0 &&
              FT_Set_Pixel_Sizes(face, 0, (FT_UInt)fmaxf(size_px, 6)) == 0;
    if (ok) ok = rasterise(&font, face, err);
    else
        mospt_err_set(err, MOSPT_EINVAL, mospt_nowhere(),
                      "no monospace font can be read, so no text is shown");
    if (face != NULL) FT_Done_Face(face);
    if (library != NULL) FT_Done_FreeType(library);
    free(path);
    if (ok) *out = font;
    return ok;
}

void rgl_font_fini(rgl_font *font)
{
    free(font->atlas);
    *font = (rgl_font){0};
}

rgl_metrics rgl_font_metrics(const rgl_font *font)
{
    return (rgl_metrics){.advance = (float)font->cell_width, .line = (float)font->cell_height};
}

/* The place of the next character among those of the font. */
static int next_character(const unsigned char **at)
{
    unsigned c = *(*at)++;
    if (c < 0x80) return c >= FIRST ? (int)c : '?';
    unsigned value = c >= 0xe0 ? c & 0xf : c & 0x1f;
    for (; (**at & 0xc0) == 0x80; (*at)++)
        value = value << 6 | (**at & 0x3f);
    for (int m = 0; m < MARKS; m++)
        if (marks[m] != 0 && value == marks[m]) return MARKS_FIRST + m;
    return value >= MARKS_FIRST + MARKS && value <= LAST ? (int)value : '?';
}

uint32_t rgl_font_length(const char *words)
{
    uint32_t count = 0;
    for (const unsigned char *at = (const unsigned char *)words; *at != '\0'; count++)
        next_character(&at);
    return count;
}

bool rgl_font_next(const rgl_font *font, const unsigned char **at, int texel[2])
{
    int place = next_character(at) - FIRST;
    texel[0] = place % COLUMNS * font->cell_width;
    texel[1] = place / COLUMNS * font->cell_height;
    return place != 0;
}

/* ---- into a picture ---- */

typedef struct {
    uint8_t *rgb;
    int width, height;
} picture;

static void blend(const picture *p, int x, int y, const float colour[4], float cover)
{
    if (x < 0 || x >= p->width || y < 0 || y >= p->height) return;
    uint8_t *pixel = p->rgb + 3 * ((size_t)y * (size_t)p->width + (size_t)x);
    float opacity = colour[3] * cover;
    for (int c = 0; c < 3; c++)
        pixel[c] = (uint8_t)((float)pixel[c] * (1 - opacity) + 255 * colour[c] * opacity + 0.5f);
}

static void draw_panel(const picture *p, const rgl_label *label)
{
    int left = (int)lroundf(label->x), right = (int)lroundf(label->x + label->panel_size[0]);
    int top = (int)lroundf(label->y), bottom = (int)lroundf(label->y + label->panel_size[1]);
    for (int y = top; y < bottom; y++)
        for (int x = left; x < right; x++)
            blend(p, x, y, label->colour, 1);
}

static void draw_words(const picture *p, const rgl_font *font, const rgl_label *label)
{
    int left = (int)floorf(label->x), top = (int)floorf(label->y), texel[2];
    const unsigned char *at = (const unsigned char *)label->words;
    for (; *at != '\0'; left += font->cell_width) {
        if (!rgl_font_next(font, &at, texel)) continue;
        for (int y = 0; y < font->cell_height; y++)
            for (int x = 0; x < font->cell_width; x++) {
                int place = (texel[1] + y) * font->columns * font->cell_width + texel[0] + x;
                uint8_t cover = font->atlas[place];
                if (cover > 0) blend(p, left + x, top + y, label->colour, (float)cover / 255);
            }
    }
}

void rgl_font_draw(const rgl_font *font, uint32_t width, uint32_t height, const rgl_label *labels,
                   uint32_t count, uint8_t *rgb)
{
    const picture p = {rgb, (int)width, (int)height};
    for (uint32_t i = 0; i < count; i++) {
        bool panel = labels[i].panel_size[0] > 0 && labels[i].panel_size[1] > 0;
        if (panel) draw_panel(&p, &labels[i]);
        else draw_words(&p, font, &labels[i]);
    }
}
