// Sources: what light comes from, under the names that people call it by.
#include "scene/gltf_reader.h"
#include "scene/monitor.h"
#include "scene/names.h"

#include "base/error.h"

#include <string.h>

typedef struct source_list {
    lx_gltf_reader *reader;
    lx_name_set names;
    size_t capacity;
    uint32_t candidates; ///< Lights and emitters met, realtime ones too: the number in light_K.
    uint32_t renamed;
    const char *first_renamed;
    uint32_t first_renamed_node;
} source_list;

static lx_result add_source(source_list *list, const char *name, lx_source source, lx_error *error)
{
    lx_scene *scene = list->reader->scene;
    if (!lx_array_reserve(&scene->sources, &list->capacity, (size_t)scene->source_count + 1, sizeof *scene->sources))
        return lx_fail_memory(error, "sources");
    source.name = lx_name_set_add(&list->names, &scene->strings, name);
    if (!source.name) return lx_fail_memory(error, "sources");
    source.parent_node = list->reader->nodes[source.node].parent;
    if (strcmp(source.name, name) != 0 && list->renamed++ == 0) {
        list->first_renamed = source.name;
        list->first_renamed_node = source.node;
    }
    scene->sources[scene->source_count++] = source;
    return LX_OK;
}

static lx_source_kind kind_of_light(lx_light_kind kind)
{
    static const lx_source_kind kinds[] = {
        [LX_LIGHT_POINT] = LX_SOURCE_POINT,
        [LX_LIGHT_SPOT] = LX_SOURCE_SPOT,
        [LX_LIGHT_DIRECTIONAL] = LX_SOURCE_DIRECTIONAL,
        [LX_LIGHT_RECT] = LX_SOURCE_RECT,
        [LX_LIGHT_DISK] = LX_SOURCE_DISK,
    };
    return kinds[kind];
}

