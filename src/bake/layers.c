// Layers from sources: one each, or one per `luxel_layer`; grouped further when there are too many.
//
// A group's sources keep their authored proportions: T = sum of (colour · intensity / K) T_s with K the largest channel value in the group,
// and c = K · white. If all colours are equal the colour stays free: T = sum of (intensity / strongest) T_s, c = colour × strongest.
//
// A monitor takes as many layers as it has cells, one after the other: T of a cell is that cell at unit white radiance, c its share of the
// picture: colour of the monitor × mean of the emissive texture there. Monitors of one `luxel_layer` share them. In a `combined` bake a monitor
// is an emitter like others, with its picture in full.
//
// What drives a layer drives all its sources. So grouping that nobody asked for leaves alone what has a program of its own, and joins what an
// animation of the file drives only with what the same one drives.
#include "bake/layers.h"

#include "base/error.h"

#include <string.h>

static const char *unit_of(lx_source_kind kind)
{
    switch (kind) {
    case LX_SOURCE_POINT:
    case LX_SOURCE_SPOT: return "cd";
    case LX_SOURCE_DIRECTIONAL: return "lx";
    default: return "nt";
    }
}

static lx_rgb authored(const lx_source *s)
{
    return lx_rgb_scale(s->color, s->intensity);
}

static bool is_monitor(const lx_source *s)
{
    return s->columns > 0;
}

// What a source is weighed by within its group: a monitor by a white picture, be it on or off.
static lx_rgb full_color(const lx_source *s)
{
    return is_monitor(s) ? s->white : s->color;
}

static bool is_off(const lx_source *s)
{
    return is_monitor(s) && lx_rgb_is_black(s->color);
}

bool lx_source_is_driven(const lx_scene *scene, const lx_source *source, const lx_track *track)
{
    if (track->object == LX_TRACK_LIGHT) return source->file_light == (int32_t)track->index;
    return source->material >= 0 && scene->materials[source->material].file_index == (int32_t)track->index;
}

bool lx_source_has_track(const lx_scene *scene, const lx_source *source)
{
    for (uint32_t t = 0; t < scene->track_count; ++t)
        if (lx_source_is_driven(scene, source, &scene->tracks[t])) return true;
    return false;
}

lx_source_use *lx_uses_combined(const lx_tracer *tracer)
{
    const uint32_t count = lx_tracer_source_count(tracer);
    lx_source_use *uses = lx_calloc_array(count, sizeof *uses);
    if (!uses) return NULL;
    for (uint32_t i = 0; i < count; ++i) {
        const lx_source *s = lx_tracer_source(tracer, i);
        uses[i] = (lx_source_use){.layer = 0, .weight = authored(s), .direct = s->mode != LX_MODE_MIXED};
        if (lx_tracer_is_told_by_cell(tracer, i)) uses[i].cells = s->picture;
    }
    return uses;
}

// Group keys: sources with equal, non-NULL keys share a layer.
typedef struct grouping {
    char **keys;      // [source count], owned; NULL: a layer of its own
    uint32_t count;
} grouping;

static uint32_t count_layers(const grouping *g)
{
    uint32_t layers = 0;
    for (uint32_t i = 0; i < g->count; ++i) {
        bool first = true;
        for (uint32_t k = 0; g->keys[i] && k < i && first; ++k) first = !g->keys[k] || strcmp(g->keys[k], g->keys[i]) != 0;
        layers += first;
    }
    return layers;
}

static lx_result set_key(grouping *g, uint32_t index, char *key, lx_error *error)
{
    if (!key) return lx_fail_memory(error, "layers");
    lx_free(g->keys[index]);
    g->keys[index] = key;
    return LX_OK;
}

static bool stays_alone(const lx_source *s)
{
    return is_monitor(s) || s->animate;
}

// All that emit by one material share the program it carries; a node's own program is its node's alone.
static bool animated_by_node(const lx_scene *scene, const lx_source *s)
{
    return s->animate && (s->material < 0 || s->animate != scene->materials[s->material].animate);
}

static char *material_key(const lx_scene *scene, const lx_source *s)
{
    const char *name = scene->materials[s->material].name;
    return name[0] ? lx_strdup(name) : lx_format("material_%d", s->material);
}

static char *parent_key(const lx_scene *scene, const lx_source *s)
{
    if (lx_source_has_track(scene, s))
        return s->material >= 0 ? material_key(scene, s) : lx_format("lamps of light %d (%s)", s->file_light, unit_of(s->kind));
    return s->parent_node < 0 ? lx_format("top level (%s)", unit_of(s->kind))
                              : lx_format("children of node %d (%s)", s->parent_node, unit_of(s->kind));
}

