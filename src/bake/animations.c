// Drivers of layers. A layer has one colour, so what drives it must drive all its sources: a program does by decree, a track of the file only if
// all are the same lamp or material.
#include "bake/animations.h"

#include "bake/layers.h"
#include "base/error.h"
#include "math/hash.h"

#include <string.h>

static lx_log *log_of(const lx_bake *bake)
{
    return bake->scene->context->log;
}

static lx_result append(lx_bake *bake, const lx_pack_animation *item, lx_error *error)
{
    struct lx_bake_animations *all = bake->animations;
    if (!lx_array_reserve(&all->items, &all->capacity, all->count + 1, sizeof *all->items)) return lx_fail_memory(error, "animations");
    all->items[all->count++] = *item;
    return LX_OK;
}

// ---- programs

// c of the layer for an intensity of one of its sources as the file writes it. In a group of unlike colours the source's colour is in its weight,
// not in the layer's; where the layer has the source's colour both cancel out.
static float layer_intensity(const lx_source *source, const lx_source_use *use, const lx_layer *layer, float file_intensity)
{
    const float share = lx_rgb_max(use->weight);
    const float own = lx_rgb_max(source->color), shown = fmaxf(layer->color[0], fmaxf(layer->color[1], layer->color[2]));
    const float tint = own > 0 && shown > 0 ? own / shown : 1;
    return file_intensity * source->intensity_scale * tint / (share > 0 ? share : 1);
}

static bool is_grey(const float c[3])
{
    return c[0] == c[1] && c[1] == c[2];
}

static bool is_sane(float value)
{
    return fabsf(value) <= LX_PACK_MOST_LIGHT;
}

static lx_result set_schedule(lx_bake *bake, const lx_program *program, const lx_source *source, const lx_source_use *use,
                              const lx_layer *layer, lxrt_program *out, bool *sane, lx_error *error)
{
    float *keys = lx_arena_alloc(&bake->animations->keys, program->key_count, 4 * sizeof *keys);
    if (!keys) return lx_fail_memory(error, "animations");
    for (uint32_t i = 0; i < program->key_count; ++i) {
        const lx_program_key *key = &program->keys[i];
        const float intensity = key->intensity < 0 ? layer->intensity : layer_intensity(source, use, layer, key->intensity);
        const float numbers[4] = {key->time_s, key->color.r * intensity, key->color.g * intensity, key->color.b * intensity};
        memcpy(keys + 4 * (size_t)i, numbers, sizeof numbers);
        *sane &= is_sane(numbers[1]) && is_sane(numbers[2]) && is_sane(numbers[3]);
    }
    out->keys = keys;
    out->key_count = program->key_count;
    return LX_OK;
}

static lx_result add_program(lx_bake *bake, uint32_t layer_index, uint32_t source_index, lx_error *error)
{
    const lx_layer *layer = &bake->layers[layer_index];
    const lx_source *source = lx_tracer_source(bake->tracer, source_index);
    const lx_source_use *use = &bake->uses[source_index];
    const lx_program *program = source->animate;
    lx_pack_animation item = {.name = "", .layer = layer_index, .channel = LX_PACK_CHANNEL_WHOLE, .program = lxrt_program_default()};
    lxrt_program *out = &item.program;
    out->kind = (lxrt_program_kind)program->kind;
    memcpy(out->color, layer->color, sizeof out->color);
    if (program->has_color) {
        out->color[0] = program->color.r;
        out->color[1] = program->color.g;
        out->color[2] = program->color.b;
    }
    out->intensity = program->intensity < 0 ? layer->intensity : layer_intensity(source, use, layer, program->intensity);
    out->period_s = program->period_s;
    out->phase_s = program->phase_s;
    out->duty = program->duty;
    out->low = program->low;
    out->high = program->high;
    out->fade_s = program->fade_s;
    // Two candles do not flicker alike unless someone wants them to.
    out->seed = program->has_seed ? program->seed : (uint32_t)lx_hash64(lx_hash_bytes(0xcbf29ce484222325u, layer->name, strlen(layer->name)));
    bool sane = is_sane(out->intensity);
    for (int i = 0; i < 3; ++i) sane &= is_sane(out->color[i] * out->intensity * fmaxf(1, fmaxf(out->low, out->high)));
    if (program->kind == LX_PROGRAM_SCHEDULE) {
        const lx_result result = set_schedule(bake, program, source, use, layer, out, &sane, error);
        if (result != LX_OK) return result;
    }
    if (!sane) {
        lx_log_warning(log_of(bake), "layer '%s': its luxel_animate is far too bright; ignored", layer->name);
        return LX_OK;
    }
    if (program->kind == LX_PROGRAM_WHEEL && is_grey(out->color))
        lx_log_warning(log_of(bake), "layer '%s': its luxel_animate turns the hue of a colour that has none; add color=#rrggbb", layer->name);
    return append(bake, &item, error);
}

