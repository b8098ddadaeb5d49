#include "tests/e57_tools.h"

#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <cmocka.h>

static void every_bit_width_is_read(void **state)
{
    (void)state;
    static int64_t values[E57_COUNT];
    for (unsigned width = 0; width <= 64; width++) {
        uint64_t mask = width == 0 ? 0 : UINT64_MAX >> (64 - width), seed = width;
        int64_t low = width == 64 ? INT64_MIN : width % 2 == 0 ? -3 : 17;
        if (width >= 62) low = INT64_MIN; /* the range ends with int64_t */
        int64_t high = (int64_t)((uint64_t)low + mask);
        for (uint32_t i = 0; i < E57_COUNT; i++) {
            uint64_t random = (uint64_t)scan_points_random(&seed) << 40 ^
                              (uint64_t)scan_points_random(&seed) << 20 ^ scan_points_random(&seed);
            values[i] = (int64_t)((uint64_t)low + (random & mask));
        }
        e57_made m;
        e57_begin(&m);
        e57_add(&m, e57_whole("ext:value", values, low, high));
        m.scan.piece = 37;
        e57_loaded l;
        e57_load_made(&m, &l);
        e57_check_xyz(&l);
        int k = mospt_schema_find(&l.info.attributes, "value");
        assert_true(k >= 0);
        size_t size = l.batch.plane_size[k];
        assert_true(8 * size >= width && 8 * size < 2 * width + 16);
        for (uint32_t i = 0; i < E57_COUNT; i++)
            assert_memory_equal(l.batch.plane[k] + i * size, &values[i], size);
        e57_unload(&l);
    }
}

static void scaled_integers_are_scaled_in_double(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    static const double scale[3] = {0.001, 1e-6, 0.25}, offset[3] = {500000.125, 0, -7};
    for (int a = 0; a < 3; a++) {
        m.field[a].kind = WRITE_E57_SCALED;
        m.field[a].integers = e57_v.number[a];
        m.field[a].low = -1000;
        m.field[a].high = 70000;
        m.field[a].scale = scale[a];
        m.field[a].offset = offset[a];
    }
    e57_loaded l;
    e57_load_made(&m, &l);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        for (int a = 0; a < 3; a++) {
            volatile double product = (double)e57_v.number[a][i] * scale[a];
            double expected = product + offset[a];
            assert_memory_equal(&l.batch.xyz[3 * i + (uint32_t)a], &expected, sizeof expected);
        }
    }
    assert_true(l.info.step == 1e-6);
    assert_true(l.info.offset[0] == 500000.125 && l.info.offset[1] == 0 && l.info.offset[2] == -7);
    e57_unload(&l);

    m.scan.xml = "<pose type=\"Structure\"><translation type=\"Structure\"><x "
                 "type=\"Float\">10</x><y type=\"Float\"/>"
                 "<z type=\"Float\"/></translation></pose>";
    e57_load_made(&m, &l);
    assert_true(l.info.step == 1e-6 && l.info.offset[0] == 500010.125);
    e57_unload(&l);

    m.scan.xml = "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">1</w><x "
                 "type=\"Float\">1</x>"
                 "<y type=\"Float\"/><z type=\"Float\"/></rotation></pose>";
    e57_load_made(&m, &l);
    assert_true(l.info.step == 0);
    e57_unload(&l);
}

static void packets_may_be_cut_anywhere(void **state)
{
    (void)state;
    static const uint32_t pieces[] = {1, 2, 3, 7, 37, 1000, 5000};
    e57_made m;
    e57_begin(&m);
    e57_add_rgb(&m, 65535);
    e57_add(&m, e57_whole("cartesianInvalidState", e57_v.state3, 0, 2));
    e57_add(&m, (write_e57_field){.name = "ext:text", .kind = WRITE_E57_STRING});
    e57_add(&m, e57_real("timeStamp", WRITE_E57_DOUBLE, e57_v.unit));
    e57_loaded expected;
    e57_load_made(&m, &expected);
    for (int dealing = WRITE_E57_EVEN; dealing <= WRITE_E57_IN_TURN; dealing++) {
        for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; i++) {
            e57_loaded l;
            m.scan.piece = pieces[i];
            m.scan.dealing = (write_e57_dealing)dealing;
            m.scan.has_other_packets = i % 2 == 0;
            e57_load_made(&m, &l);
            assert_int_equal(l.batch.count, expected.batch.count);
            assert_memory_equal(l.batch.xyz, expected.batch.xyz, 24 * l.batch.count);
            assert_memory_equal(l.batch.rgbi, expected.batch.rgbi, 4 * l.batch.count);
            for (uint32_t k = 0; k < l.batch.plane_count; k++)
                assert_memory_equal(l.batch.plane[k], expected.batch.plane[k],
                                    l.batch.plane_size[k] * l.batch.count);
            e57_unload(&l);
        }
    }
    e57_unload(&expected);
}

