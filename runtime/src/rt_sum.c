// Walks a region block by block, finds out which layers have a block there, and hands groups of them to the kernel.
#include "rt_sum.h"

#include <math.h>

enum {
    listed_layers = 128,
    sums_cost = 3, // reading a block's sums moves as many bytes as reading three layers of it
};

// The layers that are not black, found once per call; should there be more than fit, the others are looked for in every block.
typedef struct layer_list {
    lxrt_factors factors;
    uint32_t count, first_unlisted;
    uint32_t layers[listed_layers];
} layer_list;

static const float *factor_of(const layer_list *list, uint32_t layer)
{
    return list->factors.first + list->factors.stride * layer;
}

static void list_layers(layer_list *list, lxrt_factors factors, uint32_t layer_count)
{
    list->factors = factors;
    list->count = 0;
    uint32_t layer = 0;
    for (; layer < layer_count && list->count < listed_layers; ++layer)
        if (!lxrt_is_black(factor_of(list, layer))) list->layers[list->count++] = layer;
    list->first_unlisted = layer;
}

typedef struct walk {
    const lxrt_pack *pack;
    const lxrt_region *region;
    const lxrt_target *target;
    const lxrt_kept *kept;
    size_t row_bytes, texel_bytes;
    uint32_t across;       // blocks of the level
    uint32_t x, y;         // where the next block's part begins, in texels of the level
    layer_list all, changed;

    const layer_list *list; // of the block that is being summed; NULL: none
    uint32_t position;      // in the list and then in the layers behind it: which comes next
    int from_sums;
    float scratch[lxrt_sums_floats]; // between the groups of a block whose sums are not kept
} walk;

// The block of a layer that is next in the list and is present here; NULL when there are no more. `position` moves behind it.
static const unsigned char *next_block(const walk *w, const layer_list *list, size_t entry, uint32_t *position, const float **out_factor)
{
    const lxrt_pack *pack = w->pack;
    const size_t entries = pack->level_first[pack->level_count];
    for (;; ++*position) {
        uint32_t layer;
        if (*position < list->count) {
            layer = list->layers[*position];
        } else {
            layer = list->first_unlisted + (*position - list->count);
            if (layer >= pack->layer_count) return NULL;
            if (lxrt_is_black(factor_of(list, layer))) continue;
        }
        const uint32_t number = lxrt_load_u32(pack->block_index + 4 * (entry + entries * layer));
        if (number == 0) continue;
        ++*position;
        *out_factor = factor_of(list, layer);
        return pack->blocks + (size_t)(number - 1) * lxrt_block_bytes;
    }
}

static uint32_t count_present(const walk *w, const layer_list *list, size_t entry)
{
    uint32_t count = 0, position = 0;
    const float *factor;
    while (next_block(w, list, entry, &position, &factor)) ++count;
    return count;
}

// What to do about a block of kept sums: nothing, adding the changes, or all anew where that reads no more.
static const layer_list *choose_list(const walk *w, size_t entry)
{
    if (!w->kept || w->kept->afresh) return &w->all;
    const uint32_t changed = count_present(w, &w->changed, entry);
    if (changed == 0) return NULL;
    return changed + sums_cost < count_present(w, &w->all, entry) ? &w->changed : &w->all;
}