// Too many: emissive sources of one material first, then what hangs on one parent node (per unit).
static lx_result group_further(const lx_bake *bake, grouping *g, lx_error *error)
{
    const lx_scene *scene = bake->scene;
    const uint32_t wanted = bake->desc.max_layers, single = count_layers(g);
    if (single <= wanted) return LX_OK;
    uint32_t programs = 0;
    for (uint32_t i = 0; i < g->count; ++i) {
        const lx_source *s = lx_tracer_source(bake->tracer, i);
        programs += !s->layer && !is_monitor(s) && animated_by_node(scene, s);
        if (s->layer || s->kind != LX_SOURCE_EMISSIVE || is_monitor(s) || animated_by_node(scene, s)) continue;
        const lx_result result = set_key(g, i, material_key(scene, s), error);
        if (result != LX_OK) return result;
    }
    uint32_t count = count_layers(g);
    const char *how = "by material";
    if (count > wanted) {
        how = "by material and parent node";
        for (uint32_t i = 0; i < g->count; ++i) {
            const lx_source *s = lx_tracer_source(bake->tracer, i);
            if (s->layer || s->kind == LX_SOURCE_SKY || stays_alone(s)) continue;
            const lx_result result = set_key(g, i, parent_key(scene, s), error);
            if (result != LX_OK) return result;
        }
        count = count_layers(g);
    }
    if (count > wanted) {
        char *alone = programs > 0 ? lx_format(" (%u for a luxel_animate each)", programs) : lx_strdup("");
        const lx_result result = lx_fail(
            error, LX_ERROR_LIMIT, "%u layers%s are more than --max-layers %u, even grouped %s: raise it or name groups with luxel_layer",
            count, alone ? alone : "", wanted, how);
        lx_free(alone);
        return result;
    }
    lx_log_note(scene->context->log, "%u sources are more than --max-layers %u: grouped %s into %u layers", single, wanted,
                how, count);
    return LX_OK;
}

static bool name_is_taken(const lx_bake *bake, const char *name)
{
    for (uint32_t i = 0; i < bake->layer_count; ++i)
        if (strcmp(bake->layers[i].name, name) == 0) return true;
    return false;
}

static char *unique_name(const lx_bake *bake, const char *name)
{
    char *candidate = lx_strdup(name);
    for (uint32_t k = 2; candidate && name_is_taken(bake, candidate); ++k) {
        lx_free(candidate);
        candidate = lx_format("%s#%u", name, k);
    }
    return candidate;
}

static const char *node_name(const lx_bake *bake, const lx_source *s)
{
    if (s->kind == LX_SOURCE_SKY) return "";
    if (s->light >= 0) return bake->scene->lights[s->light].name;
    for (uint32_t i = 0; i < bake->scene->instance_count; ++i)
        if (bake->scene->instances[i].node == s->node) return bake->scene->instances[i].name;
    return s->name;
}

static bool same_color(lx_rgb a, lx_rgb b)
{
    return a.r == b.r && a.g == b.g && a.b == b.b;
}

// Colour, intensity and shares of a layer whose members are known by uses[i].layer.
static void weigh_members(lx_bake *bake, uint32_t layer_index)
{
    lx_layer *layer = &bake->layers[layer_index];
    lx_rgb color = {0, 0, 0};
    bool first = true, equal = true;
    float strongest = 0, largest = 0, widest = 0;
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        if (bake->uses[i].layer != (int32_t)layer_index) continue;
        const lx_source *s = lx_tracer_source(bake->tracer, i);
        if (first) color = full_color(s);
        equal &= same_color(color, full_color(s));
        first = false;
        strongest = fmaxf(strongest, s->intensity);
        widest = fmaxf(widest, s->intensity_scale);
        largest = fmaxf(largest, s->intensity * lx_rgb_max(full_color(s)));
    }
    const lx_rgb shown = equal ? color : lx_rgb_grey(1);
    layer->color[0] = shown.r;
    layer->color[1] = shown.g;
    layer->color[2] = shown.b;
    layer->intensity = equal ? strongest : largest;
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        if (bake->uses[i].layer != (int32_t)layer_index) continue;
        const lx_source *s = lx_tracer_source(bake->tracer, i);
        lx_rgb weight = {1, 1, 1};
        if (equal && strongest > 0) weight = lx_rgb_grey(s->intensity / strongest);
        // All are off: as they would be if one animation turned them up together.
        if (equal && !(strongest > 0) && widest > 0) weight = lx_rgb_grey(s->intensity_scale / widest);
        if (!equal && largest > 0) weight = lx_rgb_scale(full_color(s), s->intensity / largest);
        bake->uses[i].weight = weight;
    }
}

