// What readers of the baked file need beside coordinates: rectangles on nodes and instances, and marks on lights and
// materials that are in the lightmap. Marks of an earlier bake are removed first.
#include "scene/gltf_export_private.h"

#include <string.h>

static const char rect_key[] = "luxel_lightmap";
static const char baked_key[] = "luxel_baked";
static const char instancing_name[] = "EXT_mesh_gpu_instancing";
static const char rect_attribute[] = "_LUXEL_RECT";
static const char page_attribute[] = "_LUXEL_PAGE";

static void drop_marks(json_t *object)
{
    json_t *extras = json_object_get(object, "extras");
    const bool had_rect = json_object_del(extras, rect_key) == 0;
    const bool had_baked = json_object_del(extras, baked_key) == 0;
    if ((had_rect || had_baked) && json_object_size(extras) == 0) json_object_del(object, "extras");
}

static void drop_earlier_bake(lx_exporter *exporter)
{
    size_t i;
    json_t *item;
    json_array_foreach(json_object_get(exporter->document, "nodes"), i, item)
    {
        json_t *attributes = json_object_get(lx_export_extension(item, instancing_name), "attributes");
        json_object_del(attributes, rect_attribute);
        json_object_del(attributes, page_attribute);
        drop_marks(item);
    }
    json_array_foreach(json_object_get(exporter->document, "materials"), i, item) drop_marks(item);
}

// The extras of `object` as something that takes members: extras of another type move into the member "value".
static lx_result open_extras(json_t *object, json_t **out, lx_error *error)
{
    json_t *extras = json_object_get(object, "extras");
    if (extras && !json_is_object(extras)) {
        json_t *wrapped = json_pack("{sO}", "value", extras);
        if (!wrapped || json_object_set_new(object, "extras", wrapped) != 0) return lx_fail_memory(error, "extras");
    }
    *out = lx_export_object_in(object, "extras");
    return *out ? LX_OK : lx_fail_memory(error, "extras");
}

static lx_result set_extra(json_t *object, const char *key, json_t *value, lx_error *error)
{
    json_t *extras;
    const lx_result result = open_extras(object, &extras, error);
    if (result == LX_OK) return lx_export_set(extras, key, value, error);
    json_decref(value);
    return result;
}

static json_t *node_of(const lx_exporter *exporter, uint32_t node)
{
    return json_array_get(json_object_get(exporter->document, "nodes"), node);
}

static lx_result export_rect(lx_exporter *exporter, uint32_t instance_index, lx_error *error)
{
    const lx_instance *instance = &exporter->scene->instances[instance_index];
    const lx_atlas_rect *rect = &exporter->atlas->rects[instance_index];
    json_t *value = json_pack("{sIsIs[ff]s[ff]}", "page", (json_int_t)rect->page, "texCoord",
                              (json_int_t)exporter->atlas->meshes[instance->mesh].texcoord, "scale", (double)rect->scale[0],
                              (double)rect->scale[1], "offset", (double)rect->offset[0], (double)rect->offset[1]);
    return set_extra(node_of(exporter, instance->node), rect_key, value, error);
}

// ---- EXT_mesh_gpu_instancing: a rectangle for each of a node's instances

// How many instances the node has: all attributes of the extension have this count.
static size_t instance_count_of(const lx_exporter *exporter, const json_t *attributes)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)attributes, key, value)
    {
        const uint32_t accessor = lx_export_get_index(attributes, key, LX_EXPORT_NONE);
        return lx_export_get_size(json_array_get(exporter->accessors, accessor), "count");
    }
    return 0;
}

static lx_result set_instance_attribute(lx_exporter *exporter, json_t *attributes, const char *key, const float *values,
                                        uint32_t width, size_t count, lx_error *error)
{
    uint32_t accessor;
    const lx_result result = lx_export_add_floats(exporter, values, width, count, 0, &accessor, error);
    return result == LX_OK ? lx_export_set(attributes, key, json_integer(accessor), error) : result;
}

