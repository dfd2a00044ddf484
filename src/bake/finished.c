// Finished layers. A page is mostly padding and nothing: only luxels are kept, and one table for all layers tells which luxel a texel shows.
#include "bake/finished.h"

#include "base/error.h"
#include "base/memory.h"
#include "base/scratch.h"
#include "post/dilate.h"

#include <string.h>

enum { no_entry = UINT32_MAX }; // black

struct lx_finished {
    uint32_t page_size, page_count, layer_count;
    uint32_t *entry;        // [page_count][page_size²] whose colour the texel has; no_entry: nobody's
    uint8_t *shown;         // [luxel_count] valid: others may hold anything
    uint32_t *first_luxel;  // [page_count + 1] luxels of a page are consecutive, so that an image needs a part of its layer only;
    uint32_t *first_extra;  // [page_count + 1] likewise, from luxel_count on
    uint32_t luxel_count, extra_count;
    lx_rgb *luxels;         // [layer][luxel_count], unless on disk;
    lx_rgb *extras;         // [layer][extra_count], likewise
    lx_scratch *scratch;    // the same two arrays, one after the other
};

static lx_result fail_size(lx_error *error, uint32_t count, uint32_t layer_count)
{
    return lx_fail(error, LX_ERROR_OUT_OF_MEMORY, "out of memory: %u layers of %u texels need %.1f GiB; fewer layers or texels do, or a memory limit",
                   layer_count, count, (double)count * layer_count * sizeof(lx_rgb) / (1u << 30));
}

lx_result lx_finished_create(const lx_luxel_map *map, uint32_t layer_count, bool on_disk, const char *folder, lx_finished **out, lx_error *error)
{
    lx_result result = LX_OK;
    const size_t page_texels = (size_t)map->page_size * map->page_size, texel_count = page_texels * map->page_count;
    size_t value_count;
    lx_finished *f = lx_calloc_array(1, sizeof *f);
    if (!f) return lx_fail_memory(error, "layers");
    f->page_size = map->page_size;
    f->page_count = map->page_count;
    f->layer_count = layer_count;
    f->luxel_count = map->count;
    f->entry = lx_malloc_array(texel_count, sizeof *f->entry);
    f->shown = lx_calloc_array(map->count, 1);
    f->first_luxel = lx_calloc_array((size_t)map->page_count + 1, sizeof *f->first_luxel);
    f->first_extra = lx_calloc_array((size_t)map->page_count + 1, sizeof *f->first_extra);
    if (!f->entry || !f->shown || !f->first_luxel || !f->first_extra) {
        result = lx_fail_memory(error, "layers");
        goto cleanup;
    }
    memset(f->entry, 0xff, texel_count * sizeof *f->entry); // no_entry
    for (uint32_t i = 0; i < map->count; ++i) ++f->first_luxel[map->texel[i] / page_texels + 1];
    for (uint32_t page = 0; page < map->page_count; ++page) f->first_luxel[page + 1] += f->first_luxel[page];
    if (on_disk) {
        LX_TRY(lx_scratch_create(folder, &f->scratch, error));
    } else {
        if (lx_mul_size(map->count, layer_count, &value_count)) f->luxels = lx_malloc_array(value_count, sizeof *f->luxels);
        if (!f->luxels) {
            result = fail_size(error, map->count, layer_count);
            goto cleanup;
        }
    }
    *out = f;
    f = NULL;
cleanup:
    lx_finished_destroy(f);
    return result;
}

void lx_finished_destroy(lx_finished *f)
{
    if (!f) return;
    lx_scratch_destroy(f->scratch);
    lx_free(f->entry);
    lx_free(f->shown);
    lx_free(f->first_luxel);
    lx_free(f->first_extra);
    lx_free(f->luxels);
    lx_free(f->extras);
    lx_free(f);
}