static void the_batch_size_and_a_rewind_do_not_matter(void **state)
{
    (void)state;
    static const uint32_t sizes[] = {1, 7, 1023, 1024, 1025, 100000};
    e57_made m;
    e57_begin(&m);
    e57_add(&m, e57_whole("cartesianInvalidState", e57_v.state3, 0, 2));
    e57_loaded expected;
    e57_load_made(&m, &expected);
    char path[1024];
    snprintf(path, sizeof path, "%s/a.e57", scan_points_folder());
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        scan_points p;
        mospt_err err;
        assert_true(scan_points_read(path, NULL, sizes[i], &p, &err));
        assert_int_equal(p.count, expected.batch.count);
        assert_memory_equal(p.xyz, expected.batch.xyz, 24 * p.count);
        scan_points_fini(&p);
    }
    prep_scan *scan;
    prep_batch batch;
    assert_true(prep_scan_open(path, 0, NULL, &scan, NULL));
    assert_true(prep_batch_init(&batch, &prep_scan_describe(scan)->attributes, 1000, NULL));
    for (int round = 0; round < 3; round++) {
        assert_true(prep_scan_read(scan, &batch, NULL));
        assert_int_equal(batch.count, 1000);
        assert_memory_equal(batch.xyz, expected.batch.xyz, 24 * batch.count);
        assert_true(prep_scan_rewind(scan, NULL));
        assert_int_equal(prep_scan_dropped(scan)[PREP_DROP_NO_RETURN], 0);
    }
    prep_batch_fini(&batch);
    prep_scan_close(scan);
    e57_unload(&expected);
}

static const char quarter_turn[] = /* about z, not normalised, then moved */
    "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">3</w><x "
    "type=\"Float\"/>"
    "<y type=\"Float\"/><z type=\"Float\">3</z></rotation><translation type=\"Structure\"><x "
    "type=\"Float\">100</x>"
    "<y type=\"Float\">200</y><z type=\"Float\">-5</z></translation></pose>"
    "<cartesianBounds type=\"Structure\"><xMinimum type=\"Float\">-100</xMinimum><xMaximum "
    "type=\"Float\">120</xMaximum>"
    "<yMinimum type=\"Float\"/><yMaximum type=\"Float\">22</yMaximum><zMinimum type=\"Float\"/>"
    "<zMaximum type=\"ScaledInteger\" scale=\"0.5\" offset=\"1\">98</zMaximum></cartesianBounds>";

static void points_normals_and_bounds_are_moved_by_the_pose(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    e57_add(&m, e57_real("nor:normalX", WRITE_E57_FLOAT, e57_v.unit));
    e57_add(&m, e57_real("nor:normalY", WRITE_E57_FLOAT, e57_v.y));
    e57_add(&m, e57_real("nor:normalZ", WRITE_E57_FLOAT, e57_v.z));
    m.scan.xml = quarter_turn;
    e57_loaded l;
    e57_load_made(&m, &l);
    const float *normal = e57_plane(&l, "normal", MOSPT_F32, 3);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        assert_true(fabs(l.batch.xyz[3 * i] - (100 - e57_v.y[i])) < 1e-12);
        assert_true(fabs(l.batch.xyz[3 * i + 1] - (200 + e57_v.x[i])) < 1e-12);
        assert_true(fabs(l.batch.xyz[3 * i + 2] - (e57_v.z[i] - 5)) < 1e-12);
        assert_true(fabsf(normal[3 * i] + (float)e57_v.y[i]) < 1e-5f);
        assert_true(fabsf(normal[3 * i + 1] - (float)e57_v.unit[i]) < 1e-5f);
        assert_true(fabsf(normal[3 * i + 2] - (float)e57_v.z[i]) < 1e-5f);
    }
    static const double pose[16] = {0, -1, 0, 100, 1, 0, 0, 200, 0, 0, 1, -5, 0, 0, 0, 1};
    static const double low[3] = {78, 100, -5}, high[3] = {100, 320, 45};
    assert_true(l.info.has_pose);
    for (int i = 0; i < 16; i++)
        assert_true(fabs(l.info.pose[i] - pose[i]) < 1e-15);
    assert_true(l.info.has_bounds);
    for (int a = 0; a < 3; a++)
        assert_true(fabs(l.info.low[a] - low[a]) < 1e-9 && fabs(l.info.high[a] - high[a]) < 1e-9);
    e57_unload(&l);
}

