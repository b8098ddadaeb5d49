#include "render/watch.h"
#include "tests/render_tools.h"

#include <stdlib.h>
#include <unistd.h>

static void a_commit_is_noticed_once(void **unused)
{
    (void)unused;
    render_site site;
    rend_watch watch;
    mospt_err err = {0};
    mospt_dataset *again = NULL;
    render_site_make(CORE_CLUSTERED, 2000, NULL, &site);
    CORE_NEED(rend_watch_init(&watch, site.path, &err));
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_CHANGED); /* since nobody looked */
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_SAME);
    CORE_NEED(mospt_dataset_open(site.path, &again, &err));
    assert_true(rend_watch_is_same(site.dataset, again));
    mospt_dataset_close(again);
    site.dataset->metadata.generation++;
    CORE_NEED(mospt_metadata_write(&site.dataset->metadata, site.path, &err));
    site.dataset->metadata.generation--;
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_CHANGED);
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_SAME);
    CORE_NEED(mospt_dataset_open(site.path, &again, &err));
    assert_false(rend_watch_is_same(site.dataset, again));
    mospt_dataset_close(again);
    rend_watch_fini(&watch);
    render_site_fini(&site);
}

static void that_it_is_gone_is_said_once_and_that_it_is_back_too(void **unused)
{
    (void)unused;
    render_site site;
    rend_watch watch;
    mospt_err err = {0};
    render_site_make(CORE_CLUSTERED, 2000, NULL, &site);
    char *file = core_path(site.path, "metadata.json");
    CORE_NEED(rend_watch_init(&watch, site.path, &err));
    rend_watch_look(&watch);
    assert_int_equal(unlink(file), 0);
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_GONE);
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_SAME);
    CORE_NEED(mospt_metadata_write(&site.dataset->metadata, site.path, &err));
    assert_int_equal(rend_watch_look(&watch), REND_WATCH_CHANGED);
    rend_watch_fini(&watch);
    free(file);
    render_site_fini(&site);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_commit_is_noticed_once),
        cmocka_unit_test(that_it_is_gone_is_said_once_and_that_it_is_back_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