static bool same_color(lx_rgb a, lx_rgb b)
{
    return a.r == b.r && a.g == b.g && a.b == b.b;
}

static bool same_program(const lx_program *a, const lx_program *b)
{
    if (a->kind != b->kind || a->period_s != b->period_s || a->phase_s != b->phase_s || a->duty != b->duty || a->low != b->low ||
        a->high != b->high || a->fade_s != b->fade_s || a->intensity != b->intensity || a->has_seed != b->has_seed ||
        (a->has_seed && a->seed != b->seed) || a->has_color != b->has_color || (a->has_color && !same_color(a->color, b->color)) ||
        a->key_count != b->key_count)
        return false;
    for (uint32_t i = 0; i < a->key_count; ++i)
        if (a->keys[i].time_s != b->keys[i].time_s || a->keys[i].intensity != b->keys[i].intensity ||
            !same_color(a->keys[i].color, b->keys[i].color))
            return false;
    return true;
}

// One program per layer: that of its first animated source. `first`: [layer] the source found so far, LX_MISS: none.
static lx_result add_programs(lx_bake *bake, uint32_t *first, lx_error *error)
{
    bool *told = lx_calloc_array(bake->layer_count, sizeof *told);
    if (!told) return lx_fail_memory(error, "animations");
    lx_result result = LX_OK;
    memset(first, 0xff, bake->layer_count * sizeof *first);
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        const int32_t layer = bake->uses[i].layer;
        if (layer < 0 || !source->animate) continue;
        if (bake->layers[layer].monitor)
            lx_log_warning(log_of(bake), "monitor '%s': luxel_animate has no effect: its picture drives it", source->name);
        else if (first[layer] == LX_MISS)
            first[layer] = i;
    }
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        const int32_t layer = bake->uses[i].layer;
        if (layer < 0 || first[layer] == LX_MISS || told[layer]) continue;
        const lx_source *driver = lx_tracer_source(bake->tracer, first[layer]);
        told[layer] = !source->animate || !same_program(source->animate, driver->animate);
        if (told[layer])
            lx_log_warning(log_of(bake), "layer '%s': luxel_animate of '%s' also drives '%s', which has %s", bake->layers[layer].name,
                           driver->name, source->name, source->animate ? "another" : "none");
    }
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer)
        if (first[layer] != LX_MISS) LX_TRY(add_program(bake, layer, first[layer], error));
cleanup:
    lx_free(told);
    return result;
}

// ---- tracks

// A source of the layer that the track does not drive; NULL: it drives all. *scale: of the values, that of the strongest member.
static const lx_source *find_undriven(const lx_bake *bake, int32_t layer, const lx_track *track, float *scale)
{
    *scale = 0;
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        if (bake->uses[i].layer != layer) continue;
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        if (!lx_source_is_driven(bake->scene, source, track)) return source;
        *scale = fmaxf(*scale, track->channel == LX_TRACK_COLOR ? source->color_scale : source->intensity_scale);
    }
    return NULL;
}

static bool is_there(const lx_bake *bake, const lx_pack_animation *item)
{
    for (size_t i = 0; i < bake->animations->count; ++i) {
        const lx_pack_animation *other = &bake->animations->items[i];
        if (other->layer == item->layer && other->channel == item->channel && strcmp(other->name, item->name) == 0) return true;
    }
    return false;
}