static void a_rotation_of_no_length_is_none(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    m.scan.xml = "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\"/><x "
                 "type=\"Float\"/>"
                 "<y type=\"Float\"/><z type=\"Float\"/></rotation></pose>";
    e57_loaded l;
    e57_load_made(&m, &l);
    e57_check_xyz(&l);
    assert_false(l.info.has_pose);
    e57_unload(&l);
}

static void lying_bounds_are_not_believed(void **state)
{
    (void)state;
    static const char *const lies[] = {
        "<xMinimum type=\"Float\">50</xMinimum>",     "<xMinimum type=\"Float\">-1e30</xMinimum>",
        "<xMinimum type=\"Float\">-90000</xMinimum>", "<xMinimum type=\"Float\">500</xMinimum>",
        "<xMinimum type=\"Float\">nan</xMinimum>",    ""};
    for (size_t i = 0; i < sizeof lies / sizeof lies[0]; i++) {
        char xml[1024];
        snprintf(xml, sizeof xml,
                 "<cartesianBounds type=\"Structure\">%s<xMaximum "
                 "type=\"Float\">120</xMaximum><yMinimum type=\"Float\"/>"
                 "<yMaximum type=\"Float\">22</yMaximum><zMinimum type=\"Float\"/><zMaximum "
                 "type=\"Float\">50</zMaximum>"
                 "</cartesianBounds>",
                 lies[i]);
        e57_made m;
        e57_begin(&m);
        m.scan.xml = xml;
        e57_loaded l;
        e57_load_made(&m, &l);
        assert_false(l.info.has_bounds);
        e57_unload(&l);
    }
}

enum { MANY = 60000 };

/* What is known of a scan before it is read comes from all over it. Values decoded at a wrong bit
 * would lie outside the bounds, which would then not be believed. */
static void a_large_scan_is_sampled_all_over(void **state)
{
    (void)state;
    static int64_t steps[MANY], late[MANY];
    for (uint32_t i = 0; i < MANY; i++)
        steps[i] = 5000000 + i, late[i] = i < MANY / 2 ? 0 : i;
    e57_made m;
    e57_begin(&m);
    for (int a = 0; a < 3; a++)
        m.field[a] = (write_e57_field){.name = m.field[a].name,
                                       .kind = WRITE_E57_SCALED,
                                       .integers = steps,
                                       .high = a == 0 ? 8388607 : 100000000, /* 23 and 27 bits */
                                       .scale = 0.001};
    e57_add(&m, e57_whole("intensity", late, 0, 70000));
    m.scan.count = MANY;
    m.scan.xml = "<cartesianBounds type=\"Structure\"><xMinimum type=\"Float\">5000</xMinimum>"
                 "<xMaximum type=\"Float\">5060</xMaximum><yMinimum type=\"Float\">5000</yMinimum>"
                 "<yMaximum type=\"Float\">5060</yMaximum><zMinimum type=\"Float\">5000</zMinimum>"
                 "<zMaximum type=\"Float\">5060</zMaximum></cartesianBounds>";
    for (int dealing = WRITE_E57_EVEN; dealing <= WRITE_E57_IN_TURN; dealing++) {
        size_t size;
        mospt_err err;
        scan_points p;
        m.scan.dealing = (write_e57_dealing)dealing;
        uint8_t *bytes = write_e57(&(write_e57_file){.scans = &m.scan, .scan_count = 1}, &size);
        assert_true(scan_points_read(scan_points_file("a.e57", bytes, size), NULL, 5000, &p, &err));
        assert_int_equal(p.count, MANY);
        assert_true(p.info.has_bounds);
        assert_false(p.is_damaged);
        /* where the fields drift apart, only the beginning can be seen */
        assert_int_equal(p.info.has_intensity, dealing == WRITE_E57_BALANCED);
        for (uint32_t i = 0; i < MANY; i++)
            assert_true(p.xyz[3 * i + 1] == (double)steps[i] * 0.001);
        scan_points_fini(&p);
        free(bytes);
    }
}

