// Authoring keys (`luxel_…`) in the extras of nodes, lights and materials. In Blender they are custom properties, so
// numbers, texts and check boxes come in whatever type a person happened to choose.
#include "scene/gltf_reader.h"

#include "base/error.h"
#include "math/color.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

lx_gltf_extras lx_gltf_extras_unset(void)
{
    return (lx_gltf_extras){.mode = -1, .is_static = -1, .transparent = -1, .radius = -1};
}

// Where a key is being read.
typedef struct key_site {
    lx_log *log;
    lx_arena *strings;
    const lx_gltf_object *object;
    const char *key;
    lx_gltf_extras *out;
} key_site;

static void warn(const key_site *site, const char *wanted)
{
    lx_log_warning(site->log, "%s: %s is not %s; ignored", site->object->label, site->key, wanted);
}

static lx_result read_layer(const key_site *site, const json_t *value, lx_error *error)
{
    const char *text = json_string_value(value);
    if (!text || !text[0]) {
        warn(site, "a name");
        return LX_OK;
    }
    site->out->layer = lx_arena_strdup(site->strings, text);
    return site->out->layer ? LX_OK : lx_fail_memory(error, "names");
}

static lx_result read_mode(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    static const char *const modes[] = {"baked", "mixed", "realtime"};
    const char *text = json_string_value(value);
    for (int8_t i = 0; text && i < 3; ++i)
        if (strcmp(text, modes[i]) == 0) {
            site->out->mode = i;
            return LX_OK;
        }
    warn(site, "'baked', 'mixed' or 'realtime'");
    return LX_OK;
}

static int8_t to_flag(const json_t *value)
{
    if (json_is_boolean(value)) return json_is_true(value);
    if (json_is_number(value)) {
        const double number = json_number_value(value);
        return number == 0 ? 0 : number == 1 ? 1 : -1;
    }
    const char *text = json_string_value(value);
    if (!text) return -1;
    return strcmp(text, "true") == 0 ? 1 : strcmp(text, "false") == 0 ? 0 : -1;
}

static lx_result read_flag(const key_site *site, const json_t *value, int8_t *flag)
{
    const int8_t read = to_flag(value);
    if (read < 0)
        warn(site, "true or false");
    else
        *flag = read;
    return LX_OK;
}

static lx_result read_static(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    return read_flag(site, value, &site->out->is_static);
}

static lx_result read_transparent(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    return read_flag(site, value, &site->out->transparent);
}

// A finite number, also written as text.
static bool to_number(const json_t *value, float *out)
{
    const char *text = json_string_value(value);
    double number = json_number_value(value);
    if (text) {
        char *end;
        number = strtod(text, &end);
        if (end == text || *end) return false;
    } else if (!json_is_number(value)) {
        return false;
    }
    *out = (float)number;
    return isfinite(*out);
}

static lx_result read_density(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    float number;
    if (to_number(value, &number) && number > 0)
        site->out->density = number;
    else
        warn(site, "a number above 0");
    return LX_OK;
}

static lx_result read_radius(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    float number;
    if (to_number(value, &number) && number >= 0)
        site->out->radius = number;
    else
        warn(site, "a number of at least 0");
    return LX_OK;
}

static lx_result read_intensity(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    float number;
    if (to_number(value, &number) && number >= 0) {
        site->out->intensity = number;
        site->out->has_intensity = true;
    } else {
        warn(site, "a number of at least 0");
    }
    return LX_OK;
}

static bool to_area(const char *text, lx_gltf_extras *out)
{
    float a, b;
    char extra;
    if (sscanf(text, " rect %f %f %c", &a, &b, &extra) == 2) {
        out->area = LX_AREA_RECT;
    } else if (sscanf(text, " disk %f %c", &a, &extra) == 1) {
        out->area = LX_AREA_DISK;
        b = a;
    } else {
        return false;
    }
    out->area_width = a;
    out->area_height = b;
    return a > 0 && b > 0 && isfinite(a) && isfinite(b);
}

static lx_result read_area(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    const char *text = json_string_value(value);
    if (text && to_area(text, site->out)) return LX_OK;
    site->out->area = LX_AREA_NONE;
    warn(site, "'rect WIDTH HEIGHT' or 'disk RADIUS' in metres");
    return LX_OK;
}

// "#rrggbb" in sRGB, or three linear numbers.
static bool to_color(const json_t *value, lx_rgb *out)
{
    const char *text = json_string_value(value);
    if (text) {
        unsigned r, g, b;
        if (strlen(text) != 7 || text[0] != '#' || strspn(text + 1, "0123456789abcdefABCDEF") != 6) return false;
        if (sscanf(text + 1, "%2x%2x%2x", &r, &g, &b) != 3) return false;
        *out = lx_rgb_of(lx_srgb_byte_to_linear[r], lx_srgb_byte_to_linear[g], lx_srgb_byte_to_linear[b]);
        return true;
    }
    return json_array_size(value) == 3 && to_number(json_array_get(value, 0), &out->r) &&
           to_number(json_array_get(value, 1), &out->g) && to_number(json_array_get(value, 2), &out->b) &&
           out->r >= 0 && out->g >= 0 && out->b >= 0;
}

static lx_result read_color(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    site->out->has_color = to_color(value, &site->out->color);
    if (!site->out->has_color) warn(site, "'#rrggbb' or three linear numbers");
    return LX_OK;
}

