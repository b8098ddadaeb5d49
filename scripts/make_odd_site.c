/* scripts/make_odd_site.c - sites that bring trees and sorts to their worst, to be built in about
 * the time of an ordinary one. Binary PLY; the same arguments give the same bytes. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COPIES = 10000, RECORD_SIZE = 27, BUFFER_RECORDS = 4096 };

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

static bool write_points(FILE *out, void (*make)(maker *m), uint64_t count)
{
    static uint8_t buffer[BUFFER_RECORDS * RECORD_SIZE];
    maker m = {.random = 1, .left = count};
    size_t filled = 0;
    for (; m.left > 0; m.left--) {
        uint8_t *record = buffer + filled++ * RECORD_SIZE;
        uint64_t colour = next_random(&m.random);
        make(&m);
        memcpy(record, m.at, sizeof m.at);
        memcpy(record + sizeof m.at, &colour, 3);
        if (filled < BUFFER_RECORDS && m.left > 1) continue;
        if (fwrite(buffer, RECORD_SIZE, filled, out) != filled) return false;
        filled = 0;
    }
    return true;
}

int main(int argc, char **argv)
{
    int kind = argc == 4 ? find_kind(argv[1]) : KIND_COUNT;
    uint64_t count = argc == 4 ? strtoull(argv[2], NULL, 10) : 0;
    if (kind == KIND_COUNT || count == 0) {
        fprintf(stderr, "usage: make_odd_site KIND POINTS FILE.ply\n");
        for (int k = 0; k < KIND_COUNT; k++)
            fprintf(stderr, "  %-7s %s\n", KINDS[k].name, KINDS[k].what);
        return 2;
    }
    FILE *out = fopen(argv[3], "wb");
    bool ok = out != NULL &&
              fprintf(out,
                      "ply\nformat binary_little_endian 1.0\nelement vertex %llu\n"
                      "property double x\nproperty double y\nproperty double z\n"
                      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
                      (unsigned long long)count) > 0 &&
              write_points(out, KINDS[kind].make, count);
    if (out != NULL && fclose(out) != 0) ok = false;
    if (!ok) perror(argv[3]);
    return ok ? 0 : 1;
}
