/* preprocess/pose.h - where a scan stands, for files that do not say it themselves or say it
 * wrongly.
 *
 * A pose is a row-major 4 x 4 matrix from the coordinates of the file to the world. It comes from a
 * sidecar beside the scan, NAME.pose.txt with 12 or 16 numbers and comments behind #, or from one
 * list for many scans: a line each, the scan's file name and its numbers. */
#pragma once
#include "mospt/err.h"

typedef struct {
    char *name; /* owned; of a file, with or without its extension, or of a scan in a file */
    double matrix[16];
} prep_pose;

typedef struct {
    prep_pose *poses; /* [count], owned */
    size_t count;
} prep_pose_list;

/* Reads a list. Lines that are empty or begin with # are passed over; a name with blanks stands in
 * double quotes. errors   MOSPT_EIO; MOSPT_EFORMAT with the line */
bool prep_pose_list_read(const char *path, prep_pose_list *out, mospt_err *err);
void prep_pose_list_fini(prep_pose_list *list);

/* Finds the pose of a scan: in the list (NULL: none) by its scan name or file name, with as many of
 * its folders as are given, with or without extension; else in a sidecar. found    out, false if
 * there is none errors   MOSPT_EIO, MOSPT_EFORMAT: a sidecar that is no matrix */
bool prep_pose_find(const prep_pose_list *list, const char *scan_path, const char *scan_name,
                    bool *found, double matrix[16], mospt_err *err);

/* True for the name of a sidecar, which is no scan. */
bool prep_pose_is_sidecar(const char *path);

/* out = a b; out may be neither of them. */
void prep_pose_multiply(const double a[16], const double b[16], double out[16]);

static inline void prep_pose_apply(const double m[16], const double in[3], double out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = m[4 * r] * in[0] + m[4 * r + 1] * in[1] + m[4 * r + 2] * in[2] + m[4 * r + 3];
}