static void spherical_coordinates_become_cartesian(void **state)
{
    (void)state;
    static double range[E57_COUNT], azimuth[E57_COUNT], elevation[E57_COUNT];
    e57_made m;
    e57_begin(&m);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        range[i] = 1 + i * 0.01;
        azimuth[i] = i * 0.002 - 3;
        elevation[i] = i * 0.001 - 1.5;
    }
    m.field[0] = e57_real("sphericalRange", WRITE_E57_DOUBLE, range);
    m.field[1] = e57_real("sphericalAzimuth", WRITE_E57_DOUBLE, azimuth);
    m.field[2] = e57_real("sphericalElevation", WRITE_E57_DOUBLE, elevation);
    e57_add(&m, e57_whole("sphericalInvalidState", e57_v.state3, 0, 2));
    m.scan.xml = "<sphericalBounds type=\"Structure\"><rangeMinimum type=\"Float\">1</rangeMinimum>"
                 "<rangeMaximum type=\"Float\">31</rangeMaximum></sphericalBounds>";
    e57_loaded l;
    e57_load_made(&m, &l);
    uint32_t k = 0;
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        if (e57_v.state3[i] != 0) continue;
        const double *p = l.batch.xyz + 3 * k++;
        assert_true(fabs(p[0] - range[i] * cos(elevation[i]) * cos(azimuth[i])) < 1e-12);
        assert_true(fabs(p[1] - range[i] * cos(elevation[i]) * sin(azimuth[i])) < 1e-12);
        assert_true(fabs(p[2] - range[i] * sin(elevation[i])) < 1e-12);
    }
    assert_int_equal(l.batch.count, k);
    assert_int_equal(l.dropped[PREP_DROP_NO_RETURN], E57_COUNT - k);
    assert_true(l.info.has_bounds && l.info.low[0] == -31 && l.info.high[2] == 31);
    assert_string_equal(l.info.format, "E57 1.0, spherical, double precision");
    assert_int_equal(l.info.attributes.count, 0);
    e57_unload(&l);
}

static void invalid_points_are_dropped_and_counted(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    e57_add(&m, e57_whole("cartesianInvalidState", e57_v.state3, 0, 2));
    e57_add(&m, e57_whole("rowIndex", e57_v.number[0], 0, 511));
    e57_loaded l;
    e57_load_made(&m, &l);
    const uint16_t *row = e57_plane(&l, "row_index", MOSPT_U16, 1);
    uint32_t k = 0;
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        if (e57_v.state3[i] != 0) continue;
        assert_true(l.batch.xyz[3 * k] == e57_v.x[i]);
        assert_int_equal(row[k], e57_v.number[0][i]);
        k++;
    }
    assert_int_equal(l.batch.count, k);
    assert_int_equal(l.dropped[PREP_DROP_NO_RETURN], E57_COUNT - k);
    assert_int_equal(l.info.point_count, E57_COUNT);
    assert_false(e57_has_plane(&l, "cartesianInvalidState"));
    e57_unload(&l);
}

static const char limits[] =
    "<colorLimits type=\"Structure\"><colorRedMinimum type=\"Integer\"/><colorRedMaximum "
    "type=\"Integer\">%s</colorRedMaximum>"
    "<colorGreenMinimum type=\"Integer\"/><colorGreenMaximum "
    "type=\"Integer\">%s</colorGreenMaximum>"
    "<colorBlueMinimum type=\"Integer\"/><colorBlueMaximum "
    "type=\"Integer\">%s</colorBlueMaximum></colorLimits>";

static void load_colours(int64_t high, int64_t factor, const char *limit, e57_loaded *l)
{
    static int64_t wide[3][E57_COUNT];
    char xml[1024];
    e57_made m;
    e57_begin(&m);
    e57_add_rgb(&m, high);
    for (int c = 0; c < 3; c++) {
        for (uint32_t i = 0; i < E57_COUNT; i++)
            wide[c][i] = e57_v.number[c][i] * factor;
        m.field[3 + c].integers = wide[c];
    }
    if (limit != NULL) {
        snprintf(xml, sizeof xml, limits, limit, limit, limit);
        m.scan.xml = xml;
    }
    e57_load_made(&m, l);
    assert_true(l->info.has_rgb);
}

static void check_colours(const e57_loaded *l)
{
    for (uint32_t i = 0; i < l->batch.count; i++)
        for (uint32_t c = 0; c < 3; c++)
            assert_int_equal(l->batch.rgbi[4 * i + c], e57_v.number[c][i]);
}

