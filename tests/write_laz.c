#include "tests/write_laz.h"

#include "preprocess/bytes.h"
#include "tests/write_las.h"
#include "tests/write_laz_coder.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    int32_t v[5];
    bool low;
} median;

/* As the original does it, case by case. */
static void add_median(median *m, int32_t x)
{
    int32_t *v = m->v, mirrored[5];
    for (int i = 0; i < 5 && m->low; i++)
        mirrored[i] = ~v[4 - i];
    if (m->low) v = mirrored, x = ~x;
    bool is_below = x < v[2];
    if (is_below) {
        v[4] = v[3];
        v[3] = v[2];
        int at = 2;
        for (; at > 0 && x < v[at - 1]; at--)
            v[at] = v[at - 1];
        v[at] = x;
    } else if (x < v[3]) {
        v[4] = v[3];
        v[3] = x;
    } else {
        v[4] = x;
    }
    for (int i = 0; i < 5 && m->low; i++)
        m->v[i] = ~mirrored[4 - i];
    if (!is_below) m->low = !m->low;
}

typedef struct {
    uint32_t at, newest;
    uint64_t time[4];
    int32_t step[4], extremes[4];
    write_laz_model *first, *multiple, *context[9];
    write_laz_number n;
} gps_state;

static void doubt(gps_state *g, int32_t delta)
{
    if (++g->extremes[g->at] <= 3) return;
    g->step[g->at] = delta;
    g->extremes[g->at] = 0;
}

static bool is_near(uint64_t a, uint64_t b)
{
    int64_t d = (int64_t)(a - b);
    return d == (int32_t)d;
}

/* Another sequence that is near, as hops from this one; 0: none. */
static uint32_t find_sequence(const gps_state *g, uint64_t time)
{
    for (uint32_t i = 1; i < 4; i++) {
        if (is_near(time, g->time[(g->at + i) & 3])) return i;
    }
    return 0;
}

static void put_gps(write_laz_coder *c, gps_state *g, uint64_t time, bool has_same)
{
    uint32_t i = g->at, same = has_same, sym;
    int32_t step = g->step[i], delta = (int32_t)(time - g->time[i]);
    write_laz_model **slot = step == 0 ? &g->first : &g->multiple;
    uint32_t symbols = (step == 0 ? 5 : 515) + same, far = step == 0 ? 1 + same : 511 + same;
    if (has_same && time == g->time[i]) {
        write_laz_symbol(c, slot, symbols, step == 0 ? 0 : 511);
    } else if (!is_near(time, g->time[i])) {
        uint32_t hops = find_sequence(g, time);
        write_laz_symbol(c, slot, symbols, far + hops);
        if (hops > 0) {
            g->at = (i + hops) & 3;
            put_gps(c, g, time, has_same);
            return;
        }
        write_laz_integer(c, &g->n, 32, &g->context[8], (uint32_t)(g->time[i] >> 32),
                          (uint32_t)(time >> 32));
        write_laz_bits(c, 32, (uint32_t)time);
        g->newest = g->at = (g->newest + 1) & 3;
        g->step[g->at] = g->extremes[g->at] = 0;
    } else if (step == 0) {
        write_laz_symbol(c, slot, symbols, same);
        write_laz_integer(c, &g->n, 32, &g->context[0], 0, (uint32_t)delta);
        g->step[i] = delta;
        g->extremes[i] = 0;
    } else {
        double times = (double)delta / step;
        int32_t multi = (int32_t)(times + (times < 0 ? -0.5 : 0.5));
        if (times > 500) multi = 500;
        if (times < -10) multi = -10;
        sym = multi >= 0 ? (uint32_t)multi : (uint32_t)(500 - multi);
        uint32_t context = multi == 1    ? 1
                           : multi == 0  ? 7
                           : multi < -9  ? 6
                           : multi < 0   ? 5
                           : multi < 10  ? 2
                           : multi < 500 ? 3
                                         : 4;
        write_laz_symbol(c, slot, symbols, sym);
        write_laz_integer(c, &g->n, 32, &g->context[context], (uint32_t)multi * (uint32_t)step,
                          (uint32_t)delta);
        if (multi == 1) g->extremes[i] = 0;
        if (multi == 0 || multi == 500 || multi == -10) doubt(g, delta);
    }
    g->time[g->at] = time;
}