// Members that cannot share a layer: different units, or screens whose cells do not fit.
static lx_result check_members(const lx_bake *bake, uint32_t layer_index, const char *name, lx_error *error)
{
    const lx_source *first = NULL;
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        if (bake->uses[i].layer != (int32_t)layer_index) continue;
        const lx_source *s = lx_tracer_source(bake->tracer, i);
        if (!first) first = s;
        if (strcmp(unit_of(s->kind), unit_of(first->kind)) != 0)
            return lx_fail(error, LX_ERROR_FORMAT,
                           "layer '%s': sources '%s' (%s) and '%s' (%s) have different units; give them two luxel_layer names", name,
                           first->name, unit_of(first->kind), s->name, unit_of(s->kind));
        if (is_monitor(s) != is_monitor(first))
            return lx_fail(error, LX_ERROR_FORMAT,
                           "layer '%s': '%s' is a monitor and '%s' is not; give them two luxel_layer names", name,
                           is_monitor(s) ? s->name : first->name, is_monitor(s) ? first->name : s->name);
        if (s->columns != first->columns || s->rows != first->rows)
            return lx_fail(error, LX_ERROR_FORMAT,
                           "layer '%s': monitors '%s' (%ux%u) and '%s' (%ux%u) have different grids; give them two luxel_layer names", name,
                           first->name, first->columns, first->rows, s->name, s->columns, s->rows);
        const bool same = is_off(s) == is_off(first) && (s->picture == first->picture || !is_monitor(s) ||
                                                         memcmp(s->picture, first->picture, lx_source_cell_count(s) * sizeof *s->picture) == 0);
        if (!same)
            lx_log_warning(bake->scene->context->log,
                           "layer '%s': monitors '%s' and '%s' share their cells but show different pictures; that of '%s' is baked for both",
                           name, first->name, s->name, first->name);
    }
    return LX_OK;
}

// The cells of a monitor whose layer of cell 0 has been weighed: colour, intensity and node are the same but for the picture.
static lx_result add_cells(lx_bake *bake, uint32_t layer_index, const lx_source *monitor, const char *name, lx_error *error)
{
    const lx_layer whole = bake->layers[layer_index];
    for (uint32_t cell = 0; cell < lx_source_cell_count(monitor); ++cell) {
        lx_layer *layer = &bake->layers[layer_index + cell];
        char *wanted = lx_format("%s/%u", name, cell);
        char *unique = wanted ? unique_name(bake, wanted) : NULL;
        lx_free(wanted);
        if (!unique) return lx_fail_memory(error, "layers");
        *layer = whole;
        layer->name = unique;
        layer->monitor = monitor;
        layer->cell = cell;
        layer->white = lx_rgb_of(whole.color[0], whole.color[1], whole.color[2]);
        const lx_rgb shown = is_off(monitor) ? lx_rgb_grey(0) : lx_rgb_mul(layer->white, monitor->picture[cell]);
        layer->color[0] = shown.r;
        layer->color[1] = shown.g;
        layer->color[2] = shown.b;
        bake->layer_count = layer_index + cell + 1;
    }
    return LX_OK;
}

static lx_result add_layer(lx_bake *bake, const grouping *g, uint32_t first, lx_error *error)
{
    const lx_source *s = lx_tracer_source(bake->tracer, first);
    const char *name = g->keys[first] ? g->keys[first] : s->name;
    const uint32_t index = bake->layer_count;
    lx_layer layer = {.kind = s->kind, .node = node_name(bake, s), .unit = unit_of(s->kind), .mode = LX_MODE_BAKED};
    for (uint32_t i = first; i < bake->source_count; ++i) {
        const lx_source *other = lx_tracer_source(bake->tracer, i);
        const bool member = i == first || (g->keys[first] && g->keys[i] && strcmp(g->keys[i], g->keys[first]) == 0);
        if (!member) continue;
        bake->uses[i].layer = (int32_t)index;
        bake->uses[i].direct = other->mode != LX_MODE_MIXED;
        if (other->mode == LX_MODE_MIXED) layer.mode = LX_MODE_MIXED;
        ++layer.source_count;
    }
    const lx_result result = check_members(bake, index, name, error);
    if (result != LX_OK) return result;
    if (!is_monitor(s)) layer.name = unique_name(bake, name);
    if (!is_monitor(s) && !layer.name) return lx_fail_memory(error, "layers");
    bake->layers[index] = layer;
    weigh_members(bake, index);
    if (is_monitor(s)) return add_cells(bake, index, s, name, error);
    ++bake->layer_count;
    return LX_OK;
}

static lx_result build_combined(lx_bake *bake, lx_error *error)
{
    bake->layers = lx_calloc_array(1, sizeof *bake->layers);
    bake->uses = lx_uses_combined(bake->tracer);
    if (!bake->layers || !bake->uses) return lx_fail_memory(error, "layers");
    lx_layer *layer = &bake->layers[0];
    *layer = (lx_layer){.name = lx_strdup("combined"), .kind = LX_SOURCE_SKY, .node = "", .unit = "lx", .mode = LX_MODE_BAKED,
                        .color = {1, 1, 1}, .intensity = 1, .source_count = bake->source_count};
    bake->layer_count = 1;
    return layer->name ? LX_OK : lx_fail_memory(error, "layers");
}