lx_result lx_finished_dilate(lx_finished *f, const lx_luxel_map *map, uint32_t page, uint32_t padding, uint32_t *page_chart, lx_error *error)
{
    lx_result result = LX_OK;
    const size_t texel_count = (size_t)f->page_size * f->page_size;
    const uint32_t *index = map->index + page * texel_count;
    uint32_t *entry = f->entry + page * texel_count;
    uint8_t *valid = lx_malloc_array(texel_count, 1);
    if (!valid) return lx_fail_memory(error, "dilation");
    for (size_t i = 0; i < texel_count; ++i) valid[i] = index[i] != LX_NO_LUXEL && map->valid[index[i]];
    LX_TRY(lx_dilate_map(f->page_size, padding, page_chart, valid, entry, error));
    for (size_t i = 0; i < texel_count; ++i) entry[i] = entry[i] == UINT32_MAX ? (uint32_t)no_entry : index[entry[i]]; // sources are luxels
    for (uint32_t i = f->first_luxel[page]; i < f->first_luxel[page + 1]; ++i) f->shown[i] = map->valid[i];
cleanup:
    lx_free(valid);
    return result;
}

lx_result lx_finished_extend(lx_finished *f, const uint32_t *texels, uint32_t count, lx_error *error)
{
    const uint32_t page_texels = f->page_size * f->page_size;
    if (count == 0) return LX_OK;
    if (!f->scratch) {
        size_t value_count;
        if (lx_mul_size(count, f->layer_count, &value_count)) f->extras = lx_malloc_array(value_count, sizeof *f->extras);
        if (!f->extras) return fail_size(error, f->luxel_count + count, f->layer_count);
    }
    f->extra_count = count;
    for (uint32_t i = 0; i < count; ++i) {
        f->entry[texels[i]] = f->luxel_count + i;
        ++f->first_extra[texels[i] / page_texels + 1];
    }
    for (uint32_t page = 0; page < f->page_count; ++page) f->first_extra[page + 1] += f->first_extra[page];
    return LX_OK;
}

const uint32_t *lx_finished_entries(const lx_finished *finished)
{
    return finished->entry;
}

uint32_t lx_finished_count(const lx_finished *f)
{
    return f->luxel_count + f->extra_count;
}

// ---- entries: luxels and extras are apart, because luxels may be written before it is known which others there are

static uint64_t place_of_luxels(const lx_finished *f, uint32_t layer, uint32_t first)
{
    return (uint64_t)layer * f->luxel_count + first;
}

static uint64_t place_of_extras(const lx_finished *f, uint32_t layer, uint32_t first)
{
    return (uint64_t)layer * f->extra_count + first;
}

static uint64_t offset_of_extras(const lx_finished *f, uint32_t layer, uint32_t first)
{
    return ((uint64_t)f->layer_count * f->luxel_count + place_of_extras(f, layer, first)) * sizeof(lx_rgb);
}

static lx_result write_luxels(lx_finished *f, uint32_t layer, uint32_t first, uint32_t count, const lx_rgb *rgb, lx_error *error)
{
    if (f->scratch) return lx_scratch_write(f->scratch, place_of_luxels(f, layer, first) * sizeof *rgb, rgb, count * sizeof *rgb, error);
    memcpy(f->luxels + place_of_luxels(f, layer, first), rgb, count * sizeof *rgb);
    return LX_OK;
}

static lx_result write_extras(lx_finished *f, uint32_t layer, uint32_t first, uint32_t count, const lx_rgb *rgb, lx_error *error)
{
    if (f->scratch) return lx_scratch_write(f->scratch, offset_of_extras(f, layer, first), rgb, count * sizeof *rgb, error);
    memcpy(f->extras + place_of_extras(f, layer, first), rgb, count * sizeof *rgb);
    return LX_OK;
}

lx_result lx_finished_write(lx_finished *f, uint32_t layer, uint32_t first, uint32_t count, const lx_rgb *rgb, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t left = first < f->luxel_count ? f->luxel_count - first : 0, luxels = count < left ? count : left;
    if (luxels) LX_TRY(write_luxels(f, layer, first, luxels, rgb, error));
    if (count > luxels) LX_TRY(write_extras(f, layer, first + luxels - f->luxel_count, count - luxels, rgb + luxels, error));
cleanup:
    return result;
}