static void put_old_gps(write_laz_coder *c, gps_state *g, uint64_t time)
{
    bool near = is_near(time, g->time[0]);
    int32_t step = g->step[0], delta = (int32_t)(time - g->time[0]);
    if (step == 0) {
        write_laz_symbol(c, &g->first, 3, time == g->time[0] ? 0 : near ? 1 : 2);
        if (near && time != g->time[0]) {
            write_laz_integer(c, &g->n, 32, &g->context[0], 0, (uint32_t)delta);
            g->step[0] = delta;
        }
    } else if (time == g->time[0]) {
        write_laz_symbol(c, &g->multiple, 512, 511);
    } else if (near) {
        double times = (double)delta / step;
        uint32_t multi = times >= 508.5 ? 509 : times < 0.5 ? 0 : (uint32_t)(times + 0.5);
        uint32_t predicted = multi == 0 ? (uint32_t)(step / 4) : multi * (uint32_t)step;
        write_laz_symbol(c, &g->multiple, 512, multi);
        write_laz_integer(c, &g->n, 32,
                          &g->context[multi == 1   ? 1
                                      : multi == 0 ? 2
                                      : multi < 10 ? 3
                                      : multi < 50 ? 4
                                                   : 5],
                          predicted, (uint32_t)delta);
        if (multi == 1) g->step[0] = delta, g->extremes[0] = 0;
        if (multi == 0 || multi == 509) doubt(g, delta);
    } else {
        write_laz_symbol(c, &g->multiple, 512, 510);
    }
    if (!near) write_laz_bits_64(c, time);
    g->time[0] = time;
}

typedef struct {
    write_laz_model *changed, *byte[6];
    write_laz_number n;
    write_laz_model *context[6];
} rgb_state;

static int32_t clamp_8(int32_t v)
{
    return v < 0 ? 0 : v > 255 ? 255 : v;
}

static void put_rgb(write_laz_coder *c, rgb_state *s, const uint8_t *last, const uint8_t *p)
{
    static const uint8_t order[6] = {0, 1, 2, 4, 3, 5};
    uint32_t changed = 0;
    for (uint32_t i = 0; i < 6; i++)
        changed |= (uint32_t)(last[i] != p[i]) << i;
    bool is_grey = p[0] == p[2] && p[0] == p[4] && p[1] == p[3] && p[1] == p[5];
    if (!is_grey) changed |= 64;
    write_laz_symbol(c, &s->changed, 128, changed);
    for (uint32_t k = 0; k < 6; k++) {
        uint32_t i = order[k], at = i & 1;
        if (!(changed >> i & 1) || (i > 1 && is_grey)) continue;
        int32_t move = p[at] - last[at], predicted = last[i];
        if (i > 3) move = (move + p[2 + at] - last[2 + at]) / 2;
        if (i > 1) predicted = clamp_8(predicted + move);
        write_laz_symbol(c, &s->byte[i], 256, (uint32_t)(p[i] - predicted) & 255);
    }
}

static void put_old_rgb(write_laz_coder *c, rgb_state *s, const uint8_t *last, const uint8_t *p)
{
    uint32_t changed = 0;
    for (uint32_t i = 0; i < 6; i++)
        changed |= (uint32_t)(last[i] != p[i]) << i;
    write_laz_symbol(c, &s->changed, 64, changed);
    for (uint32_t i = 0; i < 6; i++) {
        if (changed >> i & 1) write_laz_integer(c, &s->n, 8, &s->context[i], last[i], p[i]);
    }
}

typedef struct {
    write_laz_model *index, *how[4], *context[6];
    uint32_t how_last, step;
    write_laz_number offset, size, location, xyz;
} wave_state;