static lx_result add_track(lx_bake *bake, uint32_t layer, const lx_track *track, float scale, lx_error *error)
{
    const bool color = track->channel == LX_TRACK_COLOR;
    const size_t stride = lx_track_stride(track);
    lx_pack_animation item = {.name = track->name, .layer = layer, .channel = color ? LX_PACK_CHANNEL_COLOR : LX_PACK_CHANNEL_INTENSITY,
                              .program = lxrt_program_default()};
    if (is_there(bake, &item)) {
        lx_log_warning(log_of(bake), "animation '%s' animates the %s of layer '%s' twice; the first counts", track->name,
                       color ? "colour" : "intensity", bake->layers[layer].name);
        return LX_OK;
    }
    float *keys = lx_arena_alloc(&bake->animations->keys, track->key_count, stride * sizeof *keys);
    if (!keys) return lx_fail_memory(error, "animations");
    const float other = color ? bake->layers[layer].intensity
                              : fmaxf(bake->layers[layer].color[0], fmaxf(bake->layers[layer].color[1], bake->layers[layer].color[2]));
    for (size_t i = 0; i < track->key_count * stride; ++i) {
        keys[i] = i % stride == 0 ? track->keys[i] : track->keys[i] * scale;
        if (is_sane(keys[i]) && is_sane(keys[i] * other)) continue;
        lx_log_warning(log_of(bake), "animation '%s' makes layer '%s' far too bright; ignored", track->name, bake->layers[layer].name);
        return LX_OK;
    }
    item.program.kind = LXRT_PROGRAM_KEYS;
    item.program.keys = keys;
    item.program.key_count = track->key_count;
    item.program.interpolation = (lxrt_interpolation)track->interpolation;
    return append(bake, &item, error);
}

// `done`: [layer] number of the last track that was looked at for the layer.
static lx_result add_tracks(lx_bake *bake, uint32_t *done, lx_error *error)
{
    lx_result result = LX_OK;
    memset(done, 0xff, bake->layer_count * sizeof *done);
    for (uint32_t t = 0; t < bake->scene->track_count; ++t) {
        const lx_track *track = &bake->scene->tracks[t];
        for (uint32_t i = 0; i < bake->source_count; ++i) {
            const lx_source *source = lx_tracer_source(bake->tracer, i);
            const int32_t layer = bake->uses[i].layer;
            if (layer < 0 || done[layer] == t || !lx_source_is_driven(bake->scene, source, track)) continue;
            done[layer] = t;
            float scale;
            if (bake->layers[layer].monitor) {
                lx_log_warning(log_of(bake), "animation '%s' has no effect on monitor '%s': its picture drives it", track->name, source->name);
                continue;
            }
            const lx_source *other = find_undriven(bake, layer, track, &scale);
            if (other)
                lx_log_warning(log_of(bake), "animation '%s' drives '%s' but not '%s', which are both in layer '%s'; not baked: give them two layers",
                               track->name, source->name, other->name, bake->layers[layer].name);
            else
                LX_TRY(add_track(bake, (uint32_t)layer, track, scale, error));
        }
    }
cleanup:
    return result;
}

// A combined bake has one layer for all, which nothing may drive.
static void note_dropped(const lx_bake *bake)
{
    uint32_t count = 0;
    const char *name = "";
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        if (!source->animate && !lx_source_has_track(bake->scene, source)) continue;
        if (count++ == 0) name = source->name;
    }
    if (count == 1)
        lx_log_note(log_of(bake), "what animates '%s' is not baked: a combined layer stays as authored", name);
    if (count > 1)
        lx_log_note(log_of(bake), "what animates '%s' and %u more is not baked: a combined layer stays as authored", name, count - 1);
}

lx_result lx_animations_build(lx_bake *bake, lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t *scratch = lx_calloc_array(bake->layer_count, sizeof *scratch);
    bake->animations = lx_calloc_array(1, sizeof *bake->animations);
    if (!scratch || !bake->animations) {
        result = lx_fail_memory(error, "animations");
        goto cleanup;
    }
    if (bake->desc.combined) {
        note_dropped(bake);
        goto cleanup;
    }
    LX_TRY(add_programs(bake, scratch, error));
    LX_TRY(add_tracks(bake, scratch, error));
cleanup:
    lx_free(scratch);
    return result;
}

void lx_animations_release(lx_bake *bake)
{
    if (!bake->animations) return;
    lx_free(bake->animations->items);
    lx_arena_release(&bake->animations->keys);
    lx_free(bake->animations);
    bake->animations = NULL;
}