static lx_result add_lights(source_list *list, lx_error *error)
{
    const lx_scene *scene = list->reader->scene;
    for (uint32_t i = 0; i < scene->light_count; ++i) {
        const lx_light *light = &scene->lights[i];
        const lx_gltf_light_use *use = &list->reader->light_uses[i];
        ++list->candidates;
        if (use->realtime) continue;
        const lx_source source = {
            .kind = kind_of_light(light->kind),
            .layer = use->extras.layer,
            .mode = use->extras.mode >= 0 ? (lx_light_mode)use->extras.mode : LX_MODE_BAKED,
            .light = (int32_t)i,
            .file_light = light->file_index,
            .color_scale = 1,
            .intensity_scale = light->intensity_scale,
            .animate = use->extras.animate,
            .node = light->node,
            .material = -1,
            .color = light->color,
            .intensity = light->intensity,
        };
        const lx_result result = add_source(list, light->name, source, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

// The node's own name; NULL if it has none. (An instance without one is named after its mesh, which several may share.)
static const char *node_name(const lx_gltf_reader *reader, uint32_t node)
{
    const char *name = json_string_value(json_object_get(json_array_get(reader->elements[LX_GLTF_NODE], node), "name"));
    return name && name[0] ? name : NULL;
}

// The name of `material` on `node`: the node's, with the material's when others on the node emit too.
static char *emitter_name(const source_list *list, uint32_t node, uint32_t material_index, bool several)
{
    const lx_material *material = &list->reader->scene->materials[material_index];
    const char *name = node_name(list->reader, node);
    if (!name) return lx_format("light_%u", list->candidates);
    if (!several) return lx_strdup(name);
    if (material->name[0]) return lx_format("%s/%s", name, material->name);
    return lx_format("%s/material_%d", name, material->file_index);
}

// Scratch: the emissive materials of one node, in the order of its surfaces.
typedef struct emitters {
    uint32_t *materials; ///< [material_count]
    int32_t *source;     ///< [material_count]: the source of a material on the node at hand.
    uint32_t *seen_on;   ///< [material_count]: node + 1 on which the material was last met.
    int32_t *monitor;    ///< [material_count]: the last monitor made of it; -1: none.
    uint32_t count;
} emitters;

// Does a node's luxel_monitor make screens of all it has, also where nothing emits? Where all its primitives have one material, which can
// only be the screen's. Else only what emits is a screen.
static bool is_all_screen(const lx_scene *scene, const lx_gltf_node *node, const lx_instance *instance)
{
    if (node->extras.monitor_columns == 0) return false;
    const uint32_t count = scene->meshes[instance->mesh].primitive_count;
    for (uint32_t s = 1; s < count; ++s)
        if (scene->surfaces[instance->first_surface + s].material != scene->surfaces[instance->first_surface].material) return false;
    return true;
}

// A monitor's material shines whatever its factor says: the picture decides.
static bool can_shine(const lx_material *material, bool all_screen)
{
    return lx_material_emits(material) || ((material->monitor_columns > 0 || all_screen) && !material->unlit);
}

static void collect_emitters(const lx_gltf_reader *reader, uint32_t first_instance, uint32_t end_instance, emitters *out)
{
    const lx_scene *scene = reader->scene;
    const uint32_t node = scene->instances[first_instance].node, mark = node + 1;
    const bool all_screen = is_all_screen(scene, &reader->nodes[node], &scene->instances[first_instance]);
    out->count = 0;
    for (uint32_t i = first_instance; i < end_instance; ++i) {
        const lx_instance *instance = &scene->instances[i];
        for (uint32_t s = 0; s < scene->meshes[instance->mesh].primitive_count; ++s) {
            const uint32_t material = scene->surfaces[instance->first_surface + s].material;
            if (!can_shine(&scene->materials[material], all_screen) || out->seen_on[material] == mark) continue;
            out->seen_on[material] = mark;
            out->source[material] = -1;
            out->materials[out->count++] = material;
        }
    }
}

// Mode by node, then material. Emitters that move, or are not static, are left to real-time light.
static lx_light_mode emitter_mode(const lx_gltf_node *node, const lx_instance *instance, const lx_material *material)
{
    if (!instance->is_static) return LX_MODE_REALTIME;
    return node->extras.mode >= 0 ? (lx_light_mode)node->extras.mode : material->mode;
}

static lx_result add_emitter(source_list *list, const lx_instance *instance, uint32_t material_index, bool several,
                             int32_t *source_index, lx_error *error)
{
    const lx_scene *scene = list->reader->scene;
    const lx_material *material = &scene->materials[material_index];
    const lx_gltf_node *node = &list->reader->nodes[instance->node];
    const lx_light_mode mode = emitter_mode(node, instance, material);
    char *name = emitter_name(list, instance->node, material_index, several);
    if (!name) return lx_fail_memory(error, "sources");
    ++list->candidates;
    lx_result result = LX_OK;
    if (mode != LX_MODE_REALTIME) {
        *source_index = (int32_t)scene->source_count;
        const lx_source source = {
            .kind = LX_SOURCE_EMISSIVE,
            .layer = node->extras.layer ? node->extras.layer : material->layer,
            .mode = mode,
            .light = -1,
            .file_light = -1,
            .color_scale = material->factor_scale,
            .intensity_scale = material->strength_scale,
            .animate = node->extras.animate ? node->extras.animate : material->animate,
            .node = instance->node,
            .material = (int32_t)material_index,
            .color = material->emissive_factor,
            .intensity = material->emissive_strength,
        };
        result = add_source(list, name, source, error);
    }
    lx_free(name);
    return result;
}

static void link_surfaces(lx_scene *scene, uint32_t first_instance, uint32_t end_instance, const emitters *found)
{
    const uint32_t mark = scene->instances[first_instance].node + 1;
    for (uint32_t i = first_instance; i < end_instance; ++i) {
        const lx_instance *instance = &scene->instances[i];
        for (uint32_t s = 0; s < scene->meshes[instance->mesh].primitive_count; ++s) {
            lx_surface *surface = &scene->surfaces[instance->first_surface + s];
            if (found->seen_on[surface->material] == mark) surface->source = found->source[surface->material];
        }
    }
}

// ---- monitors

static bool has_monitor_coordinates(const lx_scene *scene, uint32_t source, uint32_t first_instance, uint32_t end_instance, bool *leave)
{
    *leave = false;
    for (uint32_t i = first_instance; i < end_instance; ++i)
        for (uint32_t s = 0; s < scene->meshes[scene->instances[i].mesh].primitive_count; ++s) {
            const lx_surface *surface = &scene->surfaces[scene->instances[i].first_surface + s];
            const lx_primitive *p = &scene->primitives[surface->primitive];
            if (surface->source != (int32_t)source) continue;
            if (!p->texcoords[0]) return false;
            const float slack = 1e-3f; // halves and bytes of quantised coordinates
            for (size_t k = 0; k < 3 * (size_t)p->triangle_count; ++k) {
                const lx_vec2 uv = p->texcoords[0][p->indices[k]];
                *leave |= uv.x < -slack || uv.x > 1 + slack || uv.y < -slack || uv.y > 1 + slack;
            }
        }
    return true;
}

// Monitors of one material and grid show one picture, unless another set of coordinates maps it. So it is averaged once.
static const lx_rgb *known_picture(const lx_scene *scene, const lx_source *source, int32_t other_index)
{
    if (other_index < 0 || scene->materials[source->material].emissive_texture.texcoord != 0) return NULL;
    const lx_source *other = &scene->sources[other_index];
    return other->columns == source->columns && other->rows == source->rows ? other->picture : NULL;
}

static lx_result take_picture(lx_gltf_reader *reader, uint32_t index, int32_t *last, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    lx_source *source = &scene->sources[index];
    const uint32_t cells = lx_source_cell_count(source);
    source->picture = known_picture(scene, source, *last);
    *last = (int32_t)index;
    if (source->picture) return LX_OK;
    LX_TRY(lx_gltf_charge(reader, cells, sizeof(lx_rgb), source->name, error));
    lx_rgb *picture = lx_arena_alloc(&scene->strings, cells, sizeof *picture);
    if (!picture) return lx_fail_memory(error, "monitors");
    source->picture = picture;
    LX_TRY(lx_monitor_average(scene, index, picture, error));
cleanup:
    return result;
}

// Gives a source its grid of cells if its node or material has one.
static lx_result make_monitor(lx_gltf_reader *reader, uint32_t index, uint32_t first_instance, uint32_t end_instance,
                              const emitters *found, lx_error *error)
{
    lx_scene *scene = reader->scene;
    lx_source *source = &scene->sources[index];
    const lx_material *material = &scene->materials[source->material];
    const lx_gltf_node *node = &reader->nodes[source->node];
    const bool by_node = node->extras.monitor_columns > 0;
    if (!by_node && material->monitor_columns == 0) return LX_OK;
    if (by_node) reader->nodes[node->monitor_owner].monitor_taken = true;
    bool leave;
    if (!has_monitor_coordinates(scene, index, first_instance, end_instance, &leave)) {
        lx_log_warning(reader->log, "monitor '%s': its mesh has no TEXCOORD_0, which tells where the cells are; luxel_monitor ignored",
                       source->name);
        return LX_OK;
    }
    if (leave)
        lx_log_warning(reader->log, "monitor '%s': its TEXCOORD_0 leaves 0 to 1; what lies outside belongs to the outermost cells",
                       source->name);
    source->columns = by_node ? node->extras.monitor_columns : material->monitor_columns;
    source->rows = by_node ? node->extras.monitor_rows : material->monitor_rows;
    source->white = lx_rgb_is_black(source->color) ? lx_rgb_grey(1) : source->color;
    const bool is_off = lx_rgb_is_black(source->color) || !(source->intensity > 0);
    if (!(source->intensity > 0)) source->intensity = 1;
    if (is_off) {
        source->color = lx_rgb_grey(0);
        lx_log_note(reader->log, "monitor '%s': its emissive factor or strength is 0, so it is off; a white pixel will be %g nit", source->name,
                    (double)(source->intensity * lx_rgb_max(source->white)));
    }
    return take_picture(reader, index, &found->monitor[source->material], error);
}

// A luxel_monitor that made no screen of anything: what it stands on does not emit, moves, or is left to real-time light.
static lx_result warn_of_idle_monitors(lx_gltf_reader *reader, lx_error *error)
{
    const lx_scene *scene = reader->scene;
    lx_gltf_object object;
    for (uint32_t i = 0; i < reader->order_count; ++i) {
        const lx_gltf_node *node = &reader->nodes[reader->order[i]];
        if (node->monitor_owner != (int32_t)reader->order[i] || node->monitor_taken) continue;
        const lx_result found = lx_gltf_element(reader, LX_GLTF_NODE, reader->order[i], &object, error);
        if (found != LX_OK) return found;
        lx_log_warning(reader->log, "%s: luxel_monitor has no effect: nothing static here emits light", object.label);
    }
    enum { used = 1, taken = 2 };
    uint8_t *state = lx_calloc_array(scene->material_count, 1);
    if (!state) return lx_fail_memory(error, "monitors");
    for (uint32_t s = 0; s < scene->surface_count; ++s)
        state[scene->surfaces[s].material] |= scene->surfaces[s].source >= 0 ? used | taken : used;
    lx_result result = LX_OK;
    for (uint32_t m = 0; m < scene->material_count && result == LX_OK; ++m) {
        const lx_material *material = &scene->materials[m];
        if (material->monitor_columns == 0 || material->file_index < 0 || state[m] != used) continue;
        result = lx_gltf_element(reader, LX_GLTF_MATERIAL, (uint32_t)material->file_index, &object, error);
        if (result != LX_OK) break;
        lx_log_warning(reader->log, "%s: luxel_monitor has no effect: what has this material %s", object.label,
                       material->unlit ? "is unlit and emits no light" : "moves or is left to real-time light");
    }
    lx_free(state);
    return result;
}

static lx_result add_emitters(source_list *list, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = list->reader->scene;
    emitters found = {
        .materials = lx_malloc_array(scene->material_count, sizeof *found.materials),
        .source = lx_malloc_array(scene->material_count, sizeof *found.source),
        .seen_on = lx_calloc_array(scene->material_count, sizeof *found.seen_on),
        .monitor = lx_malloc_array(scene->material_count, sizeof *found.monitor),
    };
    if (!found.materials || !found.source || !found.seen_on || !found.monitor) {
        result = lx_fail_memory(error, "sources");
        goto cleanup;
    }
    memset(found.monitor, 0xff, scene->material_count * sizeof *found.monitor);
    for (uint32_t first = 0, end; first < scene->instance_count; first = end) {
        end = first + 1; // the instances of one node lie side by side
        while (end < scene->instance_count && scene->instances[end].node == scene->instances[first].node) ++end;
        const uint32_t first_source = scene->source_count;
        collect_emitters(list->reader, first, end, &found);
        for (uint32_t i = 0; i < found.count; ++i)
            LX_TRY(add_emitter(list, &scene->instances[first], found.materials[i], found.count > 1,
                               &found.source[found.materials[i]], error));
        link_surfaces(scene, first, end, &found);
        for (uint32_t i = first_source; i < scene->source_count; ++i) LX_TRY(make_monitor(list->reader, i, first, end, &found, error));
    }
cleanup:
    lx_free(found.materials);
    lx_free(found.source);
    lx_free(found.seen_on);
    lx_free(found.monitor);
    return result;
}

lx_result lx_gltf_load_sources(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    source_list list = {.reader = reader};
    LX_TRY(add_lights(&list, error));
    LX_TRY(add_emitters(&list, error));
    LX_TRY(warn_of_idle_monitors(reader, error));
    if (list.renamed > 0)
        lx_log_warning(reader->log,
                       "node %u: shares its name with another light and is called '%.80s' (%u such lights in all)",
                       list.first_renamed_node, list.first_renamed, list.renamed);
cleanup:
    lx_name_set_release(&list.names);
    return result;
}