static void put_wave(write_laz_coder *c, wave_state *w, const uint8_t *last, const uint8_t *p)
{
    uint64_t move = prep_le64(p + 1) - prep_le64(last + 1);
    uint32_t how = move == 0                        ? 0
                   : move == prep_le32(last + 9)    ? 1
                   : (int64_t)move == (int32_t)move ? 2
                                                    : 3;
    write_laz_symbol(c, &w->index, 256, p[0]);
    write_laz_symbol(c, &w->how[w->how_last], 4, how);
    w->how_last = how;
    if (how == 2)
        write_laz_integer(c, &w->offset, 32, &w->context[0], w->step, (uint32_t)move),
            w->step = (uint32_t)move;
    if (how == 3) write_laz_bits_64(c, prep_le64(p + 1));
    write_laz_integer(c, &w->size, 32, &w->context[1], prep_le32(last + 9), prep_le32(p + 9));
    write_laz_integer(c, &w->location, 32, &w->context[2], prep_le32(last + 13), prep_le32(p + 13));
    for (uint32_t a = 0; a < 3; a++)
        write_laz_integer(c, &w->xyz, 32, &w->context[3 + a], prep_le32(last + 17 + 4 * a),
                          prep_le32(p + 17 + 4 * a));
}

/* Where the parts of a record are. */
typedef struct {
    uint32_t length, gps, rgb, nir, wave, extra, extra_size;
} parts;

static parts parts_of(uint8_t format, uint32_t length)
{
    static const uint8_t gps[11] = {0, 20, 0, 20, 20, 20, 22, 22, 22, 22, 22};
    static const uint8_t rgb[11] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
    static const uint8_t nir[11] = {0, 0, 0, 0, 0, 0, 0, 0, 36, 0, 36};
    static const uint8_t wave[11] = {0, 0, 0, 0, 28, 34, 0, 0, 0, 30, 38};
    uint16_t size = write_las_record_size(format);
    return (parts){length,       gps[format], rgb[format],  nir[format],
                   wave[format], size,        length - size};
}

static uint32_t even(uint32_t k, uint32_t most)
{
    return k < most ? k - k % 2 : most;
}

/* ---- point formats 0 to 5 ---- */

static const uint8_t map_8[8][8] = {
    {15, 14, 13, 12, 11, 10, 9, 8},  {14, 0, 1, 3, 6, 10, 10, 9},
    {13, 1, 2, 4, 7, 11, 11, 10},    {12, 3, 4, 5, 8, 12, 12, 11},
    {11, 6, 7, 8, 9, 13, 13, 12},    {10, 10, 11, 12, 13, 14, 14, 13},
    {9, 10, 11, 12, 13, 14, 15, 14}, {8, 9, 10, 11, 12, 13, 14, 15}};

typedef struct {
    int32_t dx[3], dy[3];
    uint32_t count;
    median mx[16], my[16];
    uint32_t height[8];
    uint16_t intensity[16];
    write_laz_model *changed, *bits[256], *class[256], *user[256], *angle[2];
    write_laz_number x, y, z, i, s, a;
    write_laz_model *cx[2], *cy[22], *cz[20], *ci[4], *cs, *ca[2];
    gps_state gps;
    rgb_state rgb;
    wave_state wave;
    write_laz_number extra;
    write_laz_model *extra_model[4096];
} rows_state;

static uint32_t changes(const uint8_t *last, const uint8_t *p, bool has_intensity,
                        bool intensity_first)
{
    uint32_t bits = (uint32_t)has_intensity << (intensity_first ? 5 : 4);
    bits |= (uint32_t)(p[14] != last[14]) << (intensity_first ? 4 : 5);
    bits |= (uint32_t)(p[15] != last[15]) << 3 | (uint32_t)(p[16] != last[16]) << 2 |
            (uint32_t)(p[17] != last[17]) << 1;
    return bits | (memcmp(p + 18, last + 18, 2) != 0);
}

