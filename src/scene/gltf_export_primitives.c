// Lightmap coordinates as TEXCOORD_n of every lit primitive.
//
// Where no vertex needs two coordinates, the primitive only gains an accessor, and primitives over one set of vertices share
// it as long as they agree ("layer"). Where some do, the primitive gets vertices of its own (gltf_export_reindex.c).
#include "scene/gltf_export_private.h"

#include <stdio.h>
#include <string.h>

// Coordinates for all vertices of one POSITION accessor, as primitives that were not split want them.
typedef struct layer {
    uint32_t position;
    uint32_t next;     // another one for the same vertices
    uint32_t accessor; // once written
    lx_export_weld weld;
} layer;

typedef struct pending { // a primitive that waits for its layer's accessor
    json_t *attributes;
    char semantic[24];
    uint32_t layer;
} pending;

typedef struct primitives {
    lx_exporter *exporter;
    layer *layers;
    pending *pendings;
    uint32_t *first_layer;  // [input_accessor_count]
    uint8_t *mesh_taken;    // per mesh of the file: it has its coordinates
    size_t layer_count, layer_capacity, pending_count, pending_capacity;
} primitives;

static bool layers_agree(const lx_export_weld *a, const lx_export_weld *b)
{
    if (a->count != b->count) return false;
    for (uint32_t i = 0; i < a->count; ++i)
        if (a->used[i] && b->used[i] && memcmp(&a->uv[i], &b->uv[i], sizeof a->uv[i]) != 0) return false;
    return true;
}

static void merge_layer(lx_export_weld *into, const lx_export_weld *from)
{
    for (uint32_t i = 0; i < into->count; ++i) {
        if (!from->used[i]) continue;
        into->uv[i] = from->uv[i];
        into->used[i] = 1;
    }
}

// Finds a layer that `weld` (taken then) fits into, or makes one.
static lx_result place_in_layer(primitives *p, uint32_t position, lx_export_weld *weld, uint32_t *out, lx_error *error)
{
    for (uint32_t i = p->first_layer[position]; i != LX_EXPORT_NONE; i = p->layers[i].next) {
        if (!layers_agree(&p->layers[i].weld, weld)) continue;
        merge_layer(&p->layers[i].weld, weld);
        lx_export_weld_release(weld);
        *out = i;
        return LX_OK;
    }
    if (!lx_array_reserve(&p->layers, &p->layer_capacity, p->layer_count + 1, sizeof *p->layers))
        return lx_fail_memory(error, "lightmap coordinates");
    *out = (uint32_t)p->layer_count++;
    p->layers[*out] = (layer){position, p->first_layer[position], LX_EXPORT_NONE, *weld};
    p->first_layer[position] = *out;
    *weld = (lx_export_weld){0};
    return LX_OK;
}

static lx_result export_unsplit(primitives *p, json_t *attributes, const char *semantic, lx_export_weld *weld,
                                lx_error *error)
{
    const uint32_t position = lx_export_get_index(attributes, "POSITION", LX_EXPORT_NONE);
    pending next = {.attributes = attributes};
    if (position >= p->exporter->input_accessor_count)
        return lx_fail(error, LX_ERROR_FORMAT, "accessor %u does not exist", position);
    const lx_result result = place_in_layer(p, position, weld, &next.layer, error);
    if (result != LX_OK) return result;
    if (!lx_array_reserve(&p->pendings, &p->pending_capacity, p->pending_count + 1, sizeof *p->pendings))
        return lx_fail_memory(error, "lightmap coordinates");
    snprintf(next.semantic, sizeof next.semantic, "%s", semantic);
    p->pendings[p->pending_count++] = next;
    return LX_OK;
}

static lx_result export_split(primitives *p, json_t *primitive, const char *semantic, const lx_export_weld *weld,
                              uint32_t triangle_count, lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t accessor;
    LX_TRY(lx_export_reindex(p->exporter, primitive, weld, triangle_count, semantic, error));
    LX_TRY(lx_export_add_floats(p->exporter, &weld->uv[0].x, 2, weld->count, lx_gltf_array_buffer, &accessor, error));
    LX_TRY(lx_export_set(json_object_get(primitive, "attributes"), semantic, json_integer(accessor), error));
cleanup:
    return result;
}

// Texture coordinate sets must be numbered without gaps: what is missing below set `count` becomes zeros.
static lx_result fill_lower_sets(lx_exporter *exporter, json_t *attributes, uint32_t count, uint32_t vertex_count,
                                 lx_error *error)
{
    lx_result result = LX_OK;
    for (uint32_t set = 0; set < count; ++set) {
        char semantic[24];
        uint32_t view, accessor;
        snprintf(semantic, sizeof semantic, "TEXCOORD_%u", set);
        if (json_object_get(attributes, semantic)) continue;
        lx_bytes bytes = {lx_calloc_array(vertex_count, 4), (size_t)vertex_count * 4}; // two bytes and padding
        if (!bytes.data) return lx_fail_memory(error, "texture coordinates");
        LX_TRY(lx_export_add_view(exporter, &bytes, lx_gltf_array_buffer, 4, &view, error));
        json_t *object = json_pack("{sisbsIss}", "componentType", lx_gltf_u8, "normalized", 1, "count",
                                   (json_int_t)vertex_count, "type", "VEC2");
        if (!object) return lx_fail_memory(error, "accessor");
        LX_TRY(lx_export_add_accessor(exporter, object, view, &accessor, error));
        LX_TRY(lx_export_set(attributes, semantic, json_integer(accessor), error));
    }
cleanup:
    return result;
}

