/* mospt/survey.h - figures about a dataset: those of its tree, and those that take reading every
 * point. */
#pragma once
#include "mospt/dataset.h"

/* What the hierarchy alone tells. */
typedef struct {
    uint32_t nodes, leaves;
    uint32_t levels;                                /* of the outer octree */
    uint32_t points_min, points_median, points_max; /* of a MOSPT */
    double points_mean;
    double branching;      /* children of a node of the outer octree that has any */
    double cell_branching; /* occupied children of an occupied cell inside a MOSPT */
    uint32_t added;        /* nodes in which an octant adds */
} mospt_tree_figures;

bool mospt_survey_tree(const mospt_dataset *dataset, mospt_tree_figures *out, mospt_err *err);

typedef struct {
    double low[3], high[3], mean[3]; /* metres */
    bool has_rgb;                    /* some source has colour */
    double mean_rgb[3];              /* 0 to 255, of the points of those sources */
    /* [schema.count][component], the first three components */
    double attribute_min[MOSPT_ATTRIBUTES_MAX][3];
    double attribute_max[MOSPT_ATTRIBUTES_MAX][3];
    double attribute_mean[MOSPT_ATTRIBUTES_MAX][3];
} mospt_point_figures;

/* Memory of a classic sequential point tree of the same points (Wimmer & Scheiblauer 2006,
 * section 4.3) in the octree that the dataset has: it stores an additional point for each interior
 * node, and r_min and r_max with every point. */
typedef struct {
    uint64_t points;
    uint64_t interior; /* cells with at least two points below them, down to the finest ones */
    uint64_t classic_bytes, mospt_bytes;
    double branching; /* alpha of interior / points = 1 / (alpha - 1) */
} mospt_spt_figures;

enum { MOSPT_SPT_POINT_SIZE = 24 }; /* position, colour, r_min, r_max */

/* Reads every point, node after node.
 * points   out, may be NULL: then no attributes are read
 * spt      out, may be NULL */
bool mospt_survey_points(const mospt_dataset *dataset, mospt_point_figures *points,
                         mospt_spt_figures *spt, mospt_err *err);