static void put_point(write_laz_coder *c, rows_state *s, const uint8_t *last, const uint8_t *p)
{
    uint32_t r = p[14] & 7, n = p[14] >> 3 & 7, m = map_8[n][r], l = n > r ? n - r : r - n;
    uint16_t intensity = prep_le16(p + 12);
    uint32_t changed = changes(last, p, s->intensity[m] != intensity, false);
    write_laz_symbol(c, &s->changed, 64, changed);
    if (changed & 32) write_laz_symbol(c, &s->bits[last[14]], 256, p[14]);
    if (changed & 16)
        write_laz_integer(c, &s->i, 16, &s->ci[m < 3 ? m : 3], s->intensity[m], intensity);
    s->intensity[m] = intensity;
    if (changed & 8) write_laz_symbol(c, &s->class[last[15]], 256, p[15]);
    if (changed & 4)
        write_laz_symbol(c, &s->angle[p[14] >> 6 & 1], 256, (uint32_t)(p[16] - last[16]) & 255);
    if (changed & 2) write_laz_symbol(c, &s->user[last[17]], 256, p[17]);
    if (changed & 1)
        write_laz_integer(c, &s->s, 16, &s->cs, prep_le16(last + 18), prep_le16(p + 18));
    uint32_t dx = prep_le32(p) - prep_le32(last), dy = prep_le32(p + 4) - prep_le32(last + 4),
             z = prep_le32(p + 8);
    write_laz_integer(c, &s->x, 32, &s->cx[n == 1], (uint32_t)s->mx[m].v[2], dx);
    write_laz_integer(c, &s->y, 32, &s->cy[(n == 1) + even(s->x.k, 20)], (uint32_t)s->my[m].v[2],
                      dy);
    write_laz_integer(c, &s->z, 32, &s->cz[(n == 1) + even((s->x.k + s->y.k) / 2, 18)],
                      s->height[l], z);
    add_median(&s->mx[m], (int32_t)dx);
    add_median(&s->my[m], (int32_t)dy);
    s->height[l] = z;
}

static uint32_t middle(const int32_t v[3])
{
    for (int i = 0; i < 2; i++) {
        int32_t a = v[i], b = v[(i + 1) % 3], c = v[(i + 2) % 3];
        if ((a >= b && a <= c) || (a <= b && a >= c)) return (uint32_t)a;
    }
    return (uint32_t)v[2];
}

static void put_old_point(write_laz_coder *c, rows_state *s, const uint8_t *last, const uint8_t *p)
{
    uint32_t dx = prep_le32(p) - prep_le32(last), dy = prep_le32(p + 4) - prep_le32(last + 4);
    write_laz_integer(c, &s->x, 32, &s->cx[0], middle(s->dx), dx);
    write_laz_integer(c, &s->y, 32, &s->cy[s->x.k < 19 ? s->x.k : 19], middle(s->dy), dy);
    uint32_t k = (s->x.k + s->y.k) / 2;
    write_laz_integer(c, &s->z, 32, &s->cz[k < 19 ? k : 19], prep_le32(last + 8), prep_le32(p + 8));
    s->dx[s->count % 3] = (int32_t)dx;
    s->dy[s->count++ % 3] = (int32_t)dy;
    uint32_t changed = changes(last, p, memcmp(p + 12, last + 12, 2) != 0, true);
    write_laz_symbol(c, &s->changed, 64, changed);
    if (changed & 32)
        write_laz_integer(c, &s->i, 16, &s->ci[0], prep_le16(last + 12), prep_le16(p + 12));
    if (changed & 16) write_laz_symbol(c, &s->bits[last[14]], 256, p[14]);
    if (changed & 8) write_laz_symbol(c, &s->class[last[15]], 256, p[15]);
    if (changed & 4) write_laz_integer(c, &s->a, 8, &s->ca[k < 3], last[16], p[16]);
    if (changed & 2) write_laz_symbol(c, &s->user[last[17]], 256, p[17]);
    if (changed & 1)
        write_laz_integer(c, &s->s, 16, &s->cs, prep_le16(last + 18), prep_le16(p + 18));
}

