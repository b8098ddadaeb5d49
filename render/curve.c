#include "render/curve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 64 }; /* of the length of a segment */
#define NEAR 1e-4      /* as a step of the parameter, for slopes */
#define SAME_PLACE_M 1e-6
#define SAME_ANGLE_RAD 1e-7
#define LEVEL_SINE_MIN 0.035 /* two degrees between the view and the up direction */

typedef enum { RESTS, TURNS, MOVES } motion;

typedef struct {
    rend_key key;
    double orientation[4]; /* quaternion: x, y, z, w */
    /* Of the segment that begins here; the last keyframe has none. */
    motion motion;
    double chord;                /* square root of the distance: the centripetal parameter */
    double length;               /* metres where it moves, radians where it turns */
    double reached[SAMPLES + 1]; /* length at equal steps of the parameter */
    double pace[SAMPLES + 1];    /* there, length per parameter */
    double speed[2];             /* length per second at both ends */
} knot;

struct rend_curve {
    knot *knots; /* [count], owned */
    uint32_t count;
    bool level;
};

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double distance3(const double a[3], const double b[3])
{
    double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    return sqrt(dot3(d, d));
}

/* ---- orientations ---- */

static void quaternion_of(const rend_camera *camera, double q[4])
{
    double m[3][3]; /* m[axis of the eye][axis of the world] */
    rend_camera_axes(camera, m[0], m[1], m[2]);
    int i = 0;
    double trace = m[0][0] + m[1][1] + m[2][2];
    if (m[1][1] > m[i][i]) i = 1;
    if (m[2][2] > m[i][i]) i = 2;
    if (trace > m[i][i]) { /* w is the largest of the four: divide by that one */
        double s = 2 * sqrt(1 + trace);
        q[3] = s / 4;
        for (int a = 0; a < 3; a++) {
            int b = (a + 1) % 3, c = (a + 2) % 3;
            q[a] = (m[b][c] - m[c][b]) / s;
        }
        return;
    }
    int j = (i + 1) % 3, k = (i + 2) % 3;
    double s = 2 * sqrt(1 + m[i][i] - m[j][j] - m[k][k]);
    q[i] = s / 4;
    q[j] = (m[i][j] + m[j][i]) / s;
    q[k] = (m[i][k] + m[k][i]) / s;
    q[3] = (m[j][k] - m[k][j]) / s;
}

/* The world's direction of an axis of the eye. */
static void turn_axis(const double q[4], int axis, double out[3])
{
    double v[3] = {0, 0, 0}, t[3];
    v[axis] = 1;
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        t[a] = 2 * (q[b] * v[c] - q[c] * v[b]);
    }
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        out[a] = v[a] + q[3] * t[a] + q[b] * t[c] - q[c] * t[b];
    }
}

static double angle_between(const double a[4], const double b[4])
{
    double cosine = fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
    double d2 = 0;
    for (int i = 0; i < 4; i++)
        d2 += (a[i] - b[i]) * (a[i] - b[i]);
    /* The arc sine keeps its digits where the angle is small. */
    return cosine > 0.9 ? 4 * asin(fmin(sqrt(d2) / 2, 1)) : 2 * acos(fmin(cosine, 1));
}

/* ---- the pyramid ---- */

/* From a to b: `f` of the way, which may lie outside 0 to 1. `n` is 3 for places, 4 for unit
 * quaternions. */
static void blend(int n, const double *a, const double *b, double f, double *out)
{
    double wa = 1 - f, wb = f, length = 0;
    if (n == 4) {
        double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
        double sign = cosine < 0 ? -1 : 1, angle = acos(fmin(fabs(cosine), 1));
        if (angle > 1e-4) wa = sin(wa * angle) / sin(angle), wb = sin(wb * angle) / sin(angle);
        wb *= sign;
    }
    for (int i = 0; i < n; i++) {
        out[i] = wa * a[i] + wb * b[i];
        length += out[i] * out[i];
    }
    if (n == 4)
        for (int i = 0; i < n; i++)
            out[i] /= sqrt(length);
}

/* Through four points at four knots; x lies between the second and the third. */
static void pyramid(int n, const double *const p[4], const double k[4], double x, double *out)
{
    double a[3][4], b[2][4];
    for (int i = 0; i < 3; i++)
        blend(n, p[i], p[i + 1], (x - k[i]) / (k[i + 1] - k[i]), a[i]);
    for (int i = 0; i < 2; i++)
        blend(n, a[i], a[i + 1], (x - k[i]) / (k[i + 2] - k[i]), b[i]);
    blend(n, b[0], b[1], (x - k[1]) / (k[2] - k[1]), out);
}

