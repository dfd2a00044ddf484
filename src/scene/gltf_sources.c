// Sources: what light comes from, under the names that people call it by.
#include "scene/gltf_reader.h"
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
    uint32_t count;
} emitters;

static void collect_emitters(const lx_scene *scene, uint32_t first_instance, uint32_t end_instance, emitters *out)
{
    const uint32_t mark = scene->instances[first_instance].node + 1;
    out->count = 0;
    for (uint32_t i = first_instance; i < end_instance; ++i) {
        const lx_instance *instance = &scene->instances[i];
        for (uint32_t s = 0; s < scene->meshes[instance->mesh].primitive_count; ++s) {
            const uint32_t material = scene->surfaces[instance->first_surface + s].material;
            if (!lx_material_emits(&scene->materials[material]) || out->seen_on[material] == mark) continue;
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

static void link_surfaces(lx_scene *scene, uint32_t first_instance, uint32_t end_instance, const int32_t *source)
{
    for (uint32_t i = first_instance; i < end_instance; ++i) {
        const lx_instance *instance = &scene->instances[i];
        for (uint32_t s = 0; s < scene->meshes[instance->mesh].primitive_count; ++s) {
            lx_surface *surface = &scene->surfaces[instance->first_surface + s];
            if (lx_material_emits(&scene->materials[surface->material])) surface->source = source[surface->material];
        }
    }
}

static lx_result add_emitters(source_list *list, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = list->reader->scene;
    emitters found = {
        .materials = lx_malloc_array(scene->material_count, sizeof *found.materials),
        .source = lx_malloc_array(scene->material_count, sizeof *found.source),
        .seen_on = lx_calloc_array(scene->material_count, sizeof *found.seen_on),
    };
    if (!found.materials || !found.source || !found.seen_on) {
        result = lx_fail_memory(error, "sources");
        goto cleanup;
    }
    for (uint32_t first = 0, end; first < scene->instance_count; first = end) {
        end = first + 1; // the instances of one node lie side by side
        while (end < scene->instance_count && scene->instances[end].node == scene->instances[first].node) ++end;
        collect_emitters(scene, first, end, &found);
        for (uint32_t i = 0; i < found.count; ++i)
            LX_TRY(add_emitter(list, &scene->instances[first], found.materials[i], found.count > 1,
                               &found.source[found.materials[i]], error));
        link_surfaces(scene, first, end, found.source);
    }
cleanup:
    lx_free(found.materials);
    lx_free(found.source);
    lx_free(found.seen_on);
    return result;
}

lx_result lx_gltf_load_sources(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    source_list list = {.reader = reader};
    LX_TRY(add_lights(&list, error));
    LX_TRY(add_emitters(&list, error));
    if (list.renamed > 0)
        lx_log_warning(reader->log,
                       "node %u: shares its name with another light and is called '%.80s' (%u such lights in all)",
                       list.first_renamed_node, list.first_renamed, list.renamed);
cleanup:
    lx_name_set_release(&list.names);
    return result;
}