// "16x9": columns, then rows.
static lx_result read_monitor(const key_site *site, const json_t *value, lx_error *error)
{
    (void)error;
    const char *text = json_string_value(value);
    uint32_t columns, rows;
    char extra;
    if (text && sscanf(text, " %4u%*1[xX]%4u %c", &columns, &rows, &extra) == 2 && columns >= 1 && rows >= 1 &&
        columns <= lx_most_monitor_cells && rows <= lx_most_monitor_cells && columns * rows <= lx_most_monitor_cells) {
        site->out->monitor_columns = columns;
        site->out->monitor_rows = rows;
    } else {
        warn(site, "'COLUMNSxROWS' (16x9, say) with 4096 cells at most");
    }
    return LX_OK;
}

static lx_result read_animate(const key_site *site, const json_t *value, lx_error *error)
{
    const char *text = json_string_value(value);
    lx_error reason;
    lx_program program;
    if (!text) {
        warn(site, "a program ('flicker 0.2 low=0.5', say)");
        return LX_OK;
    }
    const lx_result result = lx_program_parse(text, site->strings, &program, &reason);
    if (result == LX_ERROR_OUT_OF_MEMORY) return lx_fail_memory(error, "programs");
    if (result != LX_OK) {
        lx_log_warning(site->log, "%s: %s: %s; ignored", site->object->label, site->key, reason.message);
        return LX_OK;
    }
    lx_program *kept = lx_arena_alloc(site->strings, 1, sizeof *kept);
    if (!kept) return lx_fail_memory(error, "programs");
    *kept = program;
    site->out->animate = kept;
    return LX_OK;
}

enum { node = LX_EXTRAS_NODE, light = LX_EXTRAS_LIGHT, material = LX_EXTRAS_MATERIAL };

static const struct {
    const char *key;
    int places;
    lx_result (*read)(const key_site *site, const json_t *value,
                      lx_error *error); ///< NULL: known, but not to the importer.
} keys[] = {
    {"luxel_layer", node | light | material, read_layer},
    {"luxel_mode", node | light | material, read_mode},
    {"luxel_static", node, read_static},
    {"luxel_density", node | material, read_density},
    {"luxel_scale_in_lightmap", node | material, read_density},
    {"luxel_transparent", node | material, read_transparent},
    {"luxel_radius", node | light, read_radius},
    {"luxel_area", node | light, read_area},
    {"luxel_color", node | light, read_color},
    {"luxel_intensity", node | light, read_intensity},
    {"luxel_monitor", node | material, read_monitor},
    {"luxel_animate", node | light | material, read_animate},
    {"luxel_probes", node, NULL},
    {"luxel_lightmap", node, NULL}, // what our own export writes
    {"luxel_baked", node | light | material, NULL},
};

enum { key_count = sizeof keys / sizeof *keys, longest_key = 64 };

// Levenshtein distance with one row; keys longer than any typing error of a known one are far away.
static size_t edit_distance(const char *a, const char *b)
{
    size_t row[longest_key + 1];
    const size_t length_a = strlen(a), length_b = strlen(b);
    if (length_a > longest_key || length_b > longest_key) return SIZE_MAX;
    for (size_t j = 0; j <= length_b; ++j) row[j] = j;
    for (size_t i = 1; i <= length_a; ++i) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= length_b; ++j) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            if (row[j] + 1 < best) best = row[j] + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            row[j] = best;
        }
    }
    return row[length_b];
}

static const char *nearest_key(const char *key)
{
    size_t best = SIZE_MAX;
    const char *nearest = keys[0].key;
    for (int i = 0; i < key_count; ++i) {
        const size_t distance = edit_distance(key, keys[i].key);
        if (distance >= best) continue;
        best = distance;
        nearest = keys[i].key;
    }
    return nearest;
}

static lx_result read_key(const key_site *site, const json_t *value, lx_extras_place place, lx_error *error)
{
    for (int i = 0; i < key_count; ++i) {
        if (strcmp(site->key, keys[i].key) != 0) continue;
        if (keys[i].places & (int)place) return keys[i].read ? keys[i].read(site, value, error) : LX_OK;
        lx_log_warning(site->log, "%s: %s has no effect here; it belongs to %s", site->object->label, site->key,
                       keys[i].places & material ? "a node or material" : "a node");
        return LX_OK;
    }
    lx_log_warning(site->log, "%s: unknown key %.64s; did you mean %s?", site->object->label, site->key,
                   nearest_key(site->key));
    return LX_OK;
}

lx_result lx_gltf_extras_read(struct lx_gltf_reader *reader, const lx_gltf_object *object, lx_extras_place place,
                              lx_gltf_extras *out, lx_error *error)
{
    *out = lx_gltf_extras_unset();
    const char *key;
    json_t *value;
    json_object_foreach(json_object_get(object->json, "extras"), key, value)
    {
        ++reader->extras_count;
        if (strncmp(key, "luxel_", 6) != 0) continue;
        const key_site site = {reader->log, &reader->scene->strings, object, key, out};
        const lx_result result = read_key(&site, value, place, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

lx_gltf_extras lx_gltf_extras_merge(lx_gltf_extras first, const lx_gltf_extras *second)
{
    if (!first.layer) first.layer = second->layer;
    if (first.mode < 0) first.mode = second->mode;
    if (first.is_static < 0) first.is_static = second->is_static;
    if (first.transparent < 0) first.transparent = second->transparent;
    if (first.density == 0) first.density = second->density;
    if (first.radius < 0) first.radius = second->radius;
    if (first.area == LX_AREA_NONE) {
        first.area = second->area;
        first.area_width = second->area_width;
        first.area_height = second->area_height;
    }
    if (!first.has_color) {
        first.has_color = second->has_color;
        first.color = second->color;
    }
    if (!first.has_intensity) {
        first.has_intensity = second->has_intensity;
        first.intensity = second->intensity;
    }
    if (!first.animate) first.animate = second->animate;
    if (first.monitor_columns == 0) {
        first.monitor_columns = second->monitor_columns;
        first.monitor_rows = second->monitor_rows;
    }
    return first;
}
