/// glTF files made in memory for the export tests, fake atlases for them, and what came out, three ways: bytes, document, scene.
#ifndef TEST_SCENE_EXPORT_FILES_H
#define TEST_SCENE_EXPORT_FILES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/context.h"
#include "scene/gltf.h"
#include "scene/gltf_export.h"

enum { type_i8 = 5120, type_u8 = 5121, type_i16 = 5122, type_u16 = 5123, type_u32 = 5125, type_f32 = 5126 };

// ---- making files

typedef struct file {
    json_t *document;
    uint8_t bin[1 << 20];
    size_t size;
} file;

static inline json_t *parse(const char *text)
{
    json_error_t problem;
    json_t *value = json_loads(text, JSON_DECODE_ANY, &problem);
    if (!value) fail_msg("%s at %d in %s", problem.text, problem.position, text);
    return value;
}

/// Starts with an asset, a scene and nodes given as JSON; every other array comes as needed.
static inline file *new_file(const char *nodes)
{
    file *f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->document = parse("{\"asset\":{\"version\":\"2.0\",\"generator\":\"unit test\"},\"scene\":0,\"scenes\":[{\"nodes\":[]}]}");
    json_object_set_new(f->document, "nodes", parse(nodes));
    json_t *roots = json_object_get(json_array_get(json_object_get(f->document, "scenes"), 0), "nodes");
    for (size_t i = 0; i < json_array_size(json_object_get(f->document, "nodes")); ++i)
        json_array_append_new(roots, json_integer((json_int_t)i));
    return f;
}

static inline int push(file *f, const char *array, json_t *value)
{
    if (!json_object_get(f->document, array)) json_object_set_new(f->document, array, json_array());
    json_t *list = json_object_get(f->document, array);
    assert_int_equal(json_array_append_new(list, value), 0);
    return (int)json_array_size(list) - 1;
}

static inline int add_view(file *f, const void *data, size_t size)
{
    f->size = (f->size + 3) / 4 * 4;
    assert_true(f->size + size <= sizeof f->bin);
    memcpy(f->bin + f->size, data, size);
    const int view = push(f, "bufferViews", json_pack("{sisIsI}", "buffer", 0, "byteOffset", (json_int_t)f->size, "byteLength",
                                                      (json_int_t)size));
    f->size += size;
    return view;
}

/// `stride`: of the data in bytes; 0: close together.
static inline int add_accessor(file *f, int component_type, const char *type, size_t count, const void *data, size_t size,
                               int stride)
{
    const int view = add_view(f, data, size);
    if (stride)
        json_object_set_new(json_array_get(json_object_get(f->document, "bufferViews"), (size_t)view), "byteStride",
                            json_integer(stride));
    return push(f, "accessors", json_pack("{sisisIss}", "bufferView", view, "componentType", component_type, "count",
                                          (json_int_t)count, "type", type));
}

#define ADD_ACCESSOR(f, component_type, type, count, array) \
    add_accessor(f, component_type, type, count, array, sizeof(array), 0)

static inline json_t *accessor_of(json_t *document, json_int_t index)
{
    json_t *accessor = json_array_get(json_object_get(document, "accessors"), (size_t)index);
    assert_non_null(accessor);
    return accessor;
}

static inline void normalize(file *f, int accessor)
{
    json_object_set_new(accessor_of(f->document, accessor), "normalized", json_true());
}

/// A mesh with one primitive given as JSON.
static inline int add_mesh(file *f, json_t *primitive)
{
    return push(f, "meshes", json_pack("{s[o]}", "primitives", primitive));
}

static inline void use_extension(file *f, const char *name)
{
    push(f, "extensionsUsed", json_string(name));
}

static inline void put_u32(uint8_t *at, size_t value)
{
    for (int i = 0; i < 4; ++i) at[i] = (uint8_t)(value >> (8 * i));
}

/// The file as GLB.
static inline lx_bytes glb_of(file *f)
{
    if (f->size && !json_object_get(f->document, "buffers"))
        push(f, "buffers", json_pack("{sI}", "byteLength", (json_int_t)f->size));
    char *text = json_dumps(f->document, JSON_COMPACT);
    assert_non_null(text);
    const size_t length = strlen(text), padded = (length + 3) / 4 * 4, bin = (f->size + 3) / 4 * 4;
    lx_bytes out = {.size = 12 + 8 + padded + (bin ? 8 + bin : 0)};
    out.data = calloc(out.size, 1);
    assert_non_null(out.data);
    memcpy(out.data, "glTF", 4);
    put_u32(out.data + 4, 2);
    put_u32(out.data + 8, out.size);
    put_u32(out.data + 12, padded);
    memcpy(out.data + 16, "JSON", 4);
    memcpy(out.data + 20, text, length);
    memset(out.data + 20 + length, ' ', padded - length);
    if (bin) {
        put_u32(out.data + 20 + padded, bin);
        memcpy(out.data + 24 + padded, "BIN", 4);
        memcpy(out.data + 28 + padded, f->bin, f->size);
    }
    free(text);
    return out;
}