/* True if segment i continues in the next or previous one, so that the curve takes it into account.
 * Elsewhere the camera stands still in between. */
static bool continues(const rend_curve *c, uint32_t i, uint32_t neighbour)
{
    return neighbour + 1 < c->count && c->knots[neighbour].motion == c->knots[i].motion;
}

/* The curve of segment i at x, 0 to 1 of its parameter. Beyond the ends it goes on as it was:
 * mirrored points stand for the missing ones. */
static void segment_at(const rend_curve *c, uint32_t i, bool orientation, double x, double *out)
{
    int n = orientation ? 4 : 3;
    const double *p[4];
    double k[4] = {0}, before[4], after[4], width[3];
    for (uint32_t j = 0; j < 4; j++) {
        uint32_t at = i + j >= 1 && i + j - 1 < c->count ? i + j - 1 : i;
        p[j] = orientation ? c->knots[at].orientation : c->knots[at].key.camera.eye;
    }
    const knot *s = c->knots;
    bool first = i == 0 || !continues(c, i, i - 1), last = !continues(c, i, i + 1);
    width[1] = orientation ? s[i].length : s[i].chord;
    width[0] = first ? width[1] : orientation ? s[i - 1].length : s[i - 1].chord;
    width[2] = last ? width[1] : orientation ? s[i + 1].length : s[i + 1].chord;
    if (first) blend(n, p[1], p[2], -1, before), p[0] = before;
    if (last) blend(n, p[2], p[1], -1, after), p[3] = after;
    for (int j = 0; j < 3; j++)
        k[j + 1] = k[j] + width[j];
    pyramid(n, p, k, k[1] + x * width[1], out);
}

/* ---- the way ---- */

/* Length per parameter of segment i at x. */
static double pace_at(const rend_curve *c, uint32_t i, double x)
{
    double low = fmax(x - NEAR, 0), high = fmin(x + NEAR, 1), from[3], to[3];
    segment_at(c, i, false, low, from);
    segment_at(c, i, false, high, to);
    return distance3(from, to) / (high - low);
}

/* Simpson's rule from sample to sample. */
static void measure_segment(rend_curve *c, uint32_t i)
{
    knot *k = &c->knots[i];
    for (uint32_t s = 0; s <= SAMPLES; s++) {
        k->pace[s] = pace_at(c, i, (double)s / SAMPLES);
        if (s == 0) continue;
        double middle = pace_at(c, i, (s - 0.5) / SAMPLES);
        k->reached[s] =
            k->reached[s - 1] + (k->pace[s - 1] + 4 * middle + k->pace[s]) / (6.0 * SAMPLES);
    }
    k->length = k->reached[SAMPLES];
}

/* Cubic with given values and slopes at 0 and `width`. */
static double hermite(double x, double width, const double value[2], const double slope[2])
{
    double f = x / width, f2 = f * f, f3 = f2 * f;
    return value[0] * (2 * f3 - 3 * f2 + 1) + value[1] * (3 * f2 - 2 * f3) +
           width * (slope[0] * (f3 - 2 * f2 + f) + slope[1] * (f3 - f2));
}

/* The parameter, 0 to 1, at which a share of a segment's length is reached: between samples a
 * cubic, so that the speed does not jump at them. */
static double parameter_at(const knot *k, double share)
{
    uint32_t low = 0, high = SAMPLES;
    double wanted = share * k->length, pace_min = 0.01 * k->length;
    while (high - low > 1) {
        uint32_t middle = (low + high) / 2;
        if (k->reached[middle] <= wanted) low = middle;
        else high = middle;
    }
    const double ends[2] = {(double)low / SAMPLES, (double)high / SAMPLES};
    const double slopes[2] = {1 / fmax(k->pace[low], pace_min), 1 / fmax(k->pace[high], pace_min)};
    double x = hermite(wanted - k->reached[low], k->reached[high] - k->reached[low], ends, slopes);
    return fmin(fmax(x, ends[0]), ends[1]);
}

/* Slope between two intervals that keeps a cubic monotone: the weighted harmonic mean. */
static double monotone_slope(double width0, double rise0, double width1, double rise1)
{
    double d0 = rise0 / width0, d1 = rise1 / width1;
    double w0 = 2 * width1 + width0, w1 = width1 + 2 * width0;
    return d0 * d1 > 0 ? (w0 + w1) / (w0 / d0 + w1 / d1) : 0;
}

static double seconds(const rend_curve *c, uint32_t i)
{
    return c->knots[i + 1].key.time_s - c->knots[i].key.time_s;
}

