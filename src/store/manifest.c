// luxel.json, written and read. The only file of this folder that knows jansson.
#include "store/manifest.h"

#include "base/error.h"
#include "luxel/bake.h"
#include "math/hash.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { max_pages = 65536, max_layers = 1 << 20, max_files = 1 << 22, max_animations = 1 << 20 };

void lx_manifest_release(lx_manifest *manifest)
{
    lx_free(manifest->pages);
    lx_free(manifest->layers);
    lx_free(manifest->files);
    lx_free(manifest->monitors);
    lx_free(manifest->animations);
    lx_arena_release(&manifest->strings);
    *manifest = (lx_manifest){0};
}

uint64_t lx_content_hash(const void *data, size_t size)
{
    return lx_content_hash_end(lx_content_hash_add(LX_CONTENT_HASH_START, data, size));
}

uint64_t lx_content_hash_add(uint64_t hash, const void *data, size_t size)
{
    return lx_hash_bytes(hash, data, size);
}

uint64_t lx_content_hash_end(uint64_t hash)
{
    return hash ? hash : 1;
}

bool lx_path_stays_inside(const char *path)
{
    if (!*path || strchr(path, '\\') || strchr(path, ':')) return false;
    for (const char *part = path;;) {
        const char *slash = strchr(part, '/');
        const size_t length = slash ? (size_t)(slash - part) : strlen(part);
        if (length == 0 || (length == 1 && part[0] == '.') || (length == 2 && part[0] == '.' && part[1] == '.')) return false;
        if (!slash) return true;
        part = slash + 1;
    }
}

// ---- writing

// Sets a member and takes over `value`. False only when memory is out: numbers are made finite and text valid before.
static bool put(json_t *object, const char *key, json_t *value)
{
    return json_object_set_new(object, key, value) == 0;
}

static json_t *real(double value)
{
    return json_real(isfinite(value) ? value : 0);
}

// Names come from glTF files and are UTF-8; what is not (file names, say) is written with '?'.
static json_t *text(const char *value)
{
    json_t *string = json_string(value);
    if (string) return string;
    char *ascii = lx_strdup(value);
    for (char *c = ascii; c && *c; ++c)
        if (*c & 0x80) *c = '?';
    string = ascii ? json_string(ascii) : NULL;
    lx_free(ascii);
    return string;
}

static json_t *triple(const float v[3])
{
    json_t *array = json_array();
    for (int i = 0; i < 3 && array; ++i)
        if (json_array_append_new(array, real((double)v[i])) != 0) {
            json_decref(array);
            return NULL;
        }
    return array;
}

