// Where a glTF document keeps indices of accessors and bufferViews: the core specification's places and
// EXT_mesh_gpu_instancing's. (EXT_meshopt_compression is gone by then, KHR_draco_mesh_compression was refused on import.)
#include "scene/gltf_export_private.h"

#include <string.h>

typedef struct visit {
    lx_export_reference func;
    void *user;
    lx_error *error;
} visit;

static lx_result visit_member(const visit *v, json_t *holder, const char *key)
{
    return json_object_get(holder, key) ? v->func(v->user, holder, key, v->error) : LX_OK;
}

static lx_result visit_all_members(const visit *v, json_t *holder)
{
    const char *key;
    json_t *value;
    void *next;
    json_object_foreach_safe(holder, next, key, value)
    {
        const lx_result result = v->func(v->user, holder, key, v->error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static lx_result visit_primitive(const visit *v, json_t *primitive)
{
    lx_result result = LX_OK;
    size_t i;
    json_t *target;
    LX_TRY(visit_all_members(v, json_object_get(primitive, "attributes")));
    LX_TRY(visit_member(v, primitive, "indices"));
    json_array_foreach(json_object_get(primitive, "targets"), i, target) LX_TRY(visit_all_members(v, target));
cleanup:
    return result;
}

static lx_result visit_accessors(const visit *v, json_t *document)
{
    lx_result result = LX_OK;
    size_t i, k;
    json_t *item, *inner;
    json_array_foreach(json_object_get(document, "meshes"), i, item)
        json_array_foreach(json_object_get(item, "primitives"), k, inner) LX_TRY(visit_primitive(v, inner));
    json_array_foreach(json_object_get(document, "skins"), i, item)
        LX_TRY(visit_member(v, item, "inverseBindMatrices"));
    json_array_foreach(json_object_get(document, "animations"), i, item)
    {
        json_array_foreach(json_object_get(item, "samplers"), k, inner)
        {
            LX_TRY(visit_member(v, inner, "input"));
            LX_TRY(visit_member(v, inner, "output"));
        }
    }
    json_array_foreach(json_object_get(document, "nodes"), i, item)
    {
        json_t *instancing = lx_export_extension(item, "EXT_mesh_gpu_instancing");
        LX_TRY(visit_all_members(v, json_object_get(instancing, "attributes")));
    }
cleanup:
    return result;
}

static lx_result visit_accessor_views(const visit *v, json_t *accessor)
{
    lx_result result = LX_OK;
    json_t *sparse = json_object_get(accessor, "sparse");
    LX_TRY(visit_member(v, accessor, "bufferView"));
    LX_TRY(visit_member(v, json_object_get(sparse, "indices"), "bufferView"));
    LX_TRY(visit_member(v, json_object_get(sparse, "values"), "bufferView"));
cleanup:
    return result;
}

static lx_result visit_views(const visit *v, json_t *document)
{
    lx_result result = LX_OK;
    size_t i;
    json_t *item;
    json_array_foreach(json_object_get(document, "accessors"), i, item) LX_TRY(visit_accessor_views(v, item));
    json_array_foreach(json_object_get(document, "images"), i, item) LX_TRY(visit_member(v, item, "bufferView"));
cleanup:
    return result;
}

lx_result lx_export_visit(const lx_exporter *exporter, lx_export_table table, lx_export_reference func, void *user,
                          lx_error *error)
{
    const visit v = {func, user, error};
    return table == LX_EXPORT_ACCESSORS ? visit_accessors(&v, exporter->document) : visit_views(&v, exporter->document);
}

typedef struct marks {
    uint8_t *used;
    size_t count;
} marks;

static lx_result mark_one(void *user, json_t *holder, const char *key, lx_error *error)
{
    (void)error;
    const marks *m = user;
    const uint32_t index = lx_export_get_index(holder, key, LX_EXPORT_NONE);
    if (index < m->count) m->used[index] = 1;
    return LX_OK;
}

lx_result lx_export_mark_accessors(const lx_exporter *exporter, uint8_t *used, size_t count, lx_error *error)
{
    marks m = {used, count};
    return lx_export_visit(exporter, LX_EXPORT_ACCESSORS, mark_one, &m, error);
}

lx_result lx_export_mark_views(const lx_exporter *exporter, const uint8_t *accessor_used, size_t accessor_count,
                               uint8_t *used, size_t count, lx_error *error)
{
    lx_result result = LX_OK;
    marks m = {used, count};
    const visit v = {mark_one, &m, error};
    size_t i;
    json_t *item;
    json_array_foreach(json_object_get(exporter->document, "images"), i, item)
        LX_TRY(visit_member(&v, item, "bufferView"));
    json_array_foreach(json_object_get(exporter->document, "accessors"), i, item)
        if (i < accessor_count && accessor_used[i]) LX_TRY(visit_accessor_views(&v, item));
cleanup:
    return result;
}

// Extensions known to hold no indices of accessors or bufferViews, or only where lx_export_visit looks. A '*' ends a prefix.
static const char *const known_extensions[] = {
    "KHR_materials_*",         "KHR_texture_*",        "KHR_lights_punctual",  "KHR_mesh_quantization",
    "KHR_xmp*",                "KHR_animation_pointer", "KHR_node_*",          "EXT_texture_*",
    "EXT_lights_image_based",  "MSFT_texture_dds",     "MSFT_lod",             "MSFT_packing_*",
    "EXT_mesh_gpu_instancing", "EXT_meshopt_compression",
};

static bool is_known_extension(const char *name)
{
    for (size_t i = 0; i < sizeof known_extensions / sizeof *known_extensions; ++i) {
        const char *known = known_extensions[i];
        const size_t length = strlen(known);
        if (known[length - 1] == '*' ? strncmp(name, known, length - 1) == 0 : strcmp(name, known) == 0) return true;
    }
    return false;
}

static bool has_whole_number(const json_t *value)
{
    const char *key;
    json_t *child;
    size_t i;
    if (json_is_integer(value)) return json_integer_value(value) >= 0;
    json_array_foreach(value, i, child)
        if (has_whole_number(child)) return true;
    json_object_foreach((json_t *)value, key, child)
        if (has_whole_number(child)) return true;
    return false;
}

bool lx_export_has_unknown_references(const json_t *value)
{
    const char *key, *name;
    json_t *child, *extension;
    size_t i;
    json_array_foreach(value, i, child)
        if (lx_export_has_unknown_references(child)) return true;
    json_object_foreach((json_t *)value, key, child)
    {
        if (strcmp(key, "extras") == 0) continue;
        if (strcmp(key, "extensions") == 0)
            json_object_foreach(child, name, extension)
                if (!is_known_extension(name) && has_whole_number(extension)) return true;
        if (lx_export_has_unknown_references(child)) return true;
    }
    return false;
}
