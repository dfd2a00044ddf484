/// What the files of the exporter share: the document under edit and the bytes that its bufferViews stand for.
///
/// The exporter works on a deep copy of the input's document. While it edits, a bufferView's bytes are known by `slices` (parallel to
/// the document's bufferViews), whatever its JSON says; gltf_export_pack.c lays them out and writes the numbers in the end.
#ifndef LX_SCENE_GLTF_EXPORT_PRIVATE_H
#define LX_SCENE_GLTF_EXPORT_PRIVATE_H

#include "base/error.h"
#include "scene/gltf_export.h"
#include "scene/gltf_reader.h"

#define LX_EXPORT_NONE UINT32_MAX

enum {
    lx_gltf_i8 = 5120,
    lx_gltf_u8 = 5121,
    lx_gltf_i16 = 5122,
    lx_gltf_u16 = 5123,
    lx_gltf_u32 = 5125,
    lx_gltf_f32 = 5126,
    lx_gltf_array_buffer = 34962,
    lx_gltf_element_array_buffer = 34963,
    lx_gltf_triangles = 4,
};

/// A run of bytes that slices lie in: an input's buffer or decompressed bufferView (borrowed) or new data (owned).
typedef struct lx_export_source {
    const uint8_t *data;
    size_t size;
    uint8_t *owned; ///< NULL: borrowed.
} lx_export_source;

/// The bytes of one bufferView.
typedef struct lx_export_slice {
    uint32_t source; ///< LX_EXPORT_NONE: not resolved yet (an input's bufferView that nobody has asked for).
    size_t offset, size;
    uint32_t accessor; ///< The first of the accessors that were added over it; LX_EXPORT_NONE: none.
} lx_export_slice;

/// New data, kept to be found again: equal bytes are written once.
typedef struct lx_export_blob {
    uint64_t hash;
    uint32_t view;
} lx_export_blob;

typedef struct lx_exporter {
    const lx_scene *scene;
    const lx_atlas *atlas;
    lx_gltf_reader input;        ///< The importer's view of the unedited document, for its data.
    json_t *document;            ///< Owned.
    json_t *accessors, *views;   ///< In the document.
    bool keep_all;               ///< An extension we do not know may hold indices: nothing is removed or renumbered.
    lx_export_source *sources;
    lx_export_slice *slices;
    lx_export_blob *blobs;       ///< Open addressing; `view` LX_EXPORT_NONE marks a free place.
    size_t source_count, source_capacity, slice_count, slice_capacity, blob_count, blob_capacity;
    size_t input_accessor_count, input_view_count;
    uint8_t *accessor_used, *view_used; ///< What the input referred to, [input_…_count].
    lx_bytes bin;                ///< What the one buffer of the output holds.
} lx_exporter;

// ---- gltf_export_json.c: reading and writing the DOM

/// An integer member in 0 … UINT32_MAX - 1, else `missing`.
uint32_t lx_export_get_index(const json_t *object, const char *key, uint32_t missing);
size_t lx_export_get_size(const json_t *object, const char *key);
/// The member `key` of `object`, created as an empty object or array if it is missing. NULL: no memory.
json_t *lx_export_object_in(json_t *object, const char *key);
json_t *lx_export_array_in(json_t *object, const char *key);
/// Steals `value`, which may be NULL (no memory).
lx_result lx_export_set(json_t *object, const char *key, json_t *value, lx_error *error);
lx_result lx_export_append(json_t *array, json_t *value, lx_error *error);
/// Removes `name` from the list `key` (extensionsUsed, …) and the list when it becomes empty.
void lx_export_unlist(json_t *document, const char *key, const char *name);
/// object.extensions.name, or NULL.
json_t *lx_export_extension(const json_t *object, const char *name);
/// Removes object.extensions.name, and `extensions` when it becomes empty. True if it was there.
bool lx_export_drop_extension(json_t *object, const char *name);

// ---- gltf_export_references.c: where indices of accessors and bufferViews stand

typedef enum lx_export_table { LX_EXPORT_ACCESSORS, LX_EXPORT_VIEWS } lx_export_table;

/// Calls `func` for every member that holds an index into `table`; accessors nobody uses are visited like all others.
typedef lx_result (*lx_export_reference)(void *user, json_t *holder, const char *key, lx_error *error);
lx_result lx_export_visit(const lx_exporter *exporter, lx_export_table table, lx_export_reference func, void *user,
                          lx_error *error);

/// True if the document has an extension that Luxel does not know and that may hold indices of accessors or bufferViews:
/// one whose content has a whole number in it.
bool lx_export_has_unknown_references(const json_t *document);

