/* mospt/err.h - what went wrong, where, in one sentence.
 *
 * What can fail returns bool and takes a `mospt_err *` last; NULL means that details are not
 * wanted. Whoever finds the fault fills it, callers pass it on, and only the program's front door
 * prints it, once. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum {
    MOSPT_OK = 0,
    MOSPT_EIO,        /* the system refused: sys_errno says why */
    MOSPT_EFORMAT,    /* the bytes are not what they claim to be */
    MOSPT_ENOMEM,     /* no memory, or the memory limit is too small for the task */
    MOSPT_EINVAL,     /* the caller's request makes no sense */
    MOSPT_EEMPTY,     /* a valid input that holds no point */
    MOSPT_ECANCELLED, /* the user asked to stop */
} mospt_code;

typedef enum { MOSPT_AT_FILE, MOSPT_AT_BYTE, MOSPT_AT_LINE } mospt_place_kind;

typedef struct {
    const char *file; /* borrowed; NULL: no file is concerned */
    mospt_place_kind kind;
    uint64_t place; /* byte offset, or line number counted from 1 */
} mospt_where;

typedef struct {
    mospt_code code;
    int sys_errno; /* 0 if the system has nothing to say */
    char file[1024];
    mospt_place_kind place_kind;
    uint64_t place;
    char message[512];
} mospt_err;

static inline mospt_where mospt_nowhere(void)
{
    return (mospt_where){0};
}
static inline mospt_where mospt_at_file(const char *file)
{
    return (mospt_where){.file = file};
}
static inline mospt_where mospt_at_byte(const char *file, uint64_t byte)
{
    return (mospt_where){.file = file, .kind = MOSPT_AT_BYTE, .place = byte};
}
static inline mospt_where mospt_at_line(const char *file, uint64_t line)
{
    return (mospt_where){.file = file, .kind = MOSPT_AT_LINE, .place = line};
}

/* Fills `err` (where not NULL) and returns false, so that `return mospt_err_set(...)` fails in one
 * line. format   a sentence without file, place or final full stop; for MOSPT_EIO the system's
 * words are appended from errno */
bool mospt_err_set(mospt_err *err, mospt_code code, mospt_where where, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* The usual one: memory could not be allocated. */
bool mospt_err_nomem(mospt_err *err, size_t size_bytes);

/* Writes "file: byte N: sentence" to `text`, always terminated. */
void mospt_err_text(const mospt_err *err, char *text, size_t size);
