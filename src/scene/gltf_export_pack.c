// The end of an export: what nothing refers to any more is dropped, the rest is laid out in one buffer.
//
// Dropped are accessors and bufferViews that the input used and that the edits have left unused; what the input itself did not
// use stays. If the document has an extension that we do not know and that may hold indices, all of them stay, in their order.
// Bytes that no bufferView covers are not written. BufferViews that overlap in the input overlap in the output.
#include "scene/gltf_export_private.h"

#include <stdlib.h>
#include <string.h>

typedef struct removal {
    uint32_t *accessor_index, *view_index; // new index of each; LX_EXPORT_NONE: dropped
    uint8_t *accessor_used, *view_used;
    size_t accessor_count, view_count;
} removal;

static void number_the_kept(const uint8_t *used, size_t count, uint32_t *index)
{
    uint32_t next = 0;
    for (size_t i = 0; i < count; ++i) index[i] = used[i] ? next++ : LX_EXPORT_NONE;
}

// Unused in the input, or wanted by us whatever the marks say.
static void keep_untouched(uint8_t *used, const uint8_t *used_before, size_t input_count, size_t count, bool keep_all)
{
    for (size_t i = 0; i < count; ++i)
        if (keep_all || (i < input_count && !used_before[i])) used[i] = 1;
}

static lx_result plan_removal(const lx_exporter *exporter, removal *out, lx_error *error)
{
    lx_result result = LX_OK;
    out->accessor_count = json_array_size(exporter->accessors);
    out->view_count = exporter->slice_count;
    out->accessor_used = lx_calloc_array(out->accessor_count, 1);
    out->view_used = lx_calloc_array(out->view_count, 1);
    out->accessor_index = lx_malloc_array(out->accessor_count, sizeof *out->accessor_index);
    out->view_index = lx_malloc_array(out->view_count, sizeof *out->view_index);
    if (!out->accessor_used || !out->view_used || !out->accessor_index || !out->view_index)
        return lx_fail_memory(error, "glTF document");
    LX_TRY(lx_export_mark_accessors(exporter, out->accessor_used, out->accessor_count, error));
    keep_untouched(out->accessor_used, exporter->accessor_used, exporter->input_accessor_count, out->accessor_count,
                   exporter->keep_all);
    LX_TRY(lx_export_mark_views(exporter, out->accessor_used, out->accessor_count, out->view_used, out->view_count, error));
    keep_untouched(out->view_used, exporter->view_used, exporter->input_view_count, out->view_count, exporter->keep_all);
    number_the_kept(out->accessor_used, out->accessor_count, out->accessor_index);
    number_the_kept(out->view_used, out->view_count, out->view_index);
cleanup:
    return result;
}

typedef struct renumbering {
    const uint32_t *index;
    size_t count;
} renumbering;

static lx_result renumber(void *user, json_t *holder, const char *key, lx_error *error)
{
    const renumbering *r = user;
    const uint32_t old = lx_export_get_index(holder, key, LX_EXPORT_NONE);
    if (old >= r->count || r->index[old] == LX_EXPORT_NONE) return LX_OK; // of a dropped accessor
    return lx_export_set(holder, key, json_integer(r->index[old]), error);
}

static lx_result resolve_used(lx_exporter *exporter, const uint8_t *used, size_t count, lx_error *error)
{
    lx_result result = LX_OK;
    lx_export_slice slice;
    for (size_t i = 0; result == LX_OK && i < count; ++i)
        if (used[i]) result = lx_export_resolve(exporter, (uint32_t)i, &slice, error);
    return result;
}

static void remove_unused(json_t *array, const uint8_t *used, size_t count)
{
    for (size_t i = count; i-- > 0;)
        if (!used[i]) json_array_remove(array, i);
}

static lx_result remove_and_renumber(lx_exporter *exporter, const removal *plan, lx_error *error)
{
    lx_result result = LX_OK;
    renumbering accessors = {plan->accessor_index, plan->accessor_count}, views = {plan->view_index, plan->view_count};
    LX_TRY(lx_export_visit(exporter, LX_EXPORT_ACCESSORS, renumber, &accessors, error));
    LX_TRY(lx_export_visit(exporter, LX_EXPORT_VIEWS, renumber, &views, error));
    remove_unused(exporter->accessors, plan->accessor_used, plan->accessor_count);
    remove_unused(exporter->views, plan->view_used, plan->view_count);
    size_t kept = 0;
    for (size_t i = 0; i < plan->view_count; ++i)
        if (plan->view_used[i]) exporter->slices[kept++] = exporter->slices[i];
    exporter->slice_count = kept;
cleanup:
    return result;
}

// ---- one buffer

// A slice on its way into the buffer.
typedef struct placement {
    lx_export_slice slice;
    uint32_t view;
    size_t offset; // in the buffer
} placement;

static int compare_placements(const void *a, const void *b)
{
    const placement *x = a, *y = b;
    if (x->slice.source != y->slice.source) return x->slice.source < y->slice.source ? -1 : 1;
    if (x->slice.offset != y->slice.offset) return x->slice.offset < y->slice.offset ? -1 : 1;
    return x->view < y->view ? -1 : x->view > y->view;
}

