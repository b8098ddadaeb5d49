#include "render/image.h"

#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* errno of the failed write, for libpng's longjmp loses the way back to it. */
typedef struct {
    FILE *file;
    int sys_errno;
} sink;

static void write_bytes(png_structp png, png_bytep bytes, size_t size)
{
    sink *s = png_get_io_ptr(png);
    if (fwrite(bytes, 1, size, s->file) == size) return;
    s->sys_errno = errno;
    png_error(png, "write");
}

static void flush_bytes(png_structp png)
{
    (void)png;
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png, (void)text;
}

static void on_error(png_structp png, png_const_charp text)
{
    (void)text;
    png_longjmp(png, 1);
}

typedef struct {
    const uint8_t *rgb;
    uint32_t width, height;
    int bits; /* of a channel: 8 or 16 */
} picture;

/* Apart from its caller, because setjmp() and local variables do not mix. */
static bool encode(png_structp png, png_infop info, const picture *p)
{
    const uint16_t probe = 1;
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_set_IHDR(png, info, p->width, p->height, p->bits, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_compression_level(png, 4); /* half the time of the default for 3 % more bytes */
    png_write_info(png, info);
    if (p->bits == 16 && *(const uint8_t *)&probe == 1) png_set_swap(png); /* PNG is big-endian */
    for (uint32_t y = 0; y < p->height; y++)
        png_write_row(png, p->rgb + (size_t)y * p->width * 3 * (size_t)(p->bits / 8));
    png_write_end(png, NULL);
    return true;
}

static bool write_file(FILE *file, const char *path, const picture *p, mospt_err *err)
{
    sink s = {.file = file};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, on_error, on_warning);
    png_infop info = png != NULL ? png_create_info_struct(png) : NULL;
    bool ok = info != NULL || mospt_err_nomem(err, (size_t)p->width * 4);
    if (ok) {
        png_set_write_fn(png, &s, write_bytes, flush_bytes);
        ok = encode(png, info, p);
        errno = s.sys_errno;
        if (!ok) mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot write the picture");
    }
    png_destroy_write_struct(&png, &info);
    return ok;
}

static bool replace_file(const char *path, const picture *p, mospt_err *err)
{
    size_t size = strlen(path) + 32;
    char *temporary = malloc(size);
    if (temporary == NULL) return mospt_err_nomem(err, size);
    snprintf(temporary, size, "%s.%ld.part", path, (long)getpid());
    FILE *file = fopen(temporary, "wb");
    bool ok = file != NULL ||
              mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot write the picture");
    if (ok) {
        ok = write_file(file, path, p, err);
        bool closed = fclose(file) == 0;
        if (ok && (!closed || rename(temporary, path) != 0))
            ok = mospt_err_set(err, MOSPT_EIO, mospt_at_file(path), "cannot write the picture");
        if (!ok) unlink(temporary);
    }
    free(temporary);
    return ok;
}

bool rend_image_write(const char *path, const uint8_t *rgb, uint32_t width, uint32_t height,
                      mospt_err *err)
{
    return replace_file(path, &(picture){rgb, width, height, 8}, err);
}

bool rend_image_write16(const char *path, const uint16_t *rgb, uint32_t width, uint32_t height,
                        mospt_err *err)
{
    return replace_file(path, &(picture){(const uint8_t *)rgb, width, height, 16}, err);
}