// Entries of one layer that one or all pages show.
typedef struct layer_part {
    const lx_rgb *luxels, *extras; // from first_luxel and first_extra on
    uint32_t first_luxel, first_extra;
    lx_rgb *owned;
} layer_part;

static lx_result open_part(const lx_finished *f, uint32_t layer, uint32_t first_page, uint32_t end_page, layer_part *out, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t luxels = f->first_luxel[end_page] - f->first_luxel[first_page];
    const uint32_t extras = f->first_extra[end_page] - f->first_extra[first_page];
    *out = (layer_part){.first_luxel = f->first_luxel[first_page], .first_extra = f->first_extra[first_page]};
    if (!f->scratch) {
        out->luxels = f->luxels + place_of_luxels(f, layer, out->first_luxel);
        if (extras) out->extras = f->extras + place_of_extras(f, layer, out->first_extra);
        return LX_OK;
    }
    out->owned = lx_malloc_array((size_t)luxels + extras, sizeof *out->owned);
    if (!out->owned) return lx_fail_memory(error, "layers");
    out->luxels = out->owned;
    out->extras = out->owned + luxels;
    LX_TRY(lx_scratch_read(f->scratch, place_of_luxels(f, layer, out->first_luxel) * sizeof *out->owned, out->owned, luxels * sizeof *out->owned, error));
    LX_TRY(lx_scratch_read(f->scratch, offset_of_extras(f, layer, out->first_extra), out->owned + luxels, extras * sizeof *out->owned, error));
cleanup:
    if (result != LX_OK) lx_free(out->owned);
    return result;
}

static lx_rgb colour_of(const lx_finished *f, const layer_part *part, uint32_t entry)
{
    if (entry == no_entry) return (lx_rgb){0, 0, 0};
    return entry < f->luxel_count ? part->luxels[entry - part->first_luxel] : part->extras[entry - f->luxel_count - part->first_extra];
}

lx_result lx_finished_image(const lx_finished *f, uint32_t page, uint32_t layer, float *out_rgb, lx_error *error)
{
    const size_t texel_count = (size_t)f->page_size * f->page_size;
    const uint32_t *entry = f->entry + page * texel_count;
    layer_part part;
    const lx_result result = open_part(f, layer, page, page + 1, &part, error);
    if (result != LX_OK) return result;
    for (size_t i = 0; i < texel_count; ++i) {
        const lx_rgb colour = colour_of(f, &part, entry[i]);
        out_rgb[3 * i] = colour.r;
        out_rgb[3 * i + 1] = colour.g;
        out_rgb[3 * i + 2] = colour.b;
    }
    lx_free(part.owned);
    return LX_OK;
}

lx_result lx_finished_range(const lx_finished *f, uint32_t layer, lx_layer_range *out, lx_error *error)
{
    layer_part part;
    const lx_result result = open_part(f, layer, 0, f->page_count, &part, error);
    if (result != LX_OK) return result;
    float largest = 0;
    double sum = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < f->luxel_count; ++i) {
        if (!f->shown[i]) continue;
        const lx_rgb c = part.luxels[i];
        ++count;
        largest = fmaxf(largest, fmaxf(c.r, fmaxf(c.g, c.b)));
        sum += (double)c.r + (double)c.g + (double)c.b;
    }
    for (uint32_t i = 0; i < f->extra_count; ++i) largest = fmaxf(largest, fmaxf(part.extras[i].r, fmaxf(part.extras[i].g, part.extras[i].b)));
    *out = (lx_layer_range){largest, count ? sum / (3.0 * count) : 0};
    lx_free(part.owned);
    return LX_OK;
}

uint64_t lx_finished_bytes(uint64_t luxel_count, uint64_t texel_count, uint32_t layer_count, bool on_disk)
{
    return texel_count * sizeof(uint32_t) + luxel_count * (1 + sizeof(lx_rgb) * (on_disk ? 1 : layer_count));
}
