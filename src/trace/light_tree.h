/// A tree over the triangles of one emissive source: which of them to sample for a place, with exact probabilities; and tables of it for many samples
/// from places close together.
///
/// Based on: [ContyKulla2018] Conty Estevez, Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG 2018, and [PBR4] 12.6.3, with
/// four children a node (their importances are one loop of four lanes), and several triangles a leaf, chosen by power.
#ifndef LX_TRACE_LIGHT_TREE_H
#define LX_TRACE_LIGHT_TREE_H

#include "luxel/base.h"
#include "math/vec.h"

#include <stdbool.h>
#include <stdint.h>

enum { lx_light_tree_width = 4, lx_light_leaf_size = 8 };
#define LX_NO_LIGHT_NODE UINT32_MAX

/// Bounds of up to four children: a sphere around their triangles, a cone around their normals, their power. Of empty ones the power is 0.
typedef struct lx_light_node {
    float x[lx_light_tree_width], y[lx_light_tree_width], z[lx_light_tree_width], radius[lx_light_tree_width], radius2[lx_light_tree_width];
    float axis_x[lx_light_tree_width], axis_y[lx_light_tree_width], axis_z[lx_light_tree_width];
    float cos_cone[lx_light_tree_width], sin_cone[lx_light_tree_width];
    float both_sides[lx_light_tree_width]; ///< 1: the triangles shine from both.
    float power[lx_light_tree_width];
    uint32_t first[lx_light_tree_width];   ///< Of a leaf its bin; else a node.
    bool is_leaf[lx_light_tree_width];
    uint32_t parent;                       ///< 4 * node + child; LX_NO_LIGHT_NODE: the root.
} lx_light_node;

/// What the tree has to know of a triangle, and what it keeps of it.
typedef struct lx_light_leaf {
    lx_vec3 corner[3], normal; ///< Unit normal on the shining side.
    float power;
    bool both_sides;
    uint32_t triangle; ///< The caller's number of it.
} lx_light_leaf;

/// The triangles of a leaf: a cache line.
typedef struct lx_light_bin {
    float until[lx_light_leaf_size]; ///< Running sum of their shares of the leaf's power; from the last one on above 1.
    uint32_t triangle[lx_light_leaf_size];
} lx_light_bin;

enum { lx_light_block_size = 8 };

/// Some clusters of a tree, as in a node, apart from it; those of power 0 are none.
typedef struct lx_light_block {
    float x[lx_light_block_size], y[lx_light_block_size], z[lx_light_block_size], radius[lx_light_block_size], radius2[lx_light_block_size];
    float axis_x[lx_light_block_size], axis_y[lx_light_block_size], axis_z[lx_light_block_size];
    float cos_cone[lx_light_block_size], sin_cone[lx_light_block_size], both_sides[lx_light_block_size], power[lx_light_block_size];
    uint32_t first[lx_light_block_size];
    bool is_leaf[lx_light_block_size];
} lx_light_block;

/// Every triangle lies below one of the blocks' clusters.
typedef struct lx_light_cut {
    uint32_t first, count; ///< Into the tree's blocks.
} lx_light_cut;

/// What the trees of a source are entered by.
typedef struct lx_light_roots {
    uint32_t root;             ///< LX_NO_LIGHT_NODE: there is no tree.
    lx_light_cut coarse, fine; ///< At most lx_light_coarse_blocks and lx_light_fine_blocks.
} lx_light_roots;

enum { lx_light_coarse_blocks = 2, lx_light_fine_blocks = 32 };

typedef struct lx_light_tree {
    lx_light_node *nodes;
    size_t node_count, node_capacity;
    lx_light_bin *bins;
    size_t bin_count, bin_capacity;
    lx_light_block *blocks;
    size_t block_count, block_capacity;
    // By triangle; the caller makes room for them.
    uint32_t *place; ///< 4 * node + child of its leaf.
    float *share_of; ///< Its share of its leaf's power.
} lx_light_tree;

/// Adds a tree over `leaves` (their order is changed), count > 0, each of power above 0. `place` and `share_of` of their triangles are written.
lx_result lx_light_tree_add(lx_light_tree *tree, lx_light_leaf *leaves, uint32_t count, lx_light_roots *out_roots, lx_error *error);
void lx_light_tree_release(lx_light_tree *tree);

/// Chooses a triangle for what lies at `viewer`; u becomes its place within the choice. False: none shines there (or so little is certain that
/// none was chosen: the estimate is 0).
bool lx_light_tree_sample(const lx_light_tree *tree, uint32_t root, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability);
/// The probability that lx_light_tree_sample chooses that triangle of its tree.
float lx_light_tree_probability(const lx_light_tree *tree, uint32_t triangle, lx_vec3 viewer);

/// About what all triangles together send to `viewer`: sum of power × cosine at the emitter / d², cluster by cluster; too much rather than too little.
float lx_light_tree_sum(const lx_light_tree *tree, const lx_light_roots *roots, lx_vec3 viewer);

/// Receivers close together.
typedef struct lx_light_view {
    lx_vec3 centre, normal; ///< Mean normal (of the cosine), unit.
    float radius;           ///< Of the sphere around all of them.
    float spread;           ///< Normals differ from the mean by vectors of at most this length.
} lx_light_view;

/// Importances of the fine cut for all receivers of a view, their cosine included: most of a descent, done once.
typedef struct lx_light_table {
    const lx_light_block *blocks;
    float sums[lx_light_fine_blocks]; ///< Running; the rest has the last.
    float importance[lx_light_fine_blocks][lx_light_block_size];
    bool rough; ///< Receivers see the source so differently that each had better ask the tree.
} lx_light_table;

/// False: certainly nothing shines on any receiver of the view.
bool lx_light_table_fill(lx_light_table *table, const lx_light_tree *tree, const lx_light_roots *roots, const lx_light_view *view);

/// A choice halfway: a cluster of the table, and the place within it.
typedef struct lx_light_choice {
    float probability, u;
    uint32_t first;
    bool is_leaf;
} lx_light_choice;

/// As lx_light_tree_sample, for a viewer of the table's view, in two steps: memory that the second waits for is asked for by the first.
lx_light_choice lx_light_table_choose(const lx_light_table *table, const lx_light_tree *tree, float u);
bool lx_light_tree_finish(const lx_light_tree *tree, const lx_light_choice *choice, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability);

#endif
