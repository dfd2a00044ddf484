/// Private to src/unwrap: what its files hand each other.
///
///   patch (one primitive, welded) ─▶ segmentation ─▶ overlaps split ─▶ charts in the plane ─▶ layout of a mesh ─▶ pages
#ifndef LX_UNWRAP_UNWRAP_H
#define LX_UNWRAP_UNWRAP_H

#include "base/error.h"
#include "scene/atlas.h"

#include <stdatomic.h>
#include <stddef.h>

#define LX_NONE UINT32_MAX

typedef struct lx_dvec2 { double x, y; } lx_dvec2;
typedef struct lx_dvec3 { double x, y, z; } lx_dvec3;

static inline lx_dvec3 lx_dsub(lx_dvec3 a, lx_dvec3 b) { return (lx_dvec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline lx_dvec3 lx_dmad(lx_dvec3 a, lx_dvec3 b, double s)
{
    return (lx_dvec3){a.x + b.x * s, a.y + b.y * s, a.z + b.z * s};
}
static inline double lx_ddot(lx_dvec3 a, lx_dvec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline lx_dvec3 lx_dcross(lx_dvec3 a, lx_dvec3 b)
{
    return (lx_dvec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double lx_dcross2(lx_dvec2 a, lx_dvec2 b, lx_dvec2 c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}
lx_dvec3 lx_dnormalize(lx_dvec3 a);

/// Upper 3×3 of a transform, row by row: the metric in which a mesh is measured (see lx_mesh_metric in atlas.c).
typedef struct lx_metric { double m[9]; } lx_metric;
lx_dvec3 lx_metric_apply(const lx_metric *metric, lx_vec3 p);

// ---- patch.c ----------------------------------------------------------------------------------------------------------

/// The triangles of one primitive in the metric of its reference instance, welded by position.
typedef struct lx_patch {
    uint32_t vertex_count, triangle_count;
    lx_dvec3 *positions;  ///< [vertex_count]
    uint32_t *corners;    ///< [3 * triangle_count] welded vertices.
    uint32_t *neighbors;  ///< [3 * triangle_count] across the edge corner k → k+1; LX_NONE: border or non-manifold.
    lx_dvec3 *normals;    ///< [triangle_count] unit, along the winding.
    double *areas;        ///< [triangle_count]; 0: counts as without area, belongs to no chart.
} lx_patch;

lx_result lx_patch_init(lx_patch *patch, const lx_primitive *primitive, const lx_metric *metric, lx_error *error);
void lx_patch_release(lx_patch *patch);

// ---- chart_segment.c, chart_overlap.c ---------------------------------------------------------------------------------

/// Which chart every triangle of a patch belongs to. Charts are connected, and every triangle of a chart faces its normal
/// by at least lx_keep_cosine, so that the projection along it turns no triangle over.
typedef struct lx_segmentation {
    uint32_t *chart_of;    ///< [triangle_count]; LX_NO_CHART for triangles without area.
    uint32_t chart_count;
    size_t normal_capacity;
    lx_dvec3 *normals;     ///< [chart_count] direction of projection, unit.
} lx_segmentation;

#define lx_keep_cosine 0.42 // 65°

/// `stop` (may be NULL) ends the work early with LX_ERROR_CANCELLED.
lx_result lx_segment(const lx_patch *patch, const atomic_bool *stop, lx_segmentation *out, lx_error *error);
void lx_segmentation_release(lx_segmentation *segmentation);
/// Adds a chart with this normal and returns its number, LX_NONE without memory.
uint32_t lx_segmentation_add(lx_segmentation *segmentation, lx_dvec3 normal);
/// Numbers the connected parts of all charts anew, in order of their first triangle; parts keep the normal.
lx_result lx_segmentation_connect(const lx_patch *patch, lx_segmentation *segmentation, lx_error *error);

/// Splits charts until none overlaps itself in projection.
lx_result lx_split_overlaps(const lx_patch *patch, const atomic_bool *stop, lx_segmentation *segmentation, lx_error *error);

/// Two of `count` counter-clockwise triangles (three points each) whose insides overlap; false if there are none.
/// `neighbors` (may be NULL): indices of triangles that are known to lie apart, three per triangle.
bool lx_find_overlap(const lx_dvec2 *points, uint32_t count, const uint32_t *neighbors, uint32_t *out_a, uint32_t *out_b,
                     bool *out_of_memory);

// ---- chart_project.c --------------------------------------------------------------------------------------------------

typedef struct lx_segment2 { lx_vec2 a, b; } lx_segment2;

/// A flat piece of surface, in metres × the density of its material, inside [0, width] × [0, height].
typedef struct lx_chart {
    uint32_t primitive;                    ///< Index into the scene's primitives.
    uint32_t first_segment, segment_count; ///< Its border, closed loops in no particular order.
    float width, height, area;
} lx_chart;

/// All charts of a mesh, numbered as in lx_atlas_primitive.triangle_chart.
typedef struct lx_chart_set {
    lx_chart *charts;
    lx_segment2 *segments;
    size_t chart_capacity, segment_count, segment_capacity;
    uint32_t chart_count;
    double area;
} lx_chart_set;

void lx_chart_set_release(lx_chart_set *set);

/// Cuts charts that are longer than `longest` across, between triangles, as far as that makes them shorter.
lx_result lx_split_long_charts(const lx_patch *patch, double longest, lx_segmentation *segmentation, lx_error *error);

/// Appends the charts of a patch to `set`; corner positions in the chart's rectangle go to corner_xy, numbers to triangle_chart.
lx_result lx_project_charts(const lx_patch *patch, const lx_segmentation *segmentation, uint32_t primitive, double density,
                            lx_chart_set *set, lx_vec2 *corner_xy, uint32_t *triangle_chart, lx_error *error);

// ---- pack_charts.c ----------------------------------------------------------------------------------------------------

/// Where a chart goes in its mesh's rectangle: xy · scale texels, turned by `turns` quarters, moved by (x, y).
typedef struct lx_placement {
    uint32_t x, y, turns;
    float scale;
} lx_placement;

/// Packs charts at `texels_per_m` with `padding` texels between them and half of that (rounded up) to the border, into a
/// rectangle of at most limit × limit texels, full_width: as wide as that, else as small as it gets.
/// *out_fits false: no room (placements are then undefined).
lx_result lx_pack_charts(const lx_chart_set *set, double texels_per_m, uint32_t padding, uint32_t limit, bool alone,
                         const atomic_bool *stop, lx_placement *placements, uint32_t *out_width, uint32_t *out_height,
                         bool *out_fits, lx_error *error);

/// About how many texels that takes, without packing.
double lx_estimate_texels(const lx_chart_set *set, double texels_per_m, uint32_t padding);

/// Texel position of a chart point.
lx_dvec2 lx_placement_apply(const lx_placement *placement, const lx_chart *chart, lx_vec2 xy);

// ---- pack_pages.c -----------------------------------------------------------------------------------------------------

typedef struct lx_box { uint32_t width, height, page, x, y; } lx_box;

/// Places boxes on pages of page_size² texels; *out_pages is how many were needed, more than max_pages: it did not fit.
lx_result lx_pack_pages(lx_box *boxes, uint32_t count, uint32_t page_size, uint32_t max_pages, uint32_t *out_pages,
                        lx_error *error);

// ---- raster.c ---------------------------------------------------------------------------------------------------------

/// Called for a run of cells [x0, x1) of row y.
typedef void (*lx_span)(void *user, uint32_t y, uint32_t x0, uint32_t x1);

/// Cells (unit squares) of a size × size grid whose centre lies in the triangle. Triangles that share an edge (the same two
/// points) never share a cell, whatever the winding.
void lx_raster_centers(const lx_dvec2 triangle[3], uint32_t size, lx_span span, void *user);
/// Cells that the triangle touches with more than its rim.
void lx_raster_touched(const lx_dvec2 triangle[3], uint32_t size, lx_span span, void *user);

// ---- uv_check.c -------------------------------------------------------------------------------------------------------

/// Lightmap coordinates that a file brings, of the lit primitives of one mesh.
typedef struct lx_uv_set {
    lx_vec2 *uv;            ///< [3 * triangle_count] per corner, primitive after primitive.
    uint32_t *charts;       ///< [triangle_count] parts connected over shared edges; LX_NO_CHART: without area here or in space.
    uint32_t triangle_count, chart_count;
    double area, uv_area;   ///< Of the triangles that have both.
    lx_vec2 low, high;      ///< Bounds of uv.
    const char *flaw;       ///< Why it cannot serve whatever the resolution, as the end of a sentence; NULL: it can.
} lx_uv_set;

/// Gathers TEXCOORD_1 of the mesh's primitives that have lit[primitive]. A set that cannot serve at all has `flaw` and may be empty.
lx_result lx_uv_set_init(lx_uv_set *set, const lx_scene *scene, const lx_mesh *mesh, const bool *lit, const lx_metric *metric,
                         lx_error *error);
void lx_uv_set_release(lx_uv_set *set);

/// *out_overlap: triangles of these sets, drawn into one unit square, lie over each other.
lx_result lx_uv_sets_overlap(const lx_uv_set *const *sets, uint32_t set_count, bool *out_overlap, lx_error *error);
/// *out_apart: different charts are two texels apart when the unit square has texels × texels.
lx_result lx_uv_sets_apart(const lx_uv_set *const *sets, uint32_t set_count, uint32_t texels, bool *out_apart,
                           lx_error *error);

// ---- mesh_unwrap.c ----------------------------------------------------------------------------------------------------

/// A triangle without area and a corner whose place it takes.
typedef struct lx_donor { uint32_t primitive, triangle, corner; } lx_donor;

/// A mesh that takes light, on its way into the atlas.
typedef struct lx_mesh_job {
    uint32_t mesh, first_instance, instance_count; ///< Into lx_unwrap_job.instances.
    uint64_t triangle_count;                       ///< Of its lit primitives.
    lx_metric metric;      ///< That of the instance that needs the most texels.
    double density;        ///< luxel_density of that instance.
    double size;           ///< Square root of its area, times that density.
    bool has_set;          ///< A lit primitive brings TEXCOORD_1.
    bool existing;         ///< `set` serves.
    const char *flaw;      ///< Why the file's set was not taken.
    lx_uv_set set;
    lx_chart_set charts;   ///< Where !existing.
    lx_donor *donors;
    size_t donor_count, donor_capacity;
    lx_placement *placements;
    uint32_t width, height; ///< Of the packed rectangle; existing: texels of the unit square, both the same.
    bool fits;
} lx_mesh_job;

/// All of lx_atlas_build's working state.
typedef struct lx_unwrap_job {
    const lx_scene *scene;
    lx_atlas_desc desc;
    lx_atlas *atlas;
    bool *lit;             ///< [primitive_count] takes light somewhere.
    lx_mesh_job *meshes;
    uint32_t mesh_count;
    uint32_t *instances;   ///< Static instances, grouped by job.
    float *ratios;         ///< [instance_count of the scene] texels per metre of mesh, relative to the reference instance.
    uint32_t instance_count;
    atomic_bool stop;
    const lx_progress_sink *sink; ///< The caller's.
    double started, progress_low, progress_high;
    double longest_chart;  ///< Metres × density: what is longer would limit the density of all.
    double texels_per_m;   ///< Of the evaluation that runs.
} lx_unwrap_job;

/// lx_pool_run over job->meshes within the stage "unwrap", as the part [progress_high, to] of it.
lx_result lx_unwrap_run(lx_unwrap_job *job, lx_task task, double to, lx_error *error);

/// Tasks over meshes: choose the reference instance; unwrap into charts; write final coordinates.
lx_result lx_measure_mesh(void *user, size_t index, uint32_t worker, lx_error *error);
lx_result lx_unwrap_mesh(void *user, size_t index, uint32_t worker, lx_error *error);
lx_result lx_write_mesh(void *user, size_t index, uint32_t worker, lx_error *error);

// ---- atlas_density.c --------------------------------------------------------------------------------------------------

/// Finds the density (or checks the one asked for), packs all meshes and instances, fills atlas->rects.
lx_result lx_choose_density(lx_unwrap_job *job, lx_error *error);

#endif