static void colours_of_any_depth_are_shown(void **state)
{
    (void)state;
    static const struct {
        int64_t high, factor;
        const char *limit;
        bool has_raw;
    } cases[] = {{255, 1, "255", false},      {255, 1, NULL, false},    {255, 1, "244", false},
                 {65535, 257, "65535", true}, {65535, 257, NULL, true}, {65535, 257, "60000", true},
                 {65535, 1, "65535", true}, /* bytes in 16 bits */
                 {4095, 16, "4080", true},    {65535, 257, "255", true} /* a limit that lies */};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        e57_loaded l;
        load_colours(cases[i].high, cases[i].factor, cases[i].limit, &l);
        check_colours(&l);
        assert_int_equal(e57_has_plane(&l, "rgb"), cases[i].has_raw);
        if (cases[i].has_raw) {
            const uint16_t *raw = e57_plane(&l, "rgb", MOSPT_U16, 3);
            for (uint32_t k = 0; k < E57_COUNT; k++)
                assert_int_equal(raw[3 * k + 1], e57_v.number[1][k] * cases[i].factor);
        }
        e57_unload(&l);
    }
}

static void floating_colours_are_shown_and_kept(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    e57_add(&m, e57_real("colorRed", WRITE_E57_FLOAT, e57_v.unit));
    e57_add(&m, e57_real("colorGreen", WRITE_E57_FLOAT, e57_v.unit));
    e57_add(&m, e57_real("colorBlue", WRITE_E57_FLOAT, e57_v.unit));
    e57_loaded l;
    e57_load_made(&m, &l);
    const float *raw = e57_plane(&l, "rgb_float", MOSPT_F32, 3);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        assert_int_equal(l.batch.rgbi[4 * i], (int)(e57_v.unit[i] * 255 + 0.5));
        assert_true(raw[3 * i + 2] == (float)e57_v.unit[i]);
    }
    e57_unload(&l);
}

static void invalid_colours_and_intensities_are_not_shown(void **state)
{
    (void)state;
    static int64_t other[E57_COUNT];
    for (uint32_t i = 0; i < E57_COUNT; i++)
        other[i] = i % 3 == 0;
    e57_made m;
    e57_begin(&m);
    e57_add_rgb(&m, 255);
    e57_add(&m, e57_whole("isColorInvalid", e57_v.flag, 0, 1));
    e57_add(&m, e57_whole("intensity", e57_v.number[0], 0, 255));
    e57_add(&m, e57_whole("isIntensityInvalid", other, 0, 1));
    e57_loaded l;
    e57_load_made(&m, &l);
    const uint8_t *color_invalid = e57_plane(&l, "color_invalid", MOSPT_U8, 1);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        const uint8_t *p = l.batch.rgbi + 4 * i;
        int shown =
            other[i] ? 255 : p[3]; /* intensity is stretched, by no more than its range wants */
        assert_in_range(p[3] + 8, other[i] ? 263 : (int)e57_v.number[0][i],
                        other[i] ? 263 : (int)e57_v.number[0][i] + 16);
        assert_int_equal(p[1], e57_v.flag[i] ? shown : (int)e57_v.number[1][i]);
        assert_int_equal(color_invalid[i], e57_v.flag[i]);
    }
    e57_unload(&l);
}

static void intensity_is_stretched_and_kept(void **state)
{
    (void)state;
    static int64_t counts[E57_COUNT];
    e57_made m;
    e57_begin(&m);
    for (uint32_t i = 0; i < E57_COUNT; i++)
        counts[i] = (int64_t)i - 1000;
    e57_add(&m, e57_whole("intensity", counts, -2048, 2047));
    e57_loaded l;
    e57_load_made(&m, &l);
    const int16_t *raw = e57_plane(&l, "intensity", MOSPT_I16, 1);
    assert_true(l.info.has_intensity && !l.info.has_rgb);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        assert_int_equal(raw[i], counts[i]);
        assert_int_equal(l.batch.rgbi[4 * i], l.batch.rgbi[4 * i + 3]);
    }
    assert_true(l.batch.rgbi[3] == 0 && l.batch.rgbi[4 * E57_COUNT - 1] == 255);
    e57_unload(&l);

    m.field[3].kind = WRITE_E57_SCALED; /* as one vendor does it: 0..1 in 15 bits */
    m.field[3].low = 0;
    m.field[3].high = 32767;
    m.field[3].scale = 1 / 32767.0;
    m.field[3].integers = e57_v.number[0];
    e57_load_made(&m, &l);
    const float *scaled = e57_plane(&l, "intensity", MOSPT_F32, 1);
    for (uint32_t i = 0; i < E57_COUNT; i++)
        assert_true(scaled[i] == (float)((double)e57_v.number[0][i] * (1 / 32767.0)));
    e57_unload(&l);
}

