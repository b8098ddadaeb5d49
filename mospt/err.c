#include "mospt/err.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

bool mospt_err_set(mospt_err *err, mospt_code code, mospt_where where, const char *format, ...)
{
    int sys_errno = code == MOSPT_EIO ? errno : 0;
    if (err == NULL) return false;
    *err = (mospt_err){.code = code, .sys_errno = sys_errno};
    err->place_kind = where.kind;
    err->place = where.place;
    if (where.file != NULL) snprintf(err->file, sizeof err->file, "%s", where.file);

    va_list args;
    va_start(args, format);
    vsnprintf(err->message, sizeof err->message, format, args);
    va_end(args);
    if (sys_errno != 0) {
        size_t used = strlen(err->message);
        snprintf(err->message + used, sizeof err->message - used, ": %s", strerror(sys_errno));
    }
    return false;
}

bool mospt_err_nomem(mospt_err *err, size_t size_bytes)
{
    return mospt_err_set(err, MOSPT_ENOMEM, mospt_nowhere(), "no memory for %zu bytes", size_bytes);
}

void mospt_err_text(const mospt_err *err, char *text, size_t size)
{
    const char *file = err->file;
    const char *colon = file[0] != '\0' ? ": " : "";
    if (err->place_kind == MOSPT_AT_BYTE)
        snprintf(text, size, "%s%sbyte %" PRIu64 ": %s", file, colon, err->place, err->message);
    else if (err->place_kind == MOSPT_AT_LINE)
        snprintf(text, size, "%s%sline %" PRIu64 ": %s", file, colon, err->place, err->message);
    else snprintf(text, size, "%s%s%s", file, colon, err->message);
}