static inline void free_file(file *f)
{
    json_decref(f->document);
    free(f);
}

// ---- importing them

static inline void ignore(void *user, lx_log_level level, const char *message)
{
    (void)user;
    (void)level;
    (void)message;
}

static inline lx_context *quiet_context(void)
{
    lx_context_desc desc = lx_context_desc_default();
    lx_context *context = NULL;
    desc.logger.func = ignore;
    desc.thread_count = 1;
    assert_int_equal(lx_context_create(&desc, &context, NULL), LX_OK);
    return context;
}

static inline lx_scene *import_bytes(lx_context *context, const lx_bytes *bytes, const char *folder)
{
    lx_error error = {0};
    lx_scene *scene = NULL;
    const lx_scene_load_desc desc = lx_scene_load_desc_default();
    if (lx_gltf_import(context, "test.glb", folder, bytes->data, bytes->size, &desc, &scene, &error) != LX_OK)
        fail_msg("%s", error.message);
    return scene;
}

// ---- fake atlases

/// Coordinates for one corner of a primitive's triangle.
typedef lx_vec2 (*corner_func)(const lx_primitive *primitive, uint32_t triangle, uint32_t corner);

/// Every vertex keeps one coordinate.
static inline lx_vec2 by_vertex(const lx_primitive *primitive, uint32_t triangle, uint32_t corner)
{
    const uint32_t vertex = primitive->indices[3 * triangle + corner];
    return lx_v2((float)vertex / 1024.0f, 0.25f);
}

/// Every triangle is a chart.
static inline lx_vec2 by_triangle(const lx_primitive *primitive, uint32_t triangle, uint32_t corner)
{
    (void)primitive;
    return lx_v2((float)triangle / 65536.0f + (corner == 1 ? 0x1p-18f : 0), corner == 2 ? 0.5f : 0.125f);
}

static inline lx_atlas *fake_atlas(const lx_scene *scene, uint32_t texcoord, corner_func func)
{
    lx_atlas *atlas = calloc(1, sizeof *atlas);
    assert_non_null(atlas);
    *atlas = (lx_atlas){.scene = scene, .page_size = 256, .page_count = 2};
    atlas->primitives = calloc(scene->primitive_count + 1, sizeof *atlas->primitives);
    atlas->meshes = calloc(scene->mesh_count + 1, sizeof *atlas->meshes);
    atlas->rects = calloc(scene->instance_count + 1, sizeof *atlas->rects);
    for (uint32_t i = 0; i < scene->mesh_count; ++i) atlas->meshes[i].texcoord = texcoord;
    for (uint32_t p = 0; p < scene->primitive_count; ++p) {
        const lx_primitive *primitive = &scene->primitives[p];
        atlas->primitives[p].corner_uv = calloc(3 * (size_t)primitive->triangle_count + 1, sizeof(lx_vec2));
        for (uint32_t k = 0; k < 3 * primitive->triangle_count; ++k)
            atlas->primitives[p].corner_uv[k] = func(primitive, k / 3, k % 3);
    }
    for (uint32_t i = 0; i < scene->instance_count; ++i)
        atlas->rects[i] = (lx_atlas_rect){.used = true, .page = i % 2, .width = 64, .height = 32, .scale = {0.25f, 0.125f},
                                          .offset = {0.25f, 0.0625f * (float)i}};
    return atlas;
}

static inline void unlight(lx_atlas *atlas, uint32_t primitive)
{
    free(atlas->primitives[primitive].corner_uv);
    atlas->primitives[primitive].corner_uv = NULL;
}

static inline void free_atlas(lx_atlas *atlas)
{
    for (uint32_t i = 0; i < atlas->scene->primitive_count; ++i) free(atlas->primitives[i].corner_uv);
    free(atlas->primitives);
    free(atlas->meshes);
    free(atlas->rects);
    free(atlas);
}

// ---- a whole round trip

typedef struct trip {
    lx_context *context;
    lx_scene *before, *after;
    lx_atlas *atlas;
    lx_bytes bytes;   ///< What export wrote.
    json_t *document; ///< The JSON of it.
} trip;

static inline size_t get_u32(const uint8_t *at)
{
    return at[0] | (size_t)at[1] << 8 | (size_t)at[2] << 16 | (size_t)at[3] << 24;
}