static void fields_get_the_names_of_the_field(void **state)
{
    (void)state;
    static int64_t returns[E57_COUNT], of[E57_COUNT];
    for (uint32_t i = 0; i < E57_COUNT; i++)
        of[i] = 1 + i % 3, returns[i] = (int64_t)i % of[i];
    e57_made m;
    e57_begin(&m);
    e57_add(&m, e57_whole("rowIndex", e57_v.number[0], 0, 255));
    e57_add(&m, (write_e57_field){.name = "ext:label", .kind = WRITE_E57_STRING});
    e57_add(&m, e57_whole("columnIndex", e57_v.number[1], 0, 100000));
    e57_add(&m, e57_whole("returnIndex", returns, 0, 3));
    e57_add(&m, e57_whole("returnCount", of, 0, 3));
    e57_add(&m, e57_real("timeStamp", WRITE_E57_DOUBLE, e57_v.unit));
    e57_add(&m, e57_whole("isTimeStampInvalid", e57_v.flag, 0, 1));
    e57_add(&m, e57_real("demo:amplitude", WRITE_E57_FLOAT, e57_v.y));
    e57_loaded l;
    e57_load_made(&m, &l);
    assert_int_equal(l.info.attributes.count, 7);
    const uint8_t *row = e57_plane(&l, "row_index", MOSPT_U8, 1),
                  *nth = e57_plane(&l, "return_number", MOSPT_U8, 1),
                  *total = e57_plane(&l, "number_of_returns", MOSPT_U8, 1);
    const uint32_t *column = e57_plane(&l, "column_index", MOSPT_U32, 1);
    const double *time = e57_plane(&l, "gps_time", MOSPT_F64, 1);
    const float *amplitude = e57_plane(&l, "amplitude", MOSPT_F32, 1);
    e57_plane(&l, "time_invalid", MOSPT_U8, 1);
    for (uint32_t i = 0; i < E57_COUNT; i++) {
        assert_true(row[i] == e57_v.number[0][i] && column[i] == e57_v.number[1][i]);
        assert_true(nth[i] == returns[i] + 1 && total[i] == of[i]); /* counted from 1, as in LAS */
        assert_true(time[i] == e57_v.unit[i] && amplitude[i] == (float)e57_v.y[i]);
    }
    e57_unload(&l);

    for (uint32_t i = 0; i < E57_COUNT; i++)
        returns[i]++; /* a writer who counts from 1 already */
    e57_load_made(&m, &l);
    nth = e57_plane(&l, "return_number", MOSPT_U8, 1);
    for (uint32_t i = 0; i < E57_COUNT; i++)
        assert_int_equal(nth[i], returns[i]);
    e57_unload(&l);
}

static void scans_are_counted_without_the_empty_and_the_broken(void **state)
{
    (void)state;
    e57_made m[5];
    for (int i = 0; i < 5; i++)
        e57_begin(&m[i]);
    write_e57_scan scans[5];
    for (int i = 0; i < 5; i++)
        scans[i] = m[i].scan;
    scans[0].count = 0;
    scans[1].lacks_prototype = true;
    scans[1].name = "broken";
    scans[2].name = "first";
    scans[2].count = 10;
    scans[3].name = NULL;
    scans[3].guid = "{the guid}";
    scans[3].count = 20;
    scans[4].name = scans[4].guid = NULL;
    scans[4].count = 30;
    const write_e57_file file = {.scans = scans, .scan_count = 5, .crs = "PROJCS[\"somewhere\"]"};
    static const char *const names[3] = {"first", "{the guid}", "scan 3"};
    for (uint32_t i = 0; i < 3; i++) {
        e57_loaded l;
        e57_load_file(&file, i, &l);
        assert_int_equal(l.info.scan_count, 3);
        assert_int_equal(l.batch.count, 10 * (i + 1));
        assert_string_equal(l.info.name, names[i]);
        assert_string_equal(l.crs, "PROJCS[\"somewhere\"]");
        assert_int_equal(l.damage.code, i == 0 ? MOSPT_EFORMAT : MOSPT_OK); /* told once */
        if (i == 0) assert_non_null(strstr(l.damage.message, "scan 2 (broken)"));
        e57_unload(&l);
    }
    e57_loaded l;
    mospt_err err = {0};
    char path[1024];
    snprintf(path, sizeof path, "%s/a.e57", scan_points_folder());
    assert_false(e57_load_scan(path, 3, NULL, 100, &l, &err));
    assert_int_equal(err.code, MOSPT_EINVAL);
    assert_int_equal(e57_refuse_file(&(write_e57_file){.scans = scans, .scan_count = 1}).code,
                     MOSPT_EEMPTY);
    assert_int_equal(e57_refuse_file(&(write_e57_file){0}).code, MOSPT_EEMPTY);
    err = e57_refuse_file(&(write_e57_file){.scans = scans, .scan_count = 2});
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_non_null(strstr(err.message, "prototype"));
}