static lx_result export_primitive(primitives *p, uint32_t index, json_t *primitive, uint32_t texcoord, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_primitive *source = &p->exporter->scene->primitives[index];
    json_t *attributes = json_object_get(primitive, "attributes");
    lx_export_weld weld = {0};
    char semantic[24];
    snprintf(semantic, sizeof semantic, "TEXCOORD_%u", texcoord);
    LX_TRY(lx_export_weld_corners(source, p->exporter->atlas->primitives[index].corner_uv, &weld, error));
    const uint32_t vertex_count = weld.count;
    if (weld.split)
        LX_TRY(export_split(p, primitive, semantic, &weld, source->triangle_count, error));
    else
        LX_TRY(export_unsplit(p, attributes, semantic, &weld, error));
    LX_TRY(fill_lower_sets(p->exporter, attributes, texcoord, vertex_count, error));
cleanup:
    lx_export_weld_release(&weld);
    return result;
}

static bool needs_coordinates(const lx_exporter *exporter, uint32_t mesh_index)
{
    const lx_mesh *mesh = &exporter->scene->meshes[mesh_index];
    if (exporter->atlas->meshes[mesh_index].existing) return false;
    for (uint32_t i = 0; i < mesh->primitive_count; ++i)
        if (exporter->atlas->primitives[mesh->first_primitive + i].corner_uv) return true;
    return false;
}

// A mesh of the file that occurs with several sets of morph weights is several meshes to us, each with its own coordinates:
// the second and later ones become copies in the file, over the same data where nothing is split.
static lx_result mesh_for(primitives *p, uint32_t mesh_index, json_t **out, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_scene *scene = p->exporter->scene;
    const uint32_t file_index = scene->meshes[mesh_index].file_index;
    json_t *meshes = json_object_get(p->exporter->document, "meshes");
    json_t *nodes = json_object_get(p->exporter->document, "nodes");
    *out = json_array_get(meshes, file_index);
    if (!p->mesh_taken[file_index]) {
        p->mesh_taken[file_index] = 1;
        return LX_OK;
    }
    const size_t copy_index = json_array_size(meshes);
    *out = json_deep_copy(json_array_get(json_object_get(scene->document, "meshes"), file_index));
    LX_TRY(lx_export_append(meshes, *out, error));
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        if (scene->instances[i].mesh != mesh_index) continue;
        json_t *node = json_array_get(nodes, scene->instances[i].node);
        LX_TRY(lx_export_set(node, "mesh", json_integer((json_int_t)copy_index), error));
    }
cleanup:
    return result;
}

static lx_result export_mesh(primitives *p, uint32_t mesh_index, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_mesh *mesh = &p->exporter->scene->meshes[mesh_index];
    const uint32_t texcoord = p->exporter->atlas->meshes[mesh_index].texcoord;
    json_t *object;
    LX_TRY(mesh_for(p, mesh_index, &object, error));
    for (uint32_t i = mesh->first_primitive; i < mesh->first_primitive + mesh->primitive_count; ++i) {
        const uint32_t file_primitive = p->exporter->scene->primitives[i].file_primitive;
        json_t *primitive = json_array_get(json_object_get(object, "primitives"), file_primitive);
        if (!p->exporter->atlas->primitives[i].corner_uv) continue;
        result = export_primitive(p, i, primitive, texcoord, error);
        if (result == LX_OK) continue;
        lx_error_prefix(error, "mesh %u '%s' primitive %u", mesh->file_index, mesh->name, file_primitive);
        goto cleanup;
    }
cleanup:
    return result;
}

// The accessors of primitives that were not split.
static lx_result write_layers(primitives *p, lx_error *error)
{
    lx_result result = LX_OK;
    for (size_t i = 0; i < p->layer_count; ++i) {
        layer *l = &p->layers[i];
        LX_TRY(lx_export_add_floats(p->exporter, &l->weld.uv[0].x, 2, l->weld.count, lx_gltf_array_buffer, &l->accessor,
                                    error));
    }
    for (size_t i = 0; i < p->pending_count; ++i) {
        const pending *next = &p->pendings[i];
        LX_TRY(lx_export_set(next->attributes, next->semantic, json_integer(p->layers[next->layer].accessor), error));
    }
cleanup:
    return result;
}

lx_result lx_export_primitives(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    primitives p = {.exporter = exporter};
    p.first_layer = lx_malloc_array(exporter->input_accessor_count, sizeof *p.first_layer);
    p.mesh_taken = lx_calloc_array(json_array_size(json_object_get(exporter->document, "meshes")), 1);
    if (!p.first_layer || !p.mesh_taken) {
        result = lx_fail_memory(error, "lightmap coordinates");
        goto cleanup;
    }
    memset(p.first_layer, 0xff, exporter->input_accessor_count * sizeof *p.first_layer);
    for (uint32_t i = 0; i < exporter->scene->mesh_count; ++i)
        if (needs_coordinates(exporter, i)) LX_TRY(export_mesh(&p, i, error));
    LX_TRY(write_layers(&p, error));
cleanup:
    for (size_t i = 0; i < p.layer_count; ++i) lx_export_weld_release(&p.layers[i].weld);
    lx_free(p.layers);
    lx_free(p.pendings);
    lx_free(p.first_layer);
    lx_free(p.mesh_taken);
    return result;
}
