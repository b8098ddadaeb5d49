#include "preprocess/pose.h"

#include "mospt/file.h"
#include "preprocess/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { FILE_SIZE_MAX = 64 << 20 };
static const char ENDING[] = ".pose.txt";

/* Reads numbers up to `end`; commas count as blanks. Returns how many, or -1 if there is anything
 * else. */
static int read_numbers(const char *text, const char *end, double out[16])
{
    int count = 0;
    for (;;) {
        while (text < end && strchr(" \t\r\n,;", *text) != NULL)
            text++;
        if (text == end) return count;
        if (count == 16 || (text = prep_number_parse(text, end, &out[count])) == NULL) return -1;
        count++;
    }
}

static const char *line_end(const char *text, const char *end)
{
    const char *newline = memchr(text, '\n', (size_t)(end - text));
    return newline != NULL ? newline : end;
}

/* The mark that editors put in front of UTF-8. */
static void blank_mark(char *bytes, size_t size)
{
    if (size >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0) memset(bytes, ' ', 3);
}

static void blank_comments(char *text, char *end)
{
    for (; text < end; text++) {
        char *stop = text + (line_end(text, end) - text),
             *mark = memchr(text, '#', (size_t)(stop - text));
        if (mark != NULL) memset(mark, ' ', (size_t)(stop - mark));
        text = stop;
    }
}

/* 12 numbers are the upper three rows; the last row of 16 must be 0 0 0 1. */
static bool finish_matrix(int count, double m[16])
{
    if (count == 12) m[12] = m[13] = m[14] = 0, m[15] = 1;
    if (count != 12 && count != 16) return false;
    for (int i = 0; i < 16; i++)
        if (!isfinite(m[i])) return false;
    double volume = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) +
                    m[2] * (m[4] * m[9] - m[5] * m[8]);
    return m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1 && fabs(volume) > 1e-12;
}

static bool not_a_matrix(const char *path, uint64_t line, mospt_err *err)
{
    return mospt_err_set(err, MOSPT_EFORMAT,
                         line > 0 ? mospt_at_line(path, line) : mospt_at_file(path),
                         "is no pose: 12 or 16 numbers, row by row, that do not flatten space; the "
                         "last row is 0 0 0 1");
}

bool prep_pose_is_sidecar(const char *path)
{
    size_t n = strlen(path), m = sizeof ENDING - 1;
    return n > m && strcmp(path + n - m, ENDING) == 0;
}

void prep_pose_list_fini(prep_pose_list *list)
{
    for (size_t i = 0; i < list->count; i++)
        free(list->poses[i].name);
    free(list->poses);
    *list = (prep_pose_list){0};
}

/* One line: a name, and its numbers. */
static bool add_line(prep_pose_list *list, const char *path, const char *text, const char *end,
                     uint64_t line, mospt_err *err)
{
    bool quoted = *text == '"';
    const char *name = quoted ? text + 1 : text, *behind = name;
    while (behind < end && (quoted ? *behind != '"' : strchr(" \t,;", *behind) == NULL))
        behind++;
    prep_pose *poses = realloc(list->poses, (list->count + 1) * sizeof *poses);
    if (poses == NULL) return mospt_err_nomem(err, (list->count + 1) * sizeof *poses);
    list->poses = poses;
    prep_pose *pose = &poses[list->count];
    *pose = (prep_pose){.name = strndup(name, (size_t)(behind - name))};
    if (pose->name == NULL) return mospt_err_nomem(err, (size_t)(behind - name));
    list->count++;
    if (quoted && behind < end) behind++;
    return finish_matrix(read_numbers(behind, end, pose->matrix), pose->matrix) ||
           not_a_matrix(path, line, err);
}

bool prep_pose_list_read(const char *path, prep_pose_list *out, mospt_err *err)
{
    prep_pose_list list = {0};
    char *bytes = NULL;
    size_t size = 0;
    bool ok = mospt_file_read_whole(path, FILE_SIZE_MAX, &bytes, &size, err);
    uint64_t line = 0;
    if (ok) blank_mark(bytes, size);
    for (const char *text = bytes, *next; ok && text < bytes + size; text = next) {
        const char *end = line_end(text, bytes + size);
        next = end + 1;
        line++;
        while (text < end && strchr(" \t\r", *text) != NULL)
            text++;
        if (text < end && *text != '#') ok = add_line(&list, path, text, end, line, err);
    }
    free(bytes);
    if (ok) *out = list;
    else prep_pose_list_fini(&list);
    return ok;
}

/* By the scan's own name, or by the last part of the path, folders included or not, with or without
 * the extension. */
static bool is_named(const prep_pose *pose, const char *path, const char *scan)
{
    size_t n = strlen(pose->name), length = strlen(path);
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash != NULL ? slash : path, '.');
    size_t lengths[2] = {length, dot != NULL ? (size_t)(dot - path) : length};
    if (strcmp(pose->name, scan) == 0) return true;
    for (int k = 0; k < 2 && n > 0; k++) {
        const char *tail = path + lengths[k] - n;
        if (lengths[k] >= n && strncmp(tail, pose->name, n) == 0 &&
            (tail == path || tail[-1] == '/'))
            return true;
    }
    return false;
}

static bool read_sidecar(const char *path, double matrix[16], mospt_err *err)
{
    char *bytes = NULL;
    size_t size = 0;
    if (!mospt_file_read_whole(path, FILE_SIZE_MAX, &bytes, &size, err)) return false;
    blank_mark(bytes, size);
    blank_comments(bytes, bytes + size);
    bool ok = finish_matrix(read_numbers(bytes, bytes + size, matrix), matrix) ||
              not_a_matrix(path, 0, err);
    free(bytes);
    return ok;
}

bool prep_pose_find(const prep_pose_list *list, const char *scan_path, const char *scan_name,
                    bool *found, double matrix[16], mospt_err *err)
{
    const char *slash = strrchr(scan_path, '/'), *file = slash != NULL ? slash + 1 : scan_path;
    char sidecar[4096];
    *found = false;
    for (size_t i = 0; list != NULL && i < list->count; i++) {
        if (!is_named(&list->poses[i], scan_path, scan_name)) continue;
        memcpy(matrix, list->poses[i].matrix, sizeof list->poses[i].matrix);
        return *found = true;
    }
    /* scan.las.pose.txt, or scan.pose.txt */
    const char *dot = strrchr(file, '.');
    size_t lengths[2] = {strlen(scan_path), dot != NULL ? (size_t)(dot - scan_path) : 0};
    for (int k = 0; k < 2; k++) {
        if (lengths[k] == 0) continue;
        int n = snprintf(sidecar, sizeof sidecar, "%.*s%s", (int)lengths[k], scan_path, ENDING);
        if (n >= (int)sizeof sidecar || access(sidecar, F_OK) != 0) continue;
        *found = true;
        return read_sidecar(sidecar, matrix, err);
    }
    return true;
}

void prep_pose_multiply(const double a[16], const double b[16], double out[16])
{
    for (int r = 0; r < 4; r++)
        for (int c = 0; c < 4; c++) {
            out[4 * r + c] = 0;
            for (int k = 0; k < 4; k++)
                out[4 * r + c] += a[4 * r + k] * b[4 * k + c];
        }
}