/* That the XML is not read again shows in a file that has lost it since, and whose size and times
 * are what they were. */
static void a_memory_spares_the_xml_for_the_next_scan(void **state)
{
    (void)state;
    e57_made m[3];
    write_e57_scan scans[3];
    char names[3][20];
    for (int i = 0; i < 3; i++) {
        e57_begin(&m[i]);
        for (int k = 0; k < 2 * i; k++)
            e57_add_rgb(&m[i], 255);
        scans[i] = m[i].scan;
        scans[i].count = (uint32_t)(10 * (i + 1));
        snprintf(names[i], sizeof names[i], "station %d", i);
        scans[i].name = names[i];
    }
    scans[1].lacks_prototype = true;
    size_t size;
    uint8_t *bytes =
        write_e57(&(write_e57_file){.scans = scans, .scan_count = 3, .crs = "EPSG:25832"}, &size);
    const struct timespec old[2] = {{.tv_sec = 1000}, {.tv_sec = 1000}};
    prep_scan_memory *memory;
    assert_true(prep_scan_memory_create(&memory, NULL));
    for (uint32_t i = 0; i < 2; i++) {
        const char *path = scan_points_file("a.e57", bytes, size);
        assert_int_equal(utimensat(AT_FDCWD, path, old, 0), 0);
        e57_loaded l;
        mospt_err err = {0};
        if (!e57_load_scan(path, i, memory, E57_COUNT, &l, &err)) fail_msg("%s", err.message);
        assert_int_equal(l.info.scan_count, 2);
        assert_int_equal(l.batch.count, i == 0 ? 10 : 30);
        assert_string_equal(l.info.name, names[2 * i]);
        assert_string_equal(l.crs, "EPSG:25832");
        assert_int_equal(l.damage.code, i == 0 ? MOSPT_EFORMAT : MOSPT_OK);
        e57_unload(&l);
        memset(bytes + size - 300, 'x', 300);
    }
    e57_refuse_bytes(bytes, size);
    prep_scan_memory_destroy(memory);
    free(bytes);
}

static void coordinates_are_needed(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    m.field[2].name = "depth";
    mospt_err err = e57_refuse_file(&(write_e57_file){.scans = &m.scan, .scan_count = 1});
    assert_int_equal(err.code, MOSPT_EFORMAT);
    assert_non_null(strstr(err.message, "coordinates"));
}

/* The real files, where they are at hand. */

typedef struct {
    uint64_t count;
    uint32_t scans;
    double low[3], high[3], sum[3];
} totals;

static bool measure(const char *path, totals *t, mospt_err *err)
{
    *t = (totals){.scans = 1};
    for (int a = 0; a < 3; a++)
        t->low[a] = INFINITY, t->high[a] = -INFINITY;
    for (uint32_t i = 0; i < t->scans; i++) {
        e57_loaded l;
        if (!e57_load_scan(path, i, NULL, 200000, &l, err)) return false;
        t->scans = l.info.scan_count;
        t->count += l.batch.count;
        for (size_t k = 0; k < 3 * (size_t)l.batch.count; k++) {
            t->low[k % 3] = fmin(t->low[k % 3], l.batch.xyz[k]);
            t->high[k % 3] = fmax(t->high[k % 3], l.batch.xyz[k]);
            t->sum[k % 3] += l.batch.xyz[k];
        }
        e57_unload(&l);
    }
    return true;
}