// Instances `first` and following up to the first of another node. Those without a rectangle get page -1.
static lx_result export_instanced_node(lx_exporter *exporter, uint32_t first, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_instance *instances = exporter->scene->instances;
    json_t *node = node_of(exporter, instances[first].node);
    json_t *attributes = json_object_get(lx_export_extension(node, instancing_name), "attributes");
    const size_t count = instance_count_of(exporter, attributes);
    float *rects = lx_calloc_array(count, 4 * sizeof *rects), *pages = lx_malloc_array(count, sizeof *pages);
    bool used = false;
    if (!rects || !pages) {
        result = lx_fail_memory(error, "instances");
        goto cleanup;
    }
    for (size_t i = 0; i < count; ++i) pages[i] = -1;
    for (uint32_t i = first; i < exporter->scene->instance_count && instances[i].node == instances[first].node; ++i) {
        const lx_atlas_rect *rect = &exporter->atlas->rects[i];
        if (!rect->used || instances[i].gpu_instance < 0 || (size_t)instances[i].gpu_instance >= count) continue;
        float *out = &rects[4 * (size_t)instances[i].gpu_instance];
        memcpy(out, rect->scale, sizeof rect->scale);
        memcpy(out + 2, rect->offset, sizeof rect->offset);
        pages[instances[i].gpu_instance] = (float)rect->page;
        used = true;
    }
    if (!used) goto cleanup;
    LX_TRY(set_instance_attribute(exporter, attributes, rect_attribute, rects, 4, count, error));
    LX_TRY(set_instance_attribute(exporter, attributes, page_attribute, pages, 1, count, error));
    const json_int_t texcoord = exporter->atlas->meshes[instances[first].mesh].texcoord;
    LX_TRY(set_extra(node, rect_key, json_pack("{sI}", "texCoord", texcoord), error));
cleanup:
    lx_free(rects);
    lx_free(pages);
    return result;
}

static lx_result export_rects(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_instance *instances = exporter->scene->instances;
    for (uint32_t i = 0; i < exporter->scene->instance_count; ++i) {
        const bool first_of_node = i == 0 || instances[i - 1].node != instances[i].node;
        if (instances[i].gpu_instance >= 0 && first_of_node)
            LX_TRY(export_instanced_node(exporter, i, error));
        else if (instances[i].gpu_instance < 0 && exporter->atlas->rects[i].used)
            LX_TRY(export_rect(exporter, i, error));
    }
cleanup:
    return result;
}

// ---- what must not light the scene a second time

// Mixed sources are left unmarked: their direct light is still to be added.
static lx_result mark_sources(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_scene *scene = exporter->scene;
    json_t *materials = json_object_get(exporter->document, "materials");
    for (uint32_t i = 0; i < scene->source_count; ++i) {
        const lx_source *source = &scene->sources[i];
        if (source->mode != LX_MODE_BAKED) continue;
        json_t *object = NULL;
        if (source->light >= 0) object = node_of(exporter, source->node);
        if (source->material >= 0 && scene->materials[source->material].file_index >= 0)
            object = json_array_get(materials, (size_t)scene->materials[source->material].file_index);
        if (object) LX_TRY(set_extra(object, baked_key, json_true(), error));
    }
cleanup:
    return result;
}

static lx_result mark_asset(lx_exporter *exporter, lx_error *error)
{
    json_t *asset = lx_export_object_in(exporter->document, "asset");
    return asset ? set_extra(asset, "luxel", json_string(LX_VERSION), error) : lx_fail_memory(error, "asset");
}

lx_result lx_export_extras(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    drop_earlier_bake(exporter);
    LX_TRY(export_rects(exporter, error));
    LX_TRY(mark_sources(exporter, error));
    LX_TRY(mark_asset(exporter, error));
cleanup:
    return result;
}