static void put_rows(write_laz_bytes *out, const parts *f, const uint8_t *records, size_t count,
                     bool is_old)
{
    rows_state *s = calloc(1, sizeof *s);
    write_laz_coder c = {0};
    if (s == NULL) abort();
    write_laz_append(out, records, f->length);
    write_laz_begin(&c);
    if (f->gps) s->gps.time[0] = prep_le64(records + f->gps);
    for (size_t i = 1; i < count; i++) {
        const uint8_t *p = records + i * f->length, *last = p - f->length;
        (is_old ? put_old_point : put_point)(&c, s, last, p);
        if (f->gps && is_old) put_old_gps(&c, &s->gps, prep_le64(p + f->gps));
        if (f->gps && !is_old) put_gps(&c, &s->gps, prep_le64(p + f->gps), true);
        if (f->rgb) (is_old ? put_old_rgb : put_rgb)(&c, &s->rgb, last + f->rgb, p + f->rgb);
        if (f->wave) put_wave(&c, &s->wave, last + f->wave, p + f->wave);
        for (uint32_t k = 0; k < f->extra_size; k++) {
            uint8_t a = last[f->extra + k], b = p[f->extra + k];
            if (is_old) write_laz_integer(&c, &s->extra, 8, &s->extra_model[k], a, b);
            else write_laz_symbol(&c, &s->extra_model[k], 256, (uint32_t)(b - a) & 255);
        }
    }
    write_laz_end(&c);
    write_laz_append(out, c.out.p, c.out.size);
    free(c.out.p);
    free(s);
    write_laz_free_models();
}

/* ---- point formats 6 to 10 ---- */

static const char map_6[] = "0123453445555555"
                            "1013333333333333"
                            "2124444444433333"
                            "3345444444444444"
                            "4344544444444444"
                            "5344454444444444"
                            "3344445444444444"
                            "4344444544444444"
                            "4344444454444444"
                            "5344444445444444"
                            "5344444444544444"
                            "5334444444455444"
                            "5334444444455544"
                            "5334444444445554"
                            "5334444444444555"
                            "5334444444444455";

enum {
    XY,
    Z,
    CLASS,
    FLAGS,
    INTENSITY,
    ANGLE,
    USER,
    SOURCE,
    GPS,
    RGB,
    NIR,
    WAVE,
    EXTRA,
    LAYERS = EXTRA + 4096
};

typedef struct {
    bool is_used, item_is_used, had_new_time;
    uint8_t last[256], item_last[8192];
    median mx[12], my[12];
    uint32_t height[8];
    uint16_t intensity[8];
    write_laz_model *changed[8], *channel, *n[16], *r[16], *r_same, *cx[2], *cy[22], *cz[20],
        *class[64], *flags[64], *user[64];
    write_laz_model *ci[4], *ca[2], *cs;
    write_laz_number x, y, z, i, a, s;
    gps_state gps;
    rgb_state rgb;
    write_laz_model *nir_changed, *nir[2];
    wave_state wave;
    write_laz_model *extra[4096];
} channel_state;

typedef struct {
    const parts *f;
    bool is_4;
    uint32_t channel, item;
    channel_state ch[4];
    write_laz_coder c[LAYERS];
} layers_state;

static uint32_t flags_of(const uint8_t *p)
{
    return (p[15] & 15u) | (p[15] >> 2 & 0x30u);
}

static void use_channel(channel_state *s, const uint8_t *first)
{
    s->is_used = true;
    memcpy(s->last, first, 30);
    for (int i = 0; i < 8; i++) {
        s->height[i] = prep_le32(first + 8);
        s->intensity[i] = prep_le16(first + 12);
    }
    s->gps.time[0] = prep_le64(first + 22);
}

static void put_returns(write_laz_coder *c, channel_state *s, uint32_t last_n, uint32_t last_r,
                        uint32_t n, uint32_t r, uint32_t changed)
{
    if (changed & 4) write_laz_symbol(c, &s->n[last_n], 16, n);
    if ((changed & 3) != 3) return;
    if (changed & 16) write_laz_symbol(c, &s->r[last_r], 16, r);
    else write_laz_symbol(c, &s->r_same, 13, (r + 16 - last_r) % 16 - 2);
}