/// Checks the container and returns its document.
static inline json_t *open_glb(const lx_bytes *bytes)
{
    assert_true(bytes->size >= 20);
    assert_memory_equal(bytes->data, "glTF\2\0\0\0", 8);
    assert_int_equal(get_u32(bytes->data + 8), bytes->size);
    const size_t length = get_u32(bytes->data + 12);
    assert_memory_equal(bytes->data + 16, "JSON", 4);
    assert_int_equal(length % 4, 0);
    json_t *document = json_loadb((const char *)bytes->data + 20, length, 0, NULL);
    assert_non_null(document);
    const json_t *buffer = json_array_get(json_object_get(document, "buffers"), 0);
    assert_true(json_array_size(json_object_get(document, "buffers")) <= 1);
    if (buffer) {
        const uint8_t *chunk = bytes->data + 20 + length;
        assert_memory_equal(chunk + 4, "BIN\0", 4);
        assert_int_equal(get_u32(chunk) % 4, 0);
        assert_int_equal(get_u32(chunk), json_integer_value(json_object_get(buffer, "byteLength")));
        assert_int_equal(28 + length + get_u32(chunk), bytes->size);
    } else {
        assert_int_equal(20 + length, bytes->size);
    }
    return document;
}

static inline void export_trip(trip *t)
{
    lx_error error = {0};
    if (lx_gltf_export(t->before, t->atlas, &t->bytes, &error) != LX_OK) fail_msg("%s", error.message);
    t->document = open_glb(&t->bytes);
    t->after = import_bytes(t->context, &t->bytes, NULL);
}

/// Imports `f` (freed) and makes an atlas; export_trip goes on.
static inline trip begin_trip(file *f, uint32_t texcoord, corner_func func)
{
    trip t = {.context = quiet_context()};
    lx_bytes bytes = glb_of(f);
    t.before = import_bytes(t.context, &bytes, NULL);
    t.atlas = fake_atlas(t.before, texcoord, func);
    free(bytes.data);
    free_file(f);
    return t;
}

static inline trip round_trip(file *f, uint32_t texcoord, corner_func func)
{
    trip t = begin_trip(f, texcoord, func);
    export_trip(&t);
    return t;
}

static inline void end_trip(trip *t)
{
    json_decref(t->document);
    lx_bytes_release(&t->bytes);
    free_atlas(t->atlas);
    lx_scene_destroy(t->after);
    lx_scene_destroy(t->before);
    lx_context_destroy(t->context);
}

// ---- looking at the result

static inline json_t *item(json_t *document, const char *array, size_t index)
{
    json_t *found = json_array_get(json_object_get(document, array), index);
    if (!found) fail_msg("no %s[%zu]", array, index);
    return found;
}

static inline json_t *primitive_of(json_t *document, size_t mesh, size_t primitive)
{
    return json_array_get(json_object_get(item(document, "meshes", mesh), "primitives"), primitive);
}

/// Index of an attribute's accessor; -1: the primitive does not have it.
static inline json_int_t attribute_of(json_t *primitive, const char *name)
{
    const json_t *value = json_object_get(json_object_get(primitive, "attributes"), name);
    return value ? json_integer_value(value) : -1;
}

static inline json_int_t number_in(const json_t *object, const char *key)
{
    return json_integer_value(json_object_get(object, key));
}

/// The bytes of the exported accessor from its first element on.
static inline const uint8_t *data_of(const trip *t, json_int_t accessor)
{
    const json_t *object = accessor_of(t->document, accessor);
    const json_t *view = item(t->document, "bufferViews", (size_t)number_in(object, "bufferView"));
    const size_t start = (size_t)(number_in(view, "byteOffset") + number_in(object, "byteOffset"));
    return t->bytes.data + 28 + get_u32(t->bytes.data + 12) + start;
}

/// Attribute arrays of both scenes are the same, corner by corner of every triangle, and the coordinates are those of the atlas.
static inline void assert_same_corners(const trip *t)
{
    assert_int_equal(t->before->primitive_count, t->after->primitive_count);
    for (uint32_t p = 0; p < t->before->primitive_count; ++p) {
        const lx_primitive *a = &t->before->primitives[p], *b = &t->after->primitives[p];
        const lx_vec2 *uv = t->atlas->primitives[p].corner_uv;
        const uint32_t set = t->atlas->meshes[0].texcoord;
        assert_int_equal(a->triangle_count, b->triangle_count);
        for (uint32_t k = 0; k < 3 * a->triangle_count; ++k) {
            const uint32_t i = a->indices[k], j = b->indices[k];
            assert_memory_equal(&a->positions[i], &b->positions[j], sizeof *a->positions);
            if (a->normals) assert_memory_equal(&a->normals[i], &b->normals[j], sizeof *a->normals);
            if (a->colors) assert_memory_equal(&a->colors[i], &b->colors[j], sizeof *a->colors);
            for (uint32_t s = 0; s < lx_texcoord_sets; ++s)
                if (a->texcoords[s] && s != set)
                    assert_memory_equal(&a->texcoords[s][i], &b->texcoords[s][j], sizeof **a->texcoords);
            if (uv) assert_memory_equal(&uv[k], &b->texcoords[set][j], sizeof *uv);
        }
    }
}

#endif