static json_t *write_page(const lx_manifest *manifest, uint32_t index)
{
    const lx_manifest_page *page = &manifest->pages[index];
    json_t *object = json_object();
    if (put(object, "width", json_integer(page->width)) && put(object, "height", json_integer(page->height)) &&
        put(object, "coverage", real((double)page->coverage)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_layer(const lx_manifest *manifest, uint32_t index)
{
    const lx_manifest_layer *layer = &manifest->layers[index];
    json_t *object = json_object();
    if (put(object, "name", text(layer->name)) && put(object, "kind", text(layer->kind)) && put(object, "node", text(layer->node)) &&
        put(object, "color", triple(layer->color)) && put(object, "intensity", real((double)layer->intensity)) &&
        put(object, "unit", text(layer->unit)) && put(object, "mode", text(layer->mode)) &&
        (layer->scale == 1 || put(object, "scale", real((double)layer->scale))))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_file(const lx_manifest *manifest, uint32_t index)
{
    const lx_manifest_file *file = &manifest->files[index];
    json_t *object = json_object();
    if (put(object, "page", json_integer(file->page)) && put(object, "layer", json_integer(file->layer)) &&
        put(object, "format", text(file->format)) && put(object, "file", text(file->file)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_monitor(const lx_manifest *manifest, uint32_t index)
{
    const lx_manifest_monitor *monitor = &manifest->monitors[index];
    json_t *object = json_object();
    if (put(object, "name", text(monitor->name)) && put(object, "node", json_integer(monitor->node)) &&
        (monitor->material < 0 || put(object, "material", json_integer(monitor->material))) &&
        put(object, "columns", json_integer(monitor->columns)) && put(object, "rows", json_integer(monitor->rows)) &&
        put(object, "firstLayer", json_integer(monitor->first_layer)) && put(object, "strength", triple(monitor->strength)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_animation(const lx_manifest *manifest, uint32_t index)
{
    const lx_manifest_animation *animation = &manifest->animations[index];
    json_t *object = json_object();
    if (put(object, "name", text(animation->name)) && put(object, "layer", json_integer(animation->layer)) &&
        put(object, "program", text(animation->program)) && put(object, "channel", text(animation->channel)) &&
        put(object, "duration", real((double)animation->duration_s)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_array(const lx_manifest *manifest, uint32_t count, json_t *(*write)(const lx_manifest *, uint32_t))
{
    json_t *array = json_array();
    for (uint32_t i = 0; i < count && array; ++i)
        if (json_array_append_new(array, write(manifest, i)) != 0) {
            json_decref(array);
            return NULL;
        }
    return array;
}

static json_t *write_atlas(const lx_manifest *manifest)
{
    json_t *object = json_object();
    if (put(object, "padding", json_integer(manifest->padding)) && put(object, "texels_per_m", real((double)manifest->texels_per_m)) &&
        put(object, "pages", write_array(manifest, manifest->page_count, write_page)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_sky(const lx_manifest_sky *sky)
{
    json_t *object = json_object();
    if (put(object, "file", text(sky->file)) && put(object, "color", triple(sky->color)) &&
        put(object, "rotation", real((double)sky->rotation_deg)) && put(object, "intensity", real((double)sky->intensity)))
        return object;
    json_decref(object);
    return NULL;
}

static const struct {
    const char *key;
    size_t offset;
} stage_fields[] = {
    {"import", offsetof(lx_stage_seconds, import)}, {"unwrap", offsetof(lx_stage_seconds, unwrap)},
    {"luxels", offsetof(lx_stage_seconds, luxels)}, {"bake", offsetof(lx_stage_seconds, bake)},
    {"post", offsetof(lx_stage_seconds, post)},     {"save", offsetof(lx_stage_seconds, save)},
    {"preview", offsetof(lx_stage_seconds, preview)}, {"direct", offsetof(lx_stage_seconds, direct)},
    {"cache", offsetof(lx_stage_seconds, cache)},   {"gather", offsetof(lx_stage_seconds, gather)},
    {"denoise", offsetof(lx_stage_seconds, denoise)},
};
enum { part_fields = 7 }; // from here on: parts of the bake, left out where there is none

static double *stage_field(lx_stage_seconds *stages, size_t index)
{
    return (double *)((char *)stages + stage_fields[index].offset);
}

static json_t *write_stages(lx_stage_seconds stages)
{
    json_t *object = json_object();
    bool ok = object != NULL;
    for (size_t i = 0; i < sizeof stage_fields / sizeof *stage_fields; ++i)
        ok = ok && ((i >= part_fields && *stage_field(&stages, i) == 0) || put(object, stage_fields[i].key, real(*stage_field(&stages, i))));
    if (ok) return object;
    json_decref(object);
    return NULL;
}

static json_t *write_memory(const lx_budget *memory)
{
    json_t *object = json_object();
    if (put(object, "ram", json_integer((json_int_t)memory->ram)) &&
        put(object, "accumulator", json_integer((json_int_t)memory->accumulator)) &&
        put(object, "gpu_composed", json_integer((json_int_t)memory->gpu_composed)) &&
        put(object, "gpu_layers", json_integer((json_int_t)memory->gpu_layers)) &&
        put(object, "dense", json_integer((json_int_t)memory->dense)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_bake(const lx_manifest_bake *bake)
{
    json_t *object = json_object();
    if (put(object, "samples", json_integer(bake->samples)) &&
        put(object, "bounces", bake->bounces == LX_BOUNCES_INF ? json_string("inf") : json_integer(bake->bounces)) &&
        put(object, "integrator", text(bake->integrator)) && put(object, "denoise", text(bake->denoise)) &&
        (!(bake->noise > 0) || put(object, "noise", real((double)bake->noise))) && put(object, "seed", json_integer(bake->seed)) &&
        put(object, "isa", text(bake->isa)) && put(object, "seconds", real(bake->seconds)) &&
        put(object, "stages", write_stages(bake->stages)) &&
        put(object, "threads", json_integer(bake->threads)))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *hexadecimal(uint64_t hash)
{
    char *digits = lx_format("%016llx", (unsigned long long)hash);
    json_t *string = digits ? json_string(digits) : NULL;
    lx_free(digits);
    return string;
}

static json_t *write_hashes(const lx_manifest *manifest)
{
    json_t *object = json_object();
    if ((!manifest->scene || !manifest->scene_hash || put(object, manifest->scene, hexadecimal(manifest->scene_hash))) &&
        (!manifest->pack_hash || put(object, manifest->pack, hexadecimal(manifest->pack_hash))))
        return object;
    json_decref(object);
    return NULL;
}

static json_t *write_sizes(const lx_manifest *manifest, const uint64_t *sizes)
{
    json_t *object = json_object();
    bool ok = object != NULL;
    if (manifest->scene && sizes[0]) ok = ok && put(object, manifest->scene, json_integer((json_int_t)sizes[0]));
    if (sizes[1]) ok = ok && put(object, manifest->pack, json_integer((json_int_t)sizes[1]));
    for (uint32_t i = 0; i < manifest->file_count; ++i)
        if (sizes[2 + i]) ok = ok && put(object, manifest->files[i].file, json_integer((json_int_t)sizes[2 + i]));
    if (ok) return object;
    json_decref(object);
    return NULL;
}

static json_t *write_view(const lx_manifest *manifest)
{
    json_t *object = json_object();
    if (put(object, "ev", real((double)manifest->view_ev))) return object;
    json_decref(object);
    return NULL;
}

lx_result lx_manifest_write(const lx_manifest *manifest, const uint64_t *sizes, char **out_text, lx_error *error)
{
    lx_result result = LX_OK;
    char *dump = NULL;
    json_t *root = json_object();
    const bool complete =
        put(root, "version", json_integer(lx_manifest_version)) && put(root, "generator", text(manifest->generator)) &&
        (!manifest->scene || put(root, "scene", text(manifest->scene))) && put(root, "pack", text(manifest->pack)) &&
        put(root, "atlas", write_atlas(manifest)) && put(root, "layers", write_array(manifest, manifest->layer_count, write_layer)) &&
        put(root, "files", write_array(manifest, manifest->file_count, write_file)) &&
        put(root, "monitors", write_array(manifest, manifest->monitor_count, write_monitor)) &&
        put(root, "animations", write_array(manifest, manifest->animation_count, write_animation)) &&
        (!manifest->has_sky || put(root, "sky", write_sky(&manifest->sky))) &&
        (!manifest->has_view || put(root, "view", write_view(manifest))) &&
        (!manifest->has_report || put(root, "report", text("report.html"))) &&
        (!manifest->memory.ram || put(root, "memory", write_memory(&manifest->memory))) && put(root, "bake", write_bake(&manifest->bake)) &&
        put(root, "hashes", write_hashes(manifest)) && (!sizes || put(root, "sizes", write_sizes(manifest, sizes)));
    if (complete) dump = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9)); // 9 digits hold every float
    char *copy = dump ? lx_format("%s\n", dump) : NULL;
    if (copy)
        *out_text = copy;
    else
        result = lx_fail_memory(error, "luxel.json");
    free(dump);
    json_decref(root);
    return result;
}

lx_result lx_manifest_drop_files(const char *text_data, size_t size, char **out_text, lx_error *error)
{
    json_error_t problem;
    json_t *root = json_loadb(text_data, size, JSON_REJECT_DUPLICATES, &problem);
    if (!root) return lx_fail(error, LX_ERROR_FORMAT, "line %d: %s", problem.line, problem.text);
    json_t *layer;
    size_t index;
    json_object_set_new(root, "files", json_array());
    json_array_foreach(json_object_get(root, "layers"), index, layer) json_object_del(layer, "scale"); // of KTX2 files alone
    char *dump = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    char *copy = dump ? lx_format("%s\n", dump) : NULL;
    free(dump);
    json_decref(root);
    if (!copy) return lx_fail_memory(error, "luxel.json");
    *out_text = copy;
    return LX_OK;
}

// ---- reading: every getter names what is wrong, relative to `where`

typedef struct reader {
    lx_manifest *manifest;
    lx_error *error;
} reader;

static lx_result wrong(const reader *r, const char *where, const char *key, const char *what)
{
    return lx_fail(r->error, LX_ERROR_FORMAT, "%s%s%s: %s", where, *where ? "." : "", key, what);
}

static lx_result get_text(const reader *r, const json_t *object, const char *where, const char *key, const char *fallback,
                          const char **out)
{
    const json_t *value = json_object_get(object, key);
    if (!value && fallback) {
        *out = fallback;
        return LX_OK;
    }
    if (!json_is_string(value)) return wrong(r, where, key, value ? "is no text" : "is missing");
    *out = lx_arena_strdup(&r->manifest->strings, json_string_value(value));
    return *out ? LX_OK : lx_fail_memory(r->error, "luxel.json");
}

static lx_result get_path(const reader *r, const json_t *object, const char *where, const char *key, const char **out)
{
    const lx_result result = get_text(r, object, where, key, NULL, out);
    if (result == LX_OK && !lx_path_stays_inside(*out)) return wrong(r, where, key, "must be a path inside the folder");
    return result;
}

static lx_result get_uint(const reader *r, const json_t *object, const char *where, const char *key, bool required, uint32_t *out)
{
    const json_t *value = json_object_get(object, key);
    if (!value && !required) return LX_OK;
    if (!json_is_integer(value)) return wrong(r, where, key, value ? "is no whole number" : "is missing");
    const json_int_t number = json_integer_value(value);
    if (number < 0 || number > (json_int_t)UINT32_MAX) return wrong(r, where, key, "is out of range");
    *out = (uint32_t)number;
    return LX_OK;
}

static lx_result to_float(const reader *r, const json_t *value, const char *where, const char *key, float *out)
{
    if (!json_is_number(value)) return wrong(r, where, key, "is no number");
    const double number = json_number_value(value);
    if (!(fabs(number) <= 3.4e38)) return wrong(r, where, key, "is out of range");
    *out = (float)number;
    return LX_OK;
}

static lx_result get_float(const reader *r, const json_t *object, const char *where, const char *key, bool required, float *out)
{
    const json_t *value = json_object_get(object, key);
    if (!value && !required) return LX_OK;
    if (!value) return wrong(r, where, key, "is missing");
    return to_float(r, value, where, key, out);
}

static lx_result get_color(const reader *r, const json_t *object, const char *where, const char *key, float out[3])
{
    const json_t *value = json_object_get(object, key);
    if (!json_is_array(value) || json_array_size(value) != 3) return wrong(r, where, key, "must be three numbers");
    for (size_t i = 0; i < 3; ++i) {
        const lx_result result = to_float(r, json_array_get(value, i), where, key, &out[i]);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

// An array member as a zeroed array of `element_bytes`. A missing one is empty unless it is required.
static lx_result get_array(const reader *r, const json_t *object, const char *where, const char *key, bool required, size_t limit,
                           size_t element_bytes, const json_t **out_items, void *out_array_pointer, uint32_t *out_count)
{
    const json_t *items = json_object_get(object, key);
    if (!items && !required) return LX_OK;
    if (!json_is_array(items)) return wrong(r, where, key, items ? "is no array" : "is missing");
    const size_t count = json_array_size(items);
    if (count > limit) return wrong(r, where, key, "is too long");
    void *array = lx_calloc_array(count, element_bytes);
    if (!array) return lx_fail_memory(r->error, "luxel.json");
    memcpy(out_array_pointer, &array, sizeof array);
    *out_items = items;
    *out_count = (uint32_t)count;
    return LX_OK;
}

enum { place_bytes = 32 };

static void name_element(char place[place_bytes], const char *array, uint32_t index)
{
    snprintf(place, place_bytes, "%s[%u]", array, index);
}

static lx_result read_pages(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest *m = r->manifest;
    const json_t *atlas = json_object_get(root, "atlas"), *items = NULL;
    if (!json_is_object(atlas)) return wrong(r, "", "atlas", "is missing");
    LX_TRY(get_uint(r, atlas, "atlas", "padding", false, &m->padding));
    LX_TRY(get_float(r, atlas, "atlas", "texels_per_m", false, &m->texels_per_m));
    LX_TRY(get_array(r, atlas, "atlas", "pages", true, max_pages, sizeof *m->pages, &items, &m->pages, &m->page_count));
    for (uint32_t i = 0; i < m->page_count; ++i) {
        const json_t *item = json_array_get(items, i);
        char where[place_bytes];
        name_element(where, "atlas.pages", i);
        LX_TRY(get_uint(r, item, where, "width", true, &m->pages[i].width));
        LX_TRY(get_uint(r, item, where, "height", true, &m->pages[i].height));
        LX_TRY(get_float(r, item, where, "coverage", false, &m->pages[i].coverage));
    }
cleanup:
    return result;
}

static lx_result read_layers(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest *m = r->manifest;
    const json_t *items = NULL;
    LX_TRY(get_array(r, root, "", "layers", true, max_layers, sizeof *m->layers, &items, &m->layers, &m->layer_count));
    for (uint32_t i = 0; i < m->layer_count; ++i) {
        const json_t *item = json_array_get(items, i);
        lx_manifest_layer *layer = &m->layers[i];
        char where[place_bytes];
        name_element(where, "layers", i);
        LX_TRY(get_text(r, item, where, "name", NULL, &layer->name));
        LX_TRY(get_text(r, item, where, "kind", "", &layer->kind));
        LX_TRY(get_text(r, item, where, "node", "", &layer->node));
        LX_TRY(get_text(r, item, where, "unit", "", &layer->unit));
        LX_TRY(get_text(r, item, where, "mode", "baked", &layer->mode));
        LX_TRY(get_color(r, item, where, "color", layer->color));
        LX_TRY(get_float(r, item, where, "intensity", true, &layer->intensity));
        layer->scale = 1;
        LX_TRY(get_float(r, item, where, "scale", false, &layer->scale));
    }
cleanup:
    return result;
}

static lx_result read_files(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest *m = r->manifest;
    const json_t *items = NULL;
    LX_TRY(get_array(r, root, "", "files", false, max_files, sizeof *m->files, &items, &m->files, &m->file_count));
    for (uint32_t i = 0; i < m->file_count; ++i) {
        const json_t *item = json_array_get(items, i);
        lx_manifest_file *file = &m->files[i];
        char where[place_bytes];
        name_element(where, "files", i);
        LX_TRY(get_uint(r, item, where, "page", true, &file->page));
        LX_TRY(get_uint(r, item, where, "layer", true, &file->layer));
        LX_TRY(get_text(r, item, where, "format", NULL, &file->format));
        LX_TRY(get_path(r, item, where, "file", &file->file));
        if (file->page >= m->page_count || file->layer >= m->layer_count) {
            result = wrong(r, where, "page, layer", "there is no such image");
            goto cleanup;
        }
    }
cleanup:
    return result;
}

static lx_result read_monitors(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest *m = r->manifest;
    const json_t *items = NULL;
    LX_TRY(get_array(r, root, "", "monitors", false, max_layers, sizeof *m->monitors, &items, &m->monitors, &m->monitor_count));
    for (uint32_t i = 0; i < m->monitor_count; ++i) {
        const json_t *item = json_array_get(items, i);
        lx_manifest_monitor *monitor = &m->monitors[i];
        char where[place_bytes];
        uint32_t material = UINT32_MAX;
        name_element(where, "monitors", i);
        LX_TRY(get_text(r, item, where, "name", NULL, &monitor->name));
        LX_TRY(get_uint(r, item, where, "node", true, &monitor->node));
        LX_TRY(get_uint(r, item, where, "material", false, &material));
        LX_TRY(get_uint(r, item, where, "columns", true, &monitor->columns));
        LX_TRY(get_uint(r, item, where, "rows", true, &monitor->rows));
        LX_TRY(get_uint(r, item, where, "firstLayer", true, &monitor->first_layer));
        LX_TRY(get_color(r, item, where, "strength", monitor->strength));
        monitor->material = material <= INT32_MAX ? (int32_t)material : -1;
        const uint64_t cells = (uint64_t)monitor->columns * monitor->rows;
        if (cells == 0 || cells > m->layer_count || monitor->first_layer > m->layer_count - cells) {
            result = wrong(r, where, "columns, rows, firstLayer", "there are no such layers");
            goto cleanup;
        }
    }
cleanup:
    return result;
}

static lx_result read_animations(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest *m = r->manifest;
    const json_t *items = NULL;
    LX_TRY(get_array(r, root, "", "animations", false, max_animations, sizeof *m->animations, &items, &m->animations, &m->animation_count));
    for (uint32_t i = 0; i < m->animation_count; ++i) {
        const json_t *item = json_array_get(items, i);
        lx_manifest_animation *animation = &m->animations[i];
        char where[place_bytes];
        name_element(where, "animations", i);
        LX_TRY(get_text(r, item, where, "name", "", &animation->name));
        LX_TRY(get_uint(r, item, where, "layer", true, &animation->layer));
        LX_TRY(get_text(r, item, where, "program", NULL, &animation->program));
        LX_TRY(get_text(r, item, where, "channel", "light", &animation->channel));
        LX_TRY(get_float(r, item, where, "duration", false, &animation->duration_s));
        if (animation->layer >= m->layer_count) {
            result = wrong(r, where, "layer", "there is no such layer");
            goto cleanup;
        }
    }
cleanup:
    return result;
}

static lx_result read_sky(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest_sky *sky = &r->manifest->sky;
    const json_t *object = json_object_get(root, "sky");
    if (!object) return LX_OK;
    if (!json_is_object(object)) return wrong(r, "", "sky", "is no object");
    LX_TRY(get_path(r, object, "sky", "file", &sky->file));
    LX_TRY(get_color(r, object, "sky", "color", sky->color));
    LX_TRY(get_float(r, object, "sky", "rotation", false, &sky->rotation_deg));
    sky->intensity = 1;
    LX_TRY(get_float(r, object, "sky", "intensity", false, &sky->intensity));
    r->manifest->has_sky = true;
cleanup:
    return result;
}

static lx_result read_view(const reader *r, const json_t *root)
{
    const json_t *view = json_object_get(root, "view");
    if (!json_object_get(view, "ev")) return LX_OK;
    const lx_result result = get_float(r, view, "view", "ev", true, &r->manifest->view_ev);
    r->manifest->has_view = result == LX_OK;
    return result;
}

static lx_result read_bake(const reader *r, const json_t *root)
{
    lx_result result = LX_OK;
    lx_manifest_bake *bake = &r->manifest->bake;
    const json_t *object = json_object_get(root, "bake"), *bounces = json_object_get(object, "bounces");
    float seconds = 0;
    LX_TRY(get_uint(r, object, "bake", "samples", false, &bake->samples));
    if (json_is_string(bounces) && strcmp(json_string_value(bounces), "inf") == 0)
        bake->bounces = LX_BOUNCES_INF;
    else
        LX_TRY(get_uint(r, object, "bake", "bounces", false, &bake->bounces));
    LX_TRY(get_text(r, object, "bake", "integrator", "", &bake->integrator));
    LX_TRY(get_text(r, object, "bake", "denoise", "", &bake->denoise));
    LX_TRY(get_float(r, object, "bake", "noise", false, &bake->noise));
    LX_TRY(get_uint(r, object, "bake", "seed", false, &bake->seed));
    LX_TRY(get_text(r, object, "bake", "isa", "", &bake->isa));
    LX_TRY(get_float(r, object, "bake", "seconds", false, &seconds));
    bake->seconds = (double)seconds;
    const json_t *stages = json_object_get(object, "stages");
    for (size_t i = 0; i < sizeof stage_fields / sizeof *stage_fields; ++i) {
        float stage = 0;
        LX_TRY(get_float(r, stages, "bake.stages", stage_fields[i].key, false, &stage));
        *stage_field(&bake->stages, i) = (double)stage;
    }
    LX_TRY(get_uint(r, object, "bake", "threads", false, &bake->threads));
cleanup:
    return result;
}

static lx_result read_hash(const reader *r, const json_t *root, const char *file, uint64_t *out)
{
    const json_t *value = json_object_get(json_object_get(root, "hashes"), file);
    if (!value) return LX_OK;
    const char *digits = json_is_string(value) ? json_string_value(value) : "";
    if (strlen(digits) != 16 || strspn(digits, "0123456789abcdef") != 16) return wrong(r, "hashes", file, "must be 16 hexadecimal digits");
    *out = strtoull(digits, NULL, 16);
    return LX_OK;
}

lx_result lx_manifest_read(const char *text_data, size_t size, lx_manifest *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_manifest manifest = {0};
    const reader r = {&manifest, error};
    json_error_t problem;
    uint32_t version = 0;
    json_t *root = json_loadb(text_data, size, JSON_REJECT_DUPLICATES, &problem);
    if (!root) {
        result = lx_fail(error, LX_ERROR_FORMAT, "line %d: %s", problem.line, problem.text);
        goto cleanup;
    }
    LX_TRY(get_uint(&r, root, "", "version", true, &version));
    if (version != lx_manifest_version) {
        result = lx_fail(error, LX_ERROR_UNSUPPORTED, "version %u was written by another Luxel; this one reads version %d", version,
                         lx_manifest_version);
        goto cleanup;
    }
    LX_TRY(get_text(&r, root, "", "generator", "", &manifest.generator));
    if (json_object_get(root, "scene")) LX_TRY(get_path(&r, root, "", "scene", &manifest.scene));
    LX_TRY(get_path(&r, root, "", "pack", &manifest.pack));
    LX_TRY(read_pages(&r, root));
    LX_TRY(read_layers(&r, root));
    LX_TRY(read_files(&r, root));
    LX_TRY(read_monitors(&r, root));
    LX_TRY(read_animations(&r, root));
    LX_TRY(read_sky(&r, root));
    LX_TRY(read_view(&r, root));
    LX_TRY(read_bake(&r, root));
    if (manifest.scene) LX_TRY(read_hash(&r, root, manifest.scene, &manifest.scene_hash));
    LX_TRY(read_hash(&r, root, manifest.pack, &manifest.pack_hash));
    *out = manifest;
    manifest = (lx_manifest){0};
cleanup:
    json_decref(root);
    lx_manifest_release(&manifest);
    return result;
}