static void put_layers_point(layers_state *w, const uint8_t *p)
{
    write_laz_coder *c = w->c;
    channel_state *from = &w->ch[w->channel];
    uint32_t channel = p[15] >> 4 & 3, fr = from->last[14] & 15, fn = from->last[14] >> 4;
    uint32_t context = (fr == 1) | (uint32_t)(fr >= fn) << 1 | (uint32_t)from->had_new_time << 2;
    channel_state *s = &w->ch[channel];
    if (!s->is_used) use_channel(s, from->last);
    const uint8_t *last = s->last;
    uint32_t last_r = last[14] & 15, last_n = last[14] >> 4, r = p[14] & 15, n = p[14] >> 4,
             by = (r + 16 - last_r) % 16;
    bool new_time = memcmp(p + 22, last + 22, 8) != 0;
    uint32_t changed =
        (by == 0    ? 0
         : by == 1  ? 1
         : by == 15 ? 2
                    : 3) |
        (uint32_t)(n != last_n) << 2 | (uint32_t)(memcmp(p + 18, last + 18, 2) != 0) << 3 |
        (uint32_t)new_time << 4 | (uint32_t)(memcmp(p + 20, last + 20, 2) != 0) << 5 |
        (uint32_t)(channel != w->channel) << 6;
    write_laz_symbol(&c[XY], &from->changed[context], 128, changed);
    if (changed & 64)
        write_laz_symbol(&c[XY], &from->channel, 3, (channel + 4 - w->channel) % 4 - 1);
    put_returns(&c[XY], s, last_n, last_r, n, r, changed);

    uint32_t m = (uint32_t)(map_6[16 * n + r] - '0') << 1 | new_time, l = n > r ? n - r : r - n;
    uint32_t ends = (r == 1) | (uint32_t)(r >= n) << 1, dx = prep_le32(p) - prep_le32(last);
    uint32_t dy = prep_le32(p + 4) - prep_le32(last + 4), z = prep_le32(p + 8);
    if (l > 7) l = 7;
    write_laz_integer(&c[XY], &s->x, 32, &s->cx[n == 1], (uint32_t)s->mx[m].v[2], dx);
    write_laz_integer(&c[XY], &s->y, 32, &s->cy[(n == 1) + even(s->x.k, 20)],
                      (uint32_t)s->my[m].v[2], dy);
    add_median(&s->mx[m], (int32_t)dx);
    add_median(&s->my[m], (int32_t)dy);
    write_laz_integer(&c[Z], &s->z, 32, &s->cz[(n == 1) + even((s->x.k + s->y.k) / 2, 18)],
                      s->height[l], z);
    s->height[l] = z;
    write_laz_symbol(&c[CLASS], &s->class[(last[16] & 31) * 2 + (ends == 3)], 256, p[16]);
    write_laz_symbol(&c[FLAGS], &s->flags[flags_of(last)], 64, flags_of(p));
    write_laz_integer(&c[INTENSITY], &s->i, 16, &s->ci[ends], s->intensity[ends << 1 | new_time],
                      prep_le16(p + 12));
    s->intensity[ends << 1 | new_time] = prep_le16(p + 12);
    if (changed & 8)
        write_laz_integer(&c[ANGLE], &s->a, 16, &s->ca[new_time], prep_le16(last + 18),
                          prep_le16(p + 18));
    write_laz_symbol(&c[USER], &s->user[last[17] / 4], 256, p[17]);
    if (changed & 32)
        write_laz_integer(&c[SOURCE], &s->s, 16, &s->cs, prep_le16(last + 20), prep_le16(p + 20));
    if (new_time) put_gps(&c[GPS], &s->gps, prep_le64(p + 22), false);

    c[Z].is_needed |= z != prep_le32(last + 8);
    c[CLASS].is_needed |= p[16] != last[16];
    c[FLAGS].is_needed |= flags_of(p) != flags_of(last);
    c[INTENSITY].is_needed |= memcmp(p + 12, last + 12, 2) != 0;
    c[ANGLE].is_needed |= (changed & 8) != 0;
    c[USER].is_needed |= p[17] != last[17];
    c[SOURCE].is_needed |= (changed & 32) != 0;
    c[GPS].is_needed |= new_time;
    memcpy(s->last, p, 30);
    s->had_new_time = new_time;
    w->channel = channel;
}