static int check_file(const char *folder, char *const *f)
{
    char path[2048];
    totals t;
    mospt_err err = {0};
    snprintf(path, sizeof path, "%s/%s", folder, f[1]);
    bool ok = measure(path, &t, &err), is_load = strncmp(f[4], "load", 4) == 0;
    if (!ok && !is_load && (err.code == MOSPT_EFORMAT || err.code == MOSPT_EEMPTY)) {
        bool is_right = strncmp(f[4], "refuse", 6) != 0 || err.code == MOSPT_EFORMAT;
        return is_right && (strncmp(f[4], "accept", 6) != 0 || err.code == MOSPT_EEMPTY) ? 0 : 1;
    }
    if (strncmp(f[4], "partial", 7) == 0) return 0;
    bool is_right =
        ok && is_load && t.count == strtoull(f[8], NULL, 10) && t.scans == strtoul(f[9], NULL, 10);
    for (int a = 0; a < 3 && is_right; a++)
        is_right = fabs(t.low[a] - strtod(f[10 + a], NULL)) < 1e-6 &&
                   fabs(t.high[a] - strtod(f[13 + a], NULL)) < 1e-6 &&
                   fabs(t.sum[a] / (double)t.count - strtod(f[16 + a], NULL)) < 1e-6;
    if (!is_right) printf("%s: %s\n", f[1], ok ? "other points than the manifest's" : err.message);
    return is_right ? 0 : 1;
}

static void real_files_hold_what_their_manifest_says(void **state)
{
    (void)state;
    char path[1024], line[16384];
    int files = 0, failures = 0;
    snprintf(path, sizeof path, "%s/MANIFEST.tsv", IPTS_SCANS);
    FILE *manifest = fopen(path, "r");
    if (manifest == NULL) {
        printf("no real scans in %s\n", IPTS_SCANS);
        skip();
    }
    while (fgets(line, sizeof line, manifest) != NULL) {
        char *field[24] = {0}, *rest = line;
        for (int i = 0; i < 24; i++)
            field[i] = rest != NULL ? strsep(&rest, "\t\n") : line;
        const char *dot = strrchr(field[1], '.');
        if (dot == NULL || strcmp(dot, ".e57") != 0) continue;
        files++;
        failures += check_file(IPTS_SCANS, field);
    }
    fclose(manifest);
    printf("%d real files\n", files);
    assert_true(files > 20);
    assert_int_equal(failures, 0);
}

static void pictures_are_counted(void **state)
{
    (void)state;
    e57_made m;
    e57_begin(&m);
    e57_loaded l;
    e57_load_file(&(write_e57_file){.scans = &m.scan,
                                    .scan_count = 1,
                                    .xml = "<images2D type=\"Vector\"><vectorChild type="
                                           "\"Structure\"/><vectorChild type=\"Structure\">"
                                           "<name type=\"String\">b</name></vectorChild>"
                                           "</images2D>"},
                  0, &l);
    e57_check_xyz(&l);
    assert_int_equal(l.damage.code, MOSPT_OK);
    assert_int_equal(l.info.image_count, 2);
    e57_unload(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_bit_width_is_read),
        cmocka_unit_test(scaled_integers_are_scaled_in_double),
        cmocka_unit_test(packets_may_be_cut_anywhere),
        cmocka_unit_test(the_batch_size_and_a_rewind_do_not_matter),
        cmocka_unit_test(points_normals_and_bounds_are_moved_by_the_pose),
        cmocka_unit_test(a_rotation_of_no_length_is_none),
        cmocka_unit_test(lying_bounds_are_not_believed),
        cmocka_unit_test(a_large_scan_is_sampled_all_over),
        cmocka_unit_test(spherical_coordinates_become_cartesian),
        cmocka_unit_test(invalid_points_are_dropped_and_counted),
        cmocka_unit_test(colours_of_any_depth_are_shown),
        cmocka_unit_test(floating_colours_are_shown_and_kept),
        cmocka_unit_test(invalid_colours_and_intensities_are_not_shown),
        cmocka_unit_test(intensity_is_stretched_and_kept),
        cmocka_unit_test(fields_get_the_names_of_the_field),
        cmocka_unit_test(scans_are_counted_without_the_empty_and_the_broken),
        cmocka_unit_test(a_memory_spares_the_xml_for_the_next_scan),
        cmocka_unit_test(coordinates_are_needed),
        cmocka_unit_test(pictures_are_counted),
        cmocka_unit_test(real_files_hold_what_their_manifest_says),
    };
    e57_tools_init();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
