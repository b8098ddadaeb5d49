/* render/select.h - which points to draw in a frame, and which nodes to fetch for the next ones.
 *
 * Wimmer & Scheiblauer 2006, section 5.3: the outer octree is walked by a priority queue, largest
 * projected node first. For each node popped, in this order:
 *
 *   1. Is the budget spent? Then the traversal stops.
 *   2. Is it outside the view frustum, or of the clip box? Then it is skipped, with all below it.
 *   3. Is its lowest level too small? Then it is skipped, with all below it.
 *      Or hidden behind what is drawn (render/occlusion.h)? Then, too: the paper's future work.
 *   4. Is it resident? Then it is put on the draw list and its children on the queue. Else it is
 *      requested and skipped.
 *
 * The budget buys one cell size, in pixels, for the whole picture (render/sweep.h): the smallest at
 * which all prefixes together are within the budget, but no smaller than cell_px. A node's points
 * refine those of its parent, whose finest cells are twice as wide as its own, and so its prefix
 * grows from nothing to its finest level while cells shrink from the one to the other. The root
 * grows through its levels one by one; points that share a finest cell appear while cells shrink to
 * half of that. So density on screen is the same on both sides of a border between nodes, follows
 * the distance without steps, and the last point of the budget is spent as well as the first.
 *
 * Steps 1 to 3, as read here. Nodes are popped in the order in which they begin to show; the cell
 * size falls as they are, and the traversal stops where the budget is spent by what shows at that
 * size, which is the sum with every prefix as it is then: a node that was popped early has grown
 * since. "Too small" is a node whose first points would show below cell_px only. What is outside is
 * found to be so before it is queued, which saves the queue most nodes. The root is never too
 * small: it has no parent to stand for it.
 *
 * Projected sizes are taken at a node's nearest visible point (min(r) of section 4.5), but no
 * nearer than a quarter of half its width, so that a node does not take the whole budget by one
 * corner that touches the eye.
 *
 * What has to be fetched counts as drawn: when it arrives, the cell size stays as it is. It does
 * not show at once: in the first of a few pictures its cells are nearly as wide as its parent's
 * finest, from picture to picture they shrink to what the budget has bought, and splats with them.
 *
 * Splat sizes (end of section 5.3) follow the finest node drawn around a point, which need not be
 * the one that the point is stored in: the points of the root stand everywhere between those of its
 * descendants. The paper gives each node one size, that of its finest complete descendant; where
 * density varies, that is too small here and too large there. So the selection tells for each
 * octant of each node drawn what comes below it, and the vertex shader walks down to the size that
 * holds at its place. An octant whose child is not drawn, be it missing or beyond the budget, has
 * the cell size up to which the node itself has grown, so that a missing child leaves no gap. An
 * octant without a child has at least the cells of the first level that holds most of the node's
 * points, which is coarsely the sampling density.
 *
 * Pure: no GL, no file, no clock; no allocation once the workspace has grown to the size of the
 * frame. */
#pragma once
#include "mospt/linear.h"
#include "render/clip.h"
#include "render/occlusion.h"

typedef enum {
    REND_ABSENT = 0,
    REND_RESIDENT,
    REND_DAMAGED, /* cannot be read: draws nothing, is not asked for again, and does not hide what
                     is below it */
} rend_residency;

typedef struct {
    const mospt_hierarchy *hierarchy;
    const mospt_grid *grid;
    const rend_frame *frame;
    const rend_occlusion *occlusion; /* aimed at the frame; NULL: nothing is hidden */
    const uint8_t *residency; /* [hierarchy->count] rend_residency; NULL: everything is resident */
    const uint8_t *ages; /* [hierarchy->count] pictures that have been drawn since a node arrived;
                            REND_GROWN or more: it is grown; NULL: all are */
    uint64_t budget_points; /* 0: nothing; REND_ALL: no limit */
    float min_node_px;      /* nodes but the root that project to less are skipped; 0: none */
    float cell_px;          /* cells are no smaller than this; 0: REND_CELL_PX_DEFAULT */
    /* What is drawn and requested must fit the GPU cache together, or nodes would push each other
     * out for ever: nodes that do not are as if beyond the budget. Counted in pages, as the cache
     * does. */
    uint64_t page_limit; /* 0: no limit */
    uint32_t page_points;
    /* How wide the points of a picture are that this selection is drawn for, to find out what hides
     * others in it; both 0: as wide as cells. Where the dataset has points enough to close that
     * picture, splats stand for all of them, and are as wide as cells. Where it has not, one sees
     * between the points, and splats are no wider than those. The wider of both counts. */
    float own_px, own_cell; /* pixels; as the cell of a splat, steps */
    const rend_clip *clip;  /* nodes outside are skipped like those of step 2; NULL: none. Points
                               outside in nodes that are not count as drawn. */
} rend_select_input;

typedef struct {
    uint32_t node;
    uint32_t count;  /* leading points to draw */
    uint32_t parent; /* index of the parent in the draw list; REND_NO_DRAW for the root */
    float widest_px; /* widest cell of its octants where the node is nearest to the eye */
} rend_draw;

/* Where splats of 1.25 cells (render/order.h) are a pixel wide: nothing finer shows. */
#define REND_CELL_PX_DEFAULT 0.8f

enum { REND_NO_DRAW = 0xffffffff };

/* Pictures after which a node that has arrived is drawn like all others. */
enum { REND_GROWN = 4 };

/* An octant of a drawn node: the index of the child in the draw list, or, with this bit, the bits
 * of a float: minus the cell's width in steps. */
#define REND_SPLAT UINT32_C(0x80000000)

typedef struct {
    uint32_t node;
    float size_px; /* projected size: the larger, the more urgent */
} rend_request;

typedef struct {
    rend_draw *draws;  /* [draw_count], largest first; parents stand before their children */
    uint32_t *octants; /* [draw_count * 8], see REND_SPLAT */
    uint32_t draw_count;
    rend_request *requests; /* [request_count], most urgent first */
    uint32_t request_count;
    uint64_t points;                 /* sum of the counts of all draws */
    uint64_t points_in_view;         /* of all nodes that passed steps 1 to 3, all their points */
    uint32_t visited, culled, small; /* nodes looked at; skipped in step 2; in step 3 */
    uint32_t hidden;                 /* nodes skipped behind what is drawn */
    uint64_t points_hidden;          /* all points of those; not of what is below them */
    float cell_px;                   /* what the budget bought */
    bool stopped;                    /* in step 1: the budget is spent */
} rend_selection;

typedef struct rend_selector rend_selector; /* the workspace */

/* NULL without memory. */
rend_selector *rend_select_create(void);
void rend_select_destroy(rend_selector *selector);

/* Selects. The result belongs to the selector, and stays as it is until the next call.
 * errors   MOSPT_ENOMEM */
bool rend_select_run(rend_selector *selector, const rend_select_input *input,
                     const rend_selection **out, mospt_err *err);
