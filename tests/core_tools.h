/* tests/core_tools.h - what the tests of mospt/ and preprocess/ share: random numbers, scratch
 * folders, made-up points. */
#pragma once
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "mospt/check.h"
#include "mospt/writer.h"
#include "preprocess/solve.h"

/* Fails the test with the words of the error. */
#define CORE_NEED(call) core_need((call), #call, &err, __FILE__, __LINE__)
void core_need(bool ok, const char *call, const mospt_err *err, const char *file, int line);

/* Fails unless the call failed with this code and a sentence. */
#define CORE_FAILS(call, wanted) core_fails((call), #call, &err, (wanted), __FILE__, __LINE__)
void core_fails(bool ok, const char *call, const mospt_err *err, mospt_code wanted,
                const char *file, int line);

uint64_t core_random(uint64_t *state);
uint32_t core_below(uint64_t *state, uint32_t limit);
double core_unit(uint64_t *state); /* [0, 1) */

/* A folder of its own, in memory where the system has such a thing. The path is owned; remove frees
 * it. */
char *core_folder_make(void);
void core_folder_remove(char *path);

/* The folder of a test, or of all of a program, for cmocka's set-up and tear-down. */
extern char *core_folder;
int core_folder_set_up(void **state);
int core_folder_tear_down(void **state);
char *core_path(const char *folder, const char *format, ...) __attribute__((format(printf, 2, 3)));

void core_file_write(const char *path, const void *bytes, size_t size);
uint8_t *core_file_read(const char *path, size_t *size); /* owned, one zero byte beyond */
bool core_exists(const char *path);
uint32_t core_entries(const char *folder); /* files and folders in it */

/* Fails unless both folders hold files of the same names and bytes. */
void core_assert_same_folders(const char *a, const char *b);

/* Points made up in grid coordinates, as records of a schema "scan" u16 and "tag" u32. */
typedef enum {
    CORE_UNIFORM,
    CORE_CLUSTERED,
    CORE_PLANE,
    CORE_LINE,
    CORE_COPIES, /* few positions, many points each */
    CORE_ONE_POSITION,
    CORE_EQUAL_COLOUR, /* uniform */
    CORE_IDENTICAL,    /* all bytes alike */
    CORE_KINDS,
} core_kind;

typedef struct {
    mospt_grid grid;
    mospt_schema schema;
    size_t stride;
    uint32_t count;
    uint8_t *records; /* owned */
} core_site;

void core_site_make(core_kind kind, uint32_t bits, uint32_t count, uint64_t seed, core_site *out);
void core_site_fini(core_site *site);
/* Nodes with their payloads, one after the other. */
typedef struct {
    mospt_node *nodes; /* [node_count] */
    uint32_t node_count;
    uint8_t *payload;
    uint64_t point_count, points_hash;
} core_subtree;

/* The subtree of all points of a site, or one node of them. Released by core_subtree_fini(). */
core_subtree core_solve(const prep_shape *shape, const core_site *site);
core_subtree core_solve_node(const prep_shape *shape, const core_site *site);
void core_subtree_fini(core_subtree *subtree);

/* Gives all nodes of a subtree their places, and writes their payloads. */
void core_write(mospt_writer *writer, core_subtree *made);

prep_shape core_shape(const core_site *site, uint32_t inner_depth, uint32_t add_threshold);

/* Metadata that says the truth about a site, but for what the writer fills in. */
void core_metadata_make(const core_site *site, uint32_t add_threshold, mospt_metadata *out);

/* Writes the dataset that prep_solve() makes of the site. */
void core_dataset_make(const core_site *site, uint32_t inner_depth, uint32_t add_threshold,
                       const char *path);

/* Number of things that mospt_check() finds, an error of opening counted as one. `first` may be
 * NULL. */
uint64_t core_findings(const char *path, mospt_err *first);