static void set_speeds(rend_curve *c, bool abrupt)
{
    for (uint32_t i = 0; i + 1 < c->count; i++) {
        knot *k = c->knots;
        double mean = k[i].length / seconds(c, i);
        for (uint32_t end = 0; end < 2; end++) {
            uint32_t other = end == 0 ? i - 1 : i + 1;
            bool outermost = end == 0 ? i == 0 : i + 2 == c->count;
            k[i].speed[end] = outermost && abrupt ? mean : 0;
            if (outermost || !continues(c, i, other)) continue;
            k[i].speed[end] =
                monotone_slope(seconds(c, i), k[i].length, seconds(c, other), k[other].length);
        }
    }
}

/* A monotone cubic of time through the values of four keyframes, from that before segment i on. */
static double cubic_at(const rend_curve *c, uint32_t i, double time_s, const double v[4])
{
    double width = seconds(c, i), slope[2] = {0, 0};
    if (i > 0) slope[0] = monotone_slope(seconds(c, i - 1), v[1] - v[0], width, v[2] - v[1]);
    if (i + 2 < c->count)
        slope[1] = monotone_slope(width, v[2] - v[1], seconds(c, i + 1), v[3] - v[2]);
    return hermite(time_s - c->knots[i].key.time_s, width, v + 1, slope);
}

/* Through one value of each keyframe, flat at both ends, and beside keyframes without one (NAN). */
static double value_at(const rend_curve *c, uint32_t i, double time_s, int which,
                       double of_key(const rend_key *, int which))
{
    double v[4];
    for (uint32_t j = 0; j < 4; j++) {
        uint32_t at = i + j >= 1 && i + j - 1 < c->count ? i + j - 1 : i;
        v[j] = of_key(&c->knots[at].key, which);
    }
    if (isnan(v[1]) || isnan(v[2])) return v[1];
    if (isnan(v[0])) v[0] = v[1];
    if (isnan(v[3])) v[3] = v[2];
    return cubic_at(c, i, time_s, v);
}

static double log_distance(const rend_key *key, int unused)
{
    (void)unused;
    return log(distance3(key->camera.eye, key->camera.target));
}

static double field_of_view(const rend_key *key, int unused)
{
    (void)unused;
    return key->camera.fov_rad;
}

static double log_budget(const rend_key *key, int unused)
{
    (void)unused;
    bool is_number = key->budget_points > 0 && key->budget_points < REND_ALL;
    return is_number ? log((double)key->budget_points) : NAN;
}

/* Sides 0 to 2 are the low ones. */
static double clip_side(const rend_key *key, int side)
{
    double at = side < 3 ? key->clip.low[side] : key->clip.high[side - 3];
    return key->has_clip && isfinite(at) ? at : NAN;
}

/* ---- making a curve ---- */

static void set_motions(rend_curve *c)
{
    for (uint32_t i = 0; i < c->count; i++) {
        knot *k = &c->knots[i];
        quaternion_of(&k->key.camera, k->orientation);
        if (i == 0) continue;
        knot *before = k - 1;
        double cosine = 0;
        for (int a = 0; a < 4; a++)
            cosine += before->orientation[a] * k->orientation[a];
        for (int a = 0; cosine < 0 && a < 4; a++)
            k->orientation[a] = -k->orientation[a];
        double metres = distance3(before->key.camera.eye, k->key.camera.eye);
        double angle = angle_between(before->orientation, k->orientation);
        before->motion = metres > SAME_PLACE_M ? MOVES : angle > SAME_ANGLE_RAD ? TURNS : RESTS;
        before->chord = sqrt(metres);
        before->length = before->motion == TURNS ? angle : 0;
    }
}

static bool is_level(const rend_curve *c)
{
    double first[3], up[3];
    for (uint32_t i = 0; i < c->count; i++) {
        const rend_camera *camera = &c->knots[i].key.camera;
        double length = sqrt(dot3(camera->up, camera->up)), direction[3], along = 0;
        for (int a = 0; a < 3; a++) {
            up[a] = camera->up[a] / length;
            direction[a] = camera->target[a] - camera->eye[a];
        }
        if (i == 0) memcpy(first, up, sizeof first);
        along = dot3(up, direction) / distance3(camera->eye, camera->target);
        if (distance3(first, up) > 1e-9 || 1 - along * along < LEVEL_SINE_MIN * LEVEL_SINE_MIN)
            return false;
    }
    return true;
}