// Gives every slice its offset, those that overlap or touch in one run. Offsets keep their remainder by four, so what was
// aligned stays so. Returns the buffer's size.
static size_t place(placement *list, size_t count)
{
    size_t size = 0, run_end = 0, shift = 0; // of the current run: its end in the source, and offset - slice.offset
    for (size_t i = 0; i < count; ++i) {
        const lx_export_slice *slice = &list[i].slice;
        if (i == 0 || list[i - 1].slice.source != slice->source || slice->offset > run_end) {
            const size_t start = slice->offset / 4 * 4;
            size = (size + 3) / 4 * 4;
            shift = size - start; // may wrap around; the sum below does so again
            run_end = start;
        }
        list[i].offset = slice->offset + shift;
        if (slice->offset + slice->size > run_end) run_end = slice->offset + slice->size;
        size = run_end + shift;
    }
    return (size + 3) / 4 * 4;
}

static lx_result copy_slices(lx_exporter *exporter, const placement *list, size_t count, size_t size, lx_error *error)
{
    if (size >= UINT32_MAX)
        return lx_fail(error, LX_ERROR_LIMIT, "the scene with its lightmap coordinates takes %zu bytes; a .glb holds 4 GiB", size);
    exporter->bin.data = lx_calloc_array(size, 1);
    if (!exporter->bin.data) return lx_fail_memory(error, "glTF buffer");
    exporter->bin.size = size;
    size_t written = 0; // so far; what overlaps is copied once
    for (size_t i = 0; i < count; ++i) {
        const lx_export_slice *slice = &list[i].slice;
        const size_t begin = list[i].offset < written ? written : list[i].offset, end = list[i].offset + slice->size;
        if (end <= begin) continue;
        memcpy(exporter->bin.data + begin,
               exporter->sources[slice->source].data + slice->offset + (begin - list[i].offset), end - begin);
        written = end;
    }
    return LX_OK;
}

static lx_result describe_view(json_t *view, const placement *at, lx_error *error)
{
    lx_result result = LX_OK;
    if (!view) return lx_fail(error, LX_ERROR_FORMAT, "bufferView %u does not exist", at->view);
    lx_export_drop_extension(view, "EXT_meshopt_compression");
    lx_export_drop_extension(view, "KHR_meshopt_compression");
    LX_TRY(lx_export_set(view, "buffer", json_integer(0), error));
    LX_TRY(lx_export_set(view, "byteOffset", json_integer((json_int_t)at->offset), error));
    LX_TRY(lx_export_set(view, "byteLength", json_integer((json_int_t)at->slice.size), error));
cleanup:
    return result;
}

static lx_result lay_out(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    const size_t count = exporter->slice_count;
    placement *list = lx_malloc_array(count, sizeof *list);
    if (!list) return lx_fail_memory(error, "bufferViews");
    for (size_t i = 0; i < count; ++i) list[i] = (placement){exporter->slices[i], (uint32_t)i, 0};
    if (count) qsort(list, count, sizeof *list, compare_placements);
    LX_TRY(copy_slices(exporter, list, count, place(list, count), error));
    for (size_t i = 0; i < count; ++i)
        LX_TRY(describe_view(json_array_get(exporter->views, list[i].view), &list[i], error));
cleanup:
    lx_free(list);
    return result;
}

// One buffer remains; it keeps the name and the extras of the input's first.
static lx_result describe_buffer(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *document = exporter->document;
    json_t *buffer = json_incref(json_array_get(json_object_get(document, "buffers"), 0));
    if (exporter->bin.size == 0) {
        json_object_del(document, "buffers");
        goto cleanup;
    }
    if (!json_is_object(buffer)) {
        json_decref(buffer);
        buffer = json_object();
    }
    json_object_del(buffer, "uri");
    lx_export_drop_extension(buffer, "EXT_meshopt_compression");
    lx_export_drop_extension(buffer, "KHR_meshopt_compression");
    LX_TRY(lx_export_set(buffer, "byteLength", json_integer((json_int_t)exporter->bin.size), error));
    LX_TRY(lx_export_set(document, "buffers", json_pack("[O]", buffer), error));
cleanup:
    json_decref(buffer);
    return result;
}

// Readers refuse empty lists.
static void drop_if_empty(json_t *document, const char *key)
{
    const json_t *list = json_object_get(document, key);
    if (json_is_array(list) && json_array_size(list) == 0) json_object_del(document, key);
}

lx_result lx_export_pack(lx_exporter *exporter, lx_error *error)
{
    static const char *const gone[] = {"EXT_meshopt_compression", "KHR_meshopt_compression"};
    lx_result result = LX_OK;
    removal plan = {0};
    LX_TRY(plan_removal(exporter, &plan, error));
    LX_TRY(resolve_used(exporter, plan.view_used, plan.view_count, error));
    LX_TRY(remove_and_renumber(exporter, &plan, error));
    LX_TRY(lay_out(exporter, error));
    LX_TRY(describe_buffer(exporter, error));
    for (size_t i = 0; i < sizeof gone / sizeof *gone; ++i) {
        lx_export_unlist(exporter->document, "extensionsUsed", gone[i]);
        lx_export_unlist(exporter->document, "extensionsRequired", gone[i]);
    }
    drop_if_empty(exporter->document, "accessors");
    drop_if_empty(exporter->document, "bufferViews");
cleanup:
    lx_free(plan.accessor_index);
    lx_free(plan.view_index);
    lx_free(plan.accessor_used);
    lx_free(plan.view_used);
    return result;
}
