// What the parts of the gather integrator share.
#include "bake/gather_job.h"

#include "base/clock.h"

bool lx_report_part(void *user, const lx_progress *progress)
{
    const lx_stage_part *part = user;
    if (!part->sink || !part->sink->func) return true;
    const lx_progress whole = {progress->stage, part->from + part->share * progress->fraction, lx_seconds() - part->start};
    return part->sink->func(part->sink->user, &whole);
}

void lx_gather_list_luxels(const lx_gather_job *g, const lx_luxel_tile *tile, bool senders, lx_gather_scratch *s)
{
    const lx_luxel_map *map = &g->job->map.view;
    s->count = 0;
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        if (!map->valid[i] || (senders && g->spacing[i] > 0)) continue;
        uint32_t texel;
        const lx_luxel_page *page = lx_job_page(g->job, i, &texel);
        s->luxel[s->count] = i;
        s->chart[s->count] = map->chart[i];
        s->stream[s->count] = lx_luxel_stream(g->bake, page, texel);
        s->place[s->count++] = (uint16_t)((lx_luxel_y(map, i) - tile->y) * lx_luxel_tile_edge + lx_luxel_x(map, i) - tile->x);
    }
}

void lx_gather_place_sites(const lx_gather_job *g, lx_gather_scratch *s, uint32_t index, uint32_t first, uint32_t count, lx_receiver *out)
{
    uint32_t texel;
    const lx_luxel_page *page = lx_job_page(g->job, s->luxel[index], &texel);
    lx_luxel_sites(&s->texel, g->bake, page, texel, first, count, out);
}
