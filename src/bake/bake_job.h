/// A bake at work: what its stages share while lx_bake_run runs.
#ifndef LX_BAKE_BAKE_JOB_H
#define LX_BAKE_BAKE_JOB_H

#include "bake/luxel_map.h"
#include "bake/texel_sites.h"

typedef struct lx_bake_job {
    lx_bake *bake;
    lx_luxel_page *pages;  ///< [page_count]
    lx_bake_map map;
    float *tile_weights;   ///< [map.tile_count] luxels of each, for the progress.
    const lx_progress_sink *progress;
    lx_stage_seconds stages;
    uint64_t ray_count;
    float noise;           ///< As in lx_bake_summary.
    uint32_t group_count;
    uint64_t predicted_bytes; ///< Likewise.
} lx_bake_job;

/// Both fill the light of all luxels and layers.
lx_result lx_bake_by_paths(lx_bake_job *job, lx_error *error);
lx_result lx_bake_by_gathering(lx_bake_job *job, lx_error *error);

/// Do gather rays from a luxel meet the source's light, and is that a part of its direct light?
static inline bool lx_bake_meets(const lx_bake *bake, uint32_t source)
{
    const lx_source_kind kind = lx_tracer_source(bake->tracer, source)->kind;
    return bake->uses[source].direct && !bake->desc.indirect_only && (kind == LX_SOURCE_EMISSIVE || kind == LX_SOURCE_SKY);
}

/// The luxel's place among the pages.
static inline const lx_luxel_page *lx_job_page(const lx_bake_job *job, uint32_t luxel, uint32_t *texel)
{
    const uint32_t page_texels = job->map.view.page_size * job->map.view.page_size;
    *texel = job->map.texel[luxel] % page_texels;
    return &job->pages[job->map.texel[luxel] / page_texels];
}

#endif