// The next job of the walk; 0 at its end.
static int next_job(walk *w, lxrt_job *job, lxrt_group *group)
{
    const lxrt_region *region = w->region;
    const uint32_t right = region->x + region->width, bottom = region->y + region->height;
    for (; w->y < bottom; w->y = (w->y / lxrt_block_size + 1) * lxrt_block_size, w->x = region->x) {
        while (w->x < right) {
            const uint32_t block_x = w->x / lxrt_block_size, block_y = w->y / lxrt_block_size;
            const uint32_t x_end = (block_x + 1) * lxrt_block_size, y_end = (block_y + 1) * lxrt_block_size;
            const size_t place = (size_t)block_y * w->across + block_x;
            const size_t entry = (size_t)region->page * w->pack->layer_count * w->pack->level_first[w->pack->level_count] +
                                 w->pack->level_first[region->level] + place;
            if (!w->list) {
                w->list = choose_list(w, entry);
                w->position = 0;
                w->from_sums = w->list == &w->changed;
                if (!w->list) {
                    w->x = x_end;
                    continue;
                }
            }

            const float *factor = NULL;
            const unsigned char *block = NULL;
            uint32_t position = w->position;
            group->count = 0;
            while ((block = next_block(w, w->list, entry, &position, &factor)) != NULL && group->count < lxrt_group_layers) {
                lxrt_group_add(group, block, factor);
                w->position = position;
            }
            float *const kept = w->kept ? w->kept->sums + place * lxrt_sums_floats : NULL;
            float *const between = kept ? kept : w->scratch;
            const int is_last = block == NULL;
            *job = (lxrt_job){
                .group = group,
                .from = w->from_sums ? between : NULL,
                .to = is_last ? kept : between,
                .x0 = w->x % lxrt_block_size,
                .y0 = w->y % lxrt_block_size,
                .x1 = (right < x_end ? right : x_end) - block_x * lxrt_block_size,
                .y1 = (bottom < y_end ? bottom : y_end) - block_y * lxrt_block_size,
                .texels = is_last ? (unsigned char *)w->target->texels + (w->y - region->y) * w->row_bytes +
                                        (w->x - region->x) * w->texel_bytes
                                  : NULL,
                .row_bytes = w->row_bytes,
                .format = w->target->format,
                .scale = w->target->scale,
            };
            w->from_sums = 1;
            if (is_last) {
                w->list = NULL;
                w->x = x_end;
            }
            return 1;
        }
    }
    return 0;
}

lxrt_result lxrt_check_region(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target)
{
    if (!pack || !region || !target || region->page >= pack->page_count || region->level >= pack->level_count)
        return LXRT_ERROR_INVALID_ARGUMENT;
    const uint32_t size = lxrt_level_size(pack, region->level);
    if (region->x > size || region->width > size - region->x || region->y > size || region->height > size - region->y)
        return LXRT_ERROR_INVALID_ARGUMENT;
    if ((unsigned)target->format > LXRT_FORMAT_RGB9E5 || !(target->scale > 0) || isinf(target->scale)) return LXRT_ERROR_INVALID_ARGUMENT;
    if (target->row_bytes != 0 && target->row_bytes < region->width * lxrt_format_bytes(target->format)) return LXRT_ERROR_INVALID_ARGUMENT;
    if (region->width != 0 && region->height != 0 && !target->texels) return LXRT_ERROR_INVALID_ARGUMENT;
    return LXRT_OK;
}

void lxrt_sum_region(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target, lxrt_factors factors,
                     const lxrt_kept *kept)
{
    walk w;
    w.pack = pack;
    w.region = region;
    w.target = target;
    w.kept = kept;
    w.texel_bytes = lxrt_format_bytes(target->format);
    w.row_bytes = target->row_bytes ? target->row_bytes : region->width * w.texel_bytes;
    w.across = lxrt_blocks_across(lxrt_level_size(pack, region->level));
    w.x = region->x;
    w.y = region->y;
    w.list = NULL;
    list_layers(&w.all, factors, pack->layer_count);
    if (kept && !kept->afresh) list_layers(&w.changed, kept->changes, pack->layer_count);

    // One job ahead, so that the kernel can fetch what the next one reads.
    lxrt_job jobs[2];
    lxrt_group groups[2];
    int more = next_job(&w, &jobs[0], &groups[0]);
    for (uint32_t i = 0; more; i ^= 1) {
        more = next_job(&w, &jobs[i ^ 1], &groups[i ^ 1]);
        if (!more) groups[i ^ 1].count = 0;
        jobs[i].next = &groups[i ^ 1];
        pack->kernel(&jobs[i]);
    }
}