static void put_layers_items(layers_state *w, const uint8_t *p, bool has_changed)
{
    const parts *f = w->f;
    write_laz_coder *c = w->c;
    uint32_t item = has_changed || w->is_4 ? w->channel : 0;
    uint8_t *last = w->ch[w->item].item_last;
    channel_state *s = &w->ch[item];
    if (item != w->item) {
        if (!s->item_is_used) memcpy(s->item_last, last, f->length);
        if (!s->item_is_used || w->is_4) last = s->item_last;
        s->item_is_used = true;
        w->item = item;
    }
    if (f->rgb) {
        put_rgb(&c[RGB], &s->rgb, last + f->rgb, p + f->rgb);
        c[RGB].is_needed |= memcmp(last + f->rgb, p + f->rgb, 6) != 0;
    }
    if (f->nir) {
        uint32_t low = last[f->nir] != p[f->nir], high = last[f->nir + 1] != p[f->nir + 1];
        write_laz_symbol(&c[NIR], &s->nir_changed, 4, low | high << 1);
        if (low)
            write_laz_symbol(&c[NIR], &s->nir[0], 256, (uint32_t)(p[f->nir] - last[f->nir]) & 255);
        if (high)
            write_laz_symbol(&c[NIR], &s->nir[1], 256,
                             (uint32_t)(p[f->nir + 1] - last[f->nir + 1]) & 255);
        c[NIR].is_needed |= low || high;
    }
    if (f->wave) {
        put_wave(&c[WAVE], &s->wave, last + f->wave, p + f->wave);
        c[WAVE].is_needed |= memcmp(last + f->wave, p + f->wave, 29) != 0;
    }
    for (uint32_t k = 0; k < f->extra_size; k++) {
        uint8_t a = last[f->extra + k], b = p[f->extra + k];
        write_laz_symbol(&c[EXTRA + k], &s->extra[k], 256, (uint32_t)(b - a) & 255);
        c[EXTRA + k].is_needed |= a != b;
    }
    memcpy(last + 30, p + 30, f->length - 30);
}

static bool has_layer(const parts *f, uint32_t k)
{
    if (k >= EXTRA) return k < EXTRA + f->extra_size;
    return (k != RGB || f->rgb) && (k != NIR || f->nir) && (k != WAVE || f->wave);
}

static void put_layers(write_laz_bytes *out, const parts *f, const uint8_t *records, size_t count,
                       bool is_4)
{
    layers_state *w = calloc(1, sizeof *w);
    if (w == NULL) abort();
    w->f = f;
    w->is_4 = is_4;
    w->channel = w->item = records[15] >> 4 & 3;
    use_channel(&w->ch[w->channel], records);
    w->ch[w->channel].item_is_used = true;
    memcpy(w->ch[w->channel].item_last, records, f->length);
    for (uint32_t k = 0; k < LAYERS; k++)
        write_laz_begin(&w->c[k]);
    for (size_t i = 1; i < count; i++) {
        uint32_t before = w->channel;
        put_layers_point(w, records + i * f->length);
        put_layers_items(w, records + i * f->length, w->channel != before);
    }
    write_laz_append(out, records, f->length);
    write_laz_append_u32(out, (uint32_t)count);
    w->c[XY].is_needed = true;
    for (uint32_t k = 0; k < LAYERS; k++) {
        if (w->c[k].is_needed) write_laz_end(&w->c[k]);
        if (has_layer(f, k))
            write_laz_append_u32(out, w->c[k].is_needed ? (uint32_t)w->c[k].out.size : 0);
    }
    for (uint32_t k = 0; k < LAYERS; k++) {
        if (w->c[k].is_needed && has_layer(f, k))
            write_laz_append(out, w->c[k].out.p, w->c[k].out.size);
        free(w->c[k].out.p);
    }
    free(w);
    write_laz_free_models();
}

/* ---- the file ---- */

typedef struct {
    uint32_t points, size;
} entry;

static void put_table(write_laz_bytes *out, const entry *entries, uint32_t count, bool varies)
{
    write_laz_coder c = {0};
    write_laz_number n = {0};
    write_laz_model *context[2] = {NULL};
    write_laz_append_u32(out, 0);
    write_laz_append_u32(out, count);
    write_laz_begin(&c);
    for (uint32_t i = 0; i < count; i++) {
        entry last = i > 0 ? entries[i - 1] : (entry){0, 0};
        if (varies) write_laz_integer(&c, &n, 32, &context[0], last.points, entries[i].points);
        write_laz_integer(&c, &n, 32, &context[1], last.size, entries[i].size);
    }
    write_laz_end(&c);
    write_laz_append(out, c.out.p, c.out.size);
    free(c.out.p);
    write_laz_free_models();
}