bool rend_curve_create(const rend_path *path, rend_curve **out, mospt_err *err)
{
    rend_curve *c = calloc(1, sizeof *c);
    if (c != NULL) c->knots = calloc(path->count, sizeof *c->knots);
    if (c == NULL || c->knots == NULL) {
        rend_curve_destroy(c);
        return mospt_err_nomem(err, path->count * sizeof(knot));
    }
    c->count = path->count;
    for (uint32_t i = 0; i < path->count; i++)
        c->knots[i].key = path->keys[i];
    set_motions(c);
    for (uint32_t i = 0; i + 1 < c->count; i++)
        if (c->knots[i].motion == MOVES) measure_segment(c, i);
    set_speeds(c, path->abrupt);
    c->level = is_level(c);
    *out = c;
    return true;
}

void rend_curve_destroy(rend_curve *curve)
{
    if (curve == NULL) return;
    free(curve->knots);
    free(curve);
}

/* ---- at a time ---- */

/* The segment that a time is in; false before the first keyframe, from the last one on, and where
 * that is the only one. */
static bool find_segment(const rend_curve *c, double time_s, uint32_t *out)
{
    uint32_t low = 0, high = c->count - 1;
    if (c->count < 2 || !(time_s > c->knots[0].key.time_s) || !(time_s < c->knots[high].key.time_s))
        return false;
    while (high - low > 1) {
        uint32_t middle = (low + high) / 2;
        if (c->knots[middle].key.time_s <= time_s) low = middle;
        else high = middle;
    }
    *out = low;
    return true;
}

/* Length of a segment that is behind the eye. */
static double length_at(const rend_curve *c, uint32_t i, double time_s)
{
    const knot *k = &c->knots[i];
    const double ends[2] = {0, k->length};
    double length = hermite(time_s - k->key.time_s, seconds(c, i), ends, k->speed);
    return fmin(fmax(length, 0), k->length);
}

static void camera_at(const rend_curve *c, uint32_t i, double time_s, rend_camera *out)
{
    const knot *k = &c->knots[i];
    double q[4], back[3];
    *out = k->key.camera;
    memcpy(q, k->orientation, sizeof q);
    if (k->motion != RESTS) {
        double share = length_at(c, i, time_s) / k->length;
        segment_at(c, i, true, share, q);
        if (k->motion == MOVES) segment_at(c, i, false, parameter_at(k, share), out->eye);
    }
    double distance = exp(value_at(c, i, time_s, 0, log_distance));
    turn_axis(q, 2, back);
    for (int a = 0; a < 3; a++)
        out->target[a] = out->eye[a] - distance * back[a];
    if (!c->level) turn_axis(q, 1, out->up);
    out->fov_rad = value_at(c, i, time_s, 0, field_of_view);
}

static uint64_t budget_at(const rend_curve *c, uint32_t i, double time_s)
{
    uint64_t from = c->knots[i].key.budget_points, to = c->knots[i + 1].key.budget_points;
    double value = value_at(c, i, time_s, 0, log_budget);
    return from == to || isnan(value) || to == 0 || to == REND_ALL ? from : (uint64_t)exp(value);
}

/* What a side has no value for stays as it was at the keyframe before. */
static void clip_at(const rend_curve *c, uint32_t i, double time_s, rend_box *out)
{
    for (int side = 0; side < 6; side++) {
        double value = value_at(c, i, time_s, side, clip_side);
        double *to = side < 3 ? &out->low[side] : &out->high[side - 3];
        if (!isnan(value)) *to = value;
    }
}

void rend_curve_at(const rend_curve *curve, double time_s, rend_moment *out)
{
    uint32_t i, last = curve->count - 1;
    bool inside = find_segment(curve, time_s, &i);
    if (!inside) i = time_s >= curve->knots[last].key.time_s ? last : 0;
    const rend_key *key = &curve->knots[i].key;
    *out = (rend_moment){.camera = key->camera,
                         .budget_points = key->budget_points,
                         .has_clip = key->has_clip,
                         .clip = key->clip};
    for (uint32_t j = i + 1; j-- > 0 && out->colour == NULL;)
        if (curve->knots[j].key.colour[0] != '\0') out->colour = curve->knots[j].key.colour;
    if (!inside || time_s == key->time_s) return;
    camera_at(curve, i, time_s, &out->camera);
    out->budget_points = budget_at(curve, i, time_s);
    clip_at(curve, i, time_s, &out->clip);
}

double rend_curve_way(const rend_curve *curve, double time_s)
{
    double way = 0;
    for (uint32_t i = 0; i + 1 < curve->count; i++) {
        const knot *k = &curve->knots[i];
        if (k->motion != MOVES || time_s <= k->key.time_s) continue;
        bool behind = time_s >= curve->knots[i + 1].key.time_s;
        way += behind ? k->length : length_at(curve, i, time_s);
    }
    return way;
}