lx_result lx_layers_build(lx_bake *bake, lx_error *error)
{
    lx_result result = LX_OK;
    grouping g = {.count = lx_tracer_source_count(bake->tracer)};
    bake->source_count = g.count;
    if (g.count == 0)
        lx_log_warning(bake->scene->context->log, "nothing shines, the lightmap will be black: add lights "
                       "(KHR_lights_punctual), emissive materials or a sky (--sky 1,1,1)");
    if (bake->desc.combined) return build_combined(bake, error);
    size_t most_layers = 0; // without any groups
    for (uint32_t i = 0; i < g.count; ++i) most_layers += lx_tracer_cell_count(bake->tracer, i);
    bake->layers = lx_calloc_array(most_layers, sizeof *bake->layers);
    bake->uses = lx_calloc_array(g.count, sizeof *bake->uses);
    g.keys = lx_calloc_array(g.count, sizeof *g.keys);
    if (!bake->layers || !bake->uses || !g.keys) {
        result = lx_fail_memory(error, "layers");
        goto cleanup;
    }
    for (uint32_t i = 0; i < g.count; ++i) {
        bake->uses[i].layer = -1;
        const char *name = lx_tracer_source(bake->tracer, i)->layer;
        if (name) LX_TRY(set_key(&g, i, lx_strdup(name), error));
    }
    LX_TRY(group_further(bake, &g, error));
    for (uint32_t i = 0; i < g.count; ++i)
        if (bake->uses[i].layer < 0) LX_TRY(add_layer(bake, &g, i, error));
cleanup:
    for (uint32_t i = 0; g.keys && i < g.count; ++i) lx_free(g.keys[i]);
    lx_free(g.keys);
    return result;
}

void lx_layers_check(const lx_bake *bake, lx_path_batch *batch, const lx_receiver *points, uint32_t count)
{
    enum { samples = 4 };
    lx_source_use *combined = lx_uses_combined(bake->tracer);
    double *sums = lx_calloc_array(bake->layer_count, 3 * sizeof *sums);
    double worst = 0;
    for (uint32_t i = 0; combined && i < bake->source_count; ++i) { // monitors that share cells show the picture of the first
        if (!combined[i].cells) continue;
        const lx_layer *layer = &bake->layers[bake->uses[i].layer];
        combined[i].cells = layer->monitor->picture;
        combined[i].weight = is_off(layer->monitor) ? lx_rgb_grey(0)
                                                    : lx_rgb_scale(lx_rgb_mul(bake->uses[i].weight, layer->white), layer->intensity);
    }
    lx_path_settings settings = {.tracer = bake->tracer, .bounces = bake->desc.transport.bounces, .direct = true, .indirect = true};
    for (uint32_t i = 0; combined && sums && i < count; ++i) {
        lx_path_start starts[samples];
        for (uint32_t k = 0; k < samples; ++k)
            starts[k] = (lx_path_start){.receiver = points[i], .weight = {1, 1, 1}, .stream = lx_stream_key(i, 0x636865u, 0), .sample = k};
        memset(sums, 0, 3 * bake->layer_count * sizeof *sums);
        double whole[3] = {0, 0, 0}, sum[3] = {0, 0, 0};
        settings.uses = bake->uses;
        settings.layer_count = bake->layer_count;
        lx_path_trace(batch, &settings, starts, samples, sums, NULL);
        settings.uses = combined;
        settings.layer_count = 1;
        lx_path_trace(batch, &settings, starts, samples, whole, NULL);
        for (uint32_t layer = 0; layer < bake->layer_count; ++layer)
            for (int c = 0; c < 3; ++c)
                sum[c] += sums[3 * layer + (size_t)c] * (double)bake->layers[layer].color[c] * (double)bake->layers[layer].intensity;
        for (int c = 0; c < 3; ++c)
            if (whole[c] > 0) worst = fmax(worst, fabs(sum[c] / whole[c] - 1));
    }
    if (worst > 1e-5)
        lx_log_warning(bake->scene->context->log, "the sum of layers differs from the combined light by %.2g: please report this scene", worst);
    lx_free(combined);
    lx_free(sums);
}

void lx_layers_release(lx_bake *bake)
{
    for (uint32_t i = 0; i < bake->layer_count; ++i) lx_free(bake->layers[i].name);
    lx_free(bake->layers);
    lx_free(bake->uses);
    bake->layers = NULL;
    bake->uses = NULL;
    bake->layer_count = 0;
}