static size_t put_description(write_laz_bytes *out, const write_laz_options *o, const parts *f,
                              uint8_t format, uint32_t points)
{
    uint8_t p[54 + 34 + 5 * 6] = {0};
    uint8_t *q = p + 54, *item = q + 34;
    bool is_new = format >= 6;
    uint16_t types[5][2] = {{is_new ? 10 : 6, is_new ? 30 : 20}}, n = 1;
    if (f->gps && !is_new) types[n][0] = 7, types[n++][1] = 8;
    if (f->nir) types[n][0] = 12, types[n++][1] = 8;
    if (f->rgb && !f->nir) types[n][0] = is_new ? 11 : 8, types[n++][1] = 6;
    if (f->wave) types[n][0] = is_new ? 13 : 9, types[n++][1] = 29;
    if (f->extra_size) types[n][0] = is_new ? 14 : 0, types[n++][1] = (uint16_t)f->extra_size;
    memcpy(p + 2, "laszip encoded", 14);
    write_las_u16(p + 18, 22204);
    write_las_u16(p + 20, 34u + 6u * n);
    write_las_u16(q, o->compressor);
    q[4] = 3;
    write_las_u32(q + 12, o->varies ? 0xffffffffu : points);
    memset(q + 16, 255, 16);
    write_las_u16(q + 32, n);
    for (uint16_t i = 0; i < n; i++, item += 6) {
        write_las_u16(item, types[i][0]);
        write_las_u16(item + 2, types[i][1]);
        write_las_u16(item + 4, types[i][0] == 9 ? 1 : o->version);
    }
    write_laz_append(out, p, 54 + 34 + 6u * n);
    return 54 + 34 + 6u * n;
}

uint8_t *write_laz(const uint8_t *las, size_t las_size, const write_laz_options *options,
                   size_t *size)
{
    uint8_t format = las[104];
    write_laz_options o = *options;
    if (o.compressor == 0) o.compressor = format >= 6 ? 3 : 2;
    if (o.version == 0) o.version = format >= 6 ? 3 : 2;
    uint32_t length = prep_le16(las + 105), begin = prep_le32(las + 96);
    uint32_t count = prep_le32(las + 107);
    if (count == 0 && las[25] >= 4) count = (uint32_t)prep_le64(las + 247);
    if (count > (las_size - begin) / length) count = (uint32_t)((las_size - begin) / length);
    uint32_t each = o.chunk_points != 0 ? o.chunk_points : count > 0 ? count : 1;
    parts f = parts_of(format, length);
    write_laz_bytes out = {0};
    write_laz_append(&out, las, begin);
    write_las_u32(out.p + 96, begin + (uint32_t)put_description(&out, &o, &f, format, each));
    write_las_u32(out.p + 100, prep_le32(las + 100) + 1);
    out.p[104] |= 128;
    size_t pointer = out.size;
    uint8_t word[8];
    write_las_u64(word, o.table == WRITE_LAZ_TABLE_AT_END ? UINT64_MAX : pointer);
    if (o.compressor > 1) write_laz_append(&out, word, 8);

    entry *entries = calloc((size_t)count + 1, sizeof *entries);
    uint32_t chunks = 0;
    if (entries == NULL) abort();
    for (uint32_t first = 0; first < count; chunks++) {
        uint32_t n = o.compressor == 1 ? count : o.varies ? each * (chunks % 4 + 1) : each;
        if (n > count - first) n = count - first;
        size_t before = out.size;
        if (format < 6) put_rows(&out, &f, las + begin + (size_t)first * length, n, o.version == 1);
        else put_layers(&out, &f, las + begin + (size_t)first * length, n, o.version == 4);
        entries[chunks] = (entry){n, (uint32_t)(out.size - before)};
        first += n;
    }
    write_las_u64(word, out.size);
    if (o.compressor > 1 && o.table != WRITE_LAZ_NO_TABLE) {
        put_table(&out, entries, chunks, o.varies);
        if (o.table == WRITE_LAZ_TABLE) memcpy(out.p + pointer, word, 8);
        else write_laz_append(&out, word, 8);
    }
    free(entries);
    *size = out.size;
    return out.p;
}