/// Writes 1 into used[i] for accessors that something refers to.
lx_result lx_export_mark_accessors(const lx_exporter *exporter, uint8_t *used, size_t count, lx_error *error);
/// The same for bufferViews that an image or one of the accessors in `accessor_used` refers to.
lx_result lx_export_mark_views(const lx_exporter *exporter, const uint8_t *accessor_used, size_t accessor_count,
                               uint8_t *used, size_t count, lx_error *error);

// ---- gltf_export_data.c: bytes in, bytes out

/// Lets the importer's functions read the scene's document again; fills `input`, the first sources and unresolved slices.
lx_result lx_export_open_input(lx_exporter *exporter, lx_error *error);
void lx_export_close_input(lx_exporter *exporter);

/// The slice of a bufferView, resolved (and decompressed) if it was not yet.
lx_result lx_export_resolve(lx_exporter *exporter, uint32_t view, lx_export_slice *out, lx_error *error);
/// A bufferView over `bytes` (taken, also on failure); an equal one serves if there is one. `target` 0, `stride` 0: none.
lx_result lx_export_add_view(lx_exporter *exporter, lx_bytes *bytes, int target, uint32_t stride, uint32_t *out_view,
                             lx_error *error);
/// An accessor that is `accessor` (stolen) over bufferView `view` (LX_EXPORT_NONE: over nothing, i.e. zeros); shared with an equal one.
lx_result lx_export_add_accessor(lx_exporter *exporter, json_t *accessor, uint32_t view, uint32_t *out_accessor,
                                 lx_error *error);
/// The same for plain floats, 1, 2 or 4 to an element. Copies them.
lx_result lx_export_add_floats(lx_exporter *exporter, const float *values, uint32_t width, size_t count, int target,
                               uint32_t *out_accessor, lx_error *error);

// ---- gltf_export_elements.c: the raw elements of an accessor

/// Elements in their own component type, `size` bytes apart; sparse ones are in place.
typedef struct lx_export_elements {
    uint8_t *data; ///< Owned; NULL: all zero.
    uint32_t count;
    uint32_t component_type, component_size, components;
    uint32_t rows;         ///< Components in a column; a vector is one column.
    uint32_t column_size;  ///< Bytes from one matrix column to the next.
    uint32_t size;
} lx_export_elements;

/// Of an accessor of the input.
lx_result lx_export_read_elements(lx_exporter *exporter, uint32_t accessor, lx_export_elements *out, lx_error *error);
void lx_export_elements_release(lx_export_elements *elements);

/// Writes the least and greatest value of every component as `min` and `max` of `accessor`. Elements must not be none.
lx_result lx_export_set_bounds(json_t *accessor, const lx_export_elements *elements, lx_error *error);

// ---- gltf_export_weld.c: corners to vertices

/// Vertices of a primitive after its corners got coordinates of their own.
typedef struct lx_export_weld {
    bool split;         ///< Some vertex became several. If not, `indices` is NULL and `uv` is by old vertex.
    uint32_t count;     ///< Vertices afterwards: as they come in the index list, so unused ones are gone.
    uint32_t *old;      ///< [count] The vertex that each was. NULL if not split.
    uint32_t *indices;  ///< [3 * triangle_count]
    lx_vec2 *uv;        ///< [count]
    uint8_t *used;      ///< [count] if not split: vertices that some triangle names. NULL if split.
} lx_export_weld;

lx_result lx_export_weld_corners(const lx_primitive *primitive, const lx_vec2 *corner_uv, lx_export_weld *out,
                                 lx_error *error);
void lx_export_weld_release(lx_export_weld *weld);

// ---- gltf_export_reindex.c: a primitive in new vertices

/// Gives every attribute and morph target of a split primitive the weld's vertices, and makes it indexed triangles. The attribute
/// `skip` and its morph targets are removed instead.
lx_result lx_export_reindex(lx_exporter *exporter, json_t *primitive, const lx_export_weld *weld, uint32_t triangle_count,
                            const char *skip, lx_error *error);

// ---- the steps, in the order in which lx_gltf_export takes them

/// gltf_export_primitives.c: TEXCOORD_n on every lit primitive.
lx_result lx_export_primitives(lx_exporter *exporter, lx_error *error);
/// gltf_export_extras.c: what the lightmap needs on nodes and materials, and no trace of an earlier bake.
lx_result lx_export_extras(lx_exporter *exporter, lx_error *error);
/// gltf_export_embed.c: images that lie outside become bufferViews.
lx_result lx_export_images(lx_exporter *exporter, lx_error *error);
/// gltf_export_pack.c: drops what is no longer referred to, lays out the buffer, writes all numbers.
lx_result lx_export_pack(lx_exporter *exporter, lx_error *error);

#endif
