/* scripts/make_odd_site.c - sites that bring trees and sorts to their worst, to be built in about
 * the time of an ordinary one. Binary PLY with doubles, or PCD with floats for programs that read
 * nothing else; the same arguments give the same bytes. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COPIES = 10000, RECORD_SIZE_MAX = 27, BUFFER_RECORDS = 4096 };

static const char PLY_HEADER[] =
    "ply\nformat binary_little_endian 1.0\nelement vertex %llu\nproperty double x\n"
    "property double y\nproperty double z\nproperty uchar red\nproperty uchar green\n"
    "property uchar blue\nend_header\n";
static const char PCD_HEADER[] =
    "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH %1$llu\n"
    "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS %1$llu\nDATA binary\n";

typedef struct {
    uint64_t random, left; /* points that are still to come, this one included */
    double at[3];          /* of the point before */
} maker;

static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

static double unit(maker *m)
{
    return (double)(next_random(&m->random) >> 11) * 0x1p-53;
}

/* What a tripod sees of a flat yard with walls: as many points within one metre as between two and
 * four. */
static void tripod(maker *m)
{
    double angle = 6.283185307179586 * unit(m), distance = exp2(8 * unit(m) - 1);
    m->at[0] = distance * cos(angle);
    m->at[1] = distance * sin(angle);
    m->at[2] = distance > 40 ? 10 * unit(m) : 0.005 * unit(m);
}

static void spot(maker *m)
{
    (void)m;
}

static void line(maker *m)
{
    m->at[0] = 1000 * unit(m);
}

static void plane(maker *m)
{
    m->at[0] = 1000 * unit(m);
    m->at[1] = 1000 * unit(m);
}

static void copies(maker *m)
{
    for (int a = 0; a < 3 && m->left % COPIES == 0; a++)
        m->at[a] = 100 * unit(m);
}

/* 99 of 100 points in a cubic metre of a square kilometre. */
static void dense(maker *m)
{
    bool elsewhere = m->left % 100 == 0;
    for (int a = 0; a < 3; a++)
        m->at[a] = (elsewhere && a < 2 ? 1000 : 1) * unit(m);
}

static void far(maker *m, double distance)
{
    tripod(m);
    if (m->left == 1) m->at[0] = distance;
}

static void far_4(maker *m)
{
    far(m, 1e4);
}

static void far_6(maker *m)
{
    far(m, 1e6);
}

static void far_9(maker *m)
{
    far(m, 1e9);
}

static const struct {
    const char *name, *what;
    void (*make)(maker *m);
} KINDS[] = {
    {"tripod", "an ordinary one, to compare with", tripod},
    {"spot", "all points at one position", spot},
    {"line", "on a line", line},
    {"plane", "in a plane", plane},
    {"copies", "ten thousand points at each position", copies},
    {"dense", "99 of 100 points in one cubic metre of a square kilometre", dense},
    {"far4", "an ordinary one with one point 10^4 m away", far_4},
    {"far6", "with one 10^6 m away", far_6},
    {"far9", "with one 10^9 m away", far_9},
};
enum { KIND_COUNT = sizeof KINDS / sizeof KINDS[0] };

static int find_kind(const char *name)
{
    int k = 0;
    while (k < KIND_COUNT && strcmp(KINDS[k].name, name) != 0)
        k++;
    return k;
}

/* Writes a record, and returns where the next one goes. */
static uint8_t *put(uint8_t *to, const double at[3], uint64_t colour, bool is_pcd)
{
    for (int a = 0; a < 3; a++) {
        float narrow = (float)at[a];
        if (is_pcd) memcpy(to, &narrow, sizeof narrow);
        else memcpy(to, &at[a], sizeof at[a]);
        to += is_pcd ? sizeof narrow : sizeof at[a];
    }
    colour &= 0xffffff;
    memcpy(to, &colour, is_pcd ? 4 : 3);
    return to + (is_pcd ? 4 : 3);
}

static bool write_points(FILE *out, void (*make)(maker *m), uint64_t count, bool is_pcd)
{
    static uint8_t buffer[BUFFER_RECORDS * RECORD_SIZE_MAX];
    maker m = {.random = 1, .left = count};
    uint8_t *end = buffer;
    for (; m.left > 0; m.left--) {
        uint64_t colour = next_random(&m.random);
        make(&m);
        end = put(end, m.at, colour, is_pcd);
        if (m.left > 1 && end <= buffer + sizeof buffer - RECORD_SIZE_MAX) continue;
        size_t size = (size_t)(end - buffer);
        if (fwrite(buffer, 1, size, out) != size) return false;
        end = buffer;
    }
    return true;
}

int main(int argc, char **argv)
{
    int kind = argc == 4 ? find_kind(argv[1]) : KIND_COUNT;
    unsigned long long count = argc == 4 ? strtoull(argv[2], NULL, 10) : 0;
    if (kind == KIND_COUNT || count == 0) {
        fprintf(stderr, "usage: make_odd_site KIND POINTS FILE.ply|FILE.pcd\n");
        for (int k = 0; k < KIND_COUNT; k++)
            fprintf(stderr, "  %-7s %s\n", KINDS[k].name, KINDS[k].what);
        return 2;
    }
    size_t n = strlen(argv[3]);
    bool is_pcd = n > 4 && strcmp(argv[3] + n - 4, ".pcd") == 0;
    FILE *out = fopen(argv[3], "wb");
    bool ok = out != NULL;
    if (ok && is_pcd) ok = fprintf(out, PCD_HEADER, count) > 0;
    else if (ok) ok = fprintf(out, PLY_HEADER, count) > 0;
    ok = ok && write_points(out, KINDS[kind].make, count, is_pcd);
    if (out != NULL && fclose(out) != 0) ok = false;
    if (!ok) perror(argv[3]);
    return ok ? 0 : 1;
}
