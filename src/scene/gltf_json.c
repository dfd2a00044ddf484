// Typed access to the JSON of a glTF file.
#include "scene/gltf_json.h"

#include "base/error.h"
#include "scene/gltf.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// jansson parses and frees recursively; a real scene nests some ten deep, extras perhaps more.
enum { max_nesting = 512, max_label_name = 64 };

static lx_result check_nesting(const char *text, size_t size, lx_error *error)
{
    uint32_t depth = 0;
    bool in_string = false;
    for (size_t i = 0; i < size; ++i) {
        const char c = text[i];
        if (in_string) {
            if (c == '\\')
                ++i;
            else if (c == '"')
                in_string = false;
        } else if (c == '"') {
            in_string = true;
        } else if (c == '{' || c == '[') {
            if (++depth > max_nesting)
                return lx_fail(error, LX_ERROR_LIMIT, "JSON: nested deeper than %d levels", max_nesting);
        } else if ((c == '}' || c == ']') && depth > 0) {
            --depth;
        }
    }
    return LX_OK;
}

lx_result lx_gltf_json_parse(const char *text, size_t size, json_t **out_root, lx_error *error)
{
    if (size >= 3 && memcmp(text, "\xef\xbb\xbf", 3) == 0) {
        text += 3;
        size -= 3;
    }
    while (size > 0 && text[size - 1] == '\0') --size; // some exporters pad the chunk with zeros instead of spaces
    lx_result result = check_nesting(text, size, error);
    if (result != LX_OK) return result;
    json_error_t problem;
    json_t *root = json_loadb(text, size, 0, &problem);
    if (!root) {
        if (json_error_code(&problem) == json_error_out_of_memory) return lx_fail_memory(error, "JSON");
        return lx_fail(error, LX_ERROR_FORMAT, "JSON: line %d: %s", problem.line, problem.text);
    }
    if (!json_is_object(root)) {
        json_decref(root);
        return lx_fail(error, LX_ERROR_FORMAT, "JSON: not an object");
    }
    *out_root = root;
    return LX_OK;
}

void lx_gltf_document_release(struct json_t *root) { json_decref(root); }

// Bytes of `text` to show when at most `limit` are wanted, without cutting a UTF-8 sequence.
static int shown_length(const char *text, size_t limit)
{
    size_t length = strlen(text);
    if (length <= limit) return (int)length;
    length = limit;
    while (length > 0 && ((unsigned char)text[length] & 0xc0) == 0x80) --length;
    return (int)length;
}

lx_gltf_object lx_gltf_object_of(json_t *json, const char *kind, uint32_t index)
{
    lx_gltf_object object = {.json = json};
    const char *name = json_string_value(json_object_get(json, "name"));
    if (name && name[0])
        snprintf(object.label, sizeof object.label, "%s %u '%.*s'", kind, index, shown_length(name, max_label_name),
                 name);
    else
        snprintf(object.label, sizeof object.label, "%s %u", kind, index);
    return object;
}

lx_gltf_object lx_gltf_object_inside(const lx_gltf_object *parent, json_t *json, const char *what)
{
    lx_gltf_object object = {.json = json};
    const int room = (int)sizeof object.label - 2 - shown_length(what, max_label_name);
    snprintf(object.label, sizeof object.label, "%.*s %.*s", shown_length(parent->label, (size_t)room), parent->label,
             shown_length(what, max_label_name), what);
    return object;
}

lx_gltf_object lx_gltf_extension(const lx_gltf_object *object, const char *name)
{
    json_t *extension = json_object_get(json_object_get(object->json, "extensions"), name);
    return lx_gltf_object_inside(object, json_is_object(extension) ? extension : NULL, name);
}

static lx_result wrong_type(const lx_gltf_object *object, const char *key, const char *wanted, lx_error *error)
{
    return lx_fail(error, LX_ERROR_FORMAT, "%s: '%s' is not %s", object->label, key, wanted);
}

lx_result lx_gltf_get_object(const lx_gltf_object *object, const char *key, lx_gltf_object *out, lx_error *error)
{
    json_t *value = json_object_get(object->json, key);
    if (value && !json_is_object(value)) return wrong_type(object, key, "an object", error);
    *out = lx_gltf_object_inside(object, value, key);
    return LX_OK;
}

lx_result lx_gltf_get_array(const lx_gltf_object *object, const char *key, json_t **out, uint32_t *count,
                            lx_error *error)
{
    json_t *value = json_object_get(object->json, key);
    if (value && !json_is_array(value)) return wrong_type(object, key, "an array", error);
    const size_t size = json_array_size(value);
    if (size > INT32_MAX) return lx_fail(error, LX_ERROR_LIMIT, "%s: '%s' has too many elements", object->label, key);
    *out = value;
    *count = (uint32_t)size;
    return LX_OK;
}

lx_result lx_gltf_get_string(const lx_gltf_object *object, const char *key, const char **value, lx_error *error)
{
    const json_t *json = json_object_get(object->json, key);
    if (!json) return LX_OK;
    if (!json_is_string(json)) return wrong_type(object, key, "a string", error);
    *value = json_string_value(json);
    return LX_OK;
}

lx_result lx_gltf_get_bool(const lx_gltf_object *object, const char *key, bool *value, lx_error *error)
{
    const json_t *json = json_object_get(object->json, key);
    if (!json) return LX_OK;
    if (!json_is_boolean(json)) return wrong_type(object, key, "true or false", error);
    *value = json_is_true(json);
    return LX_OK;
}

// JSON has no NaN, but 1e300 is more than a float holds.
static bool to_float(const json_t *json, float *out)
{
    if (!json_is_number(json)) return false;
    *out = (float)json_number_value(json);
    return isfinite(*out);
}

lx_result lx_gltf_get_float(const lx_gltf_object *object, const char *key, float *value, lx_error *error)
{
    const json_t *json = json_object_get(object->json, key);
    if (!json || to_float(json, value)) return LX_OK;
    return wrong_type(object, key, "a finite number", error);
}

lx_result lx_gltf_get_floats(const lx_gltf_object *object, const char *key, float *values, uint32_t count,
                             bool *present, lx_error *error)
{
    const json_t *json = json_object_get(object->json, key);
    if (present) *present = json != NULL;
    if (!json) return LX_OK;
    if (!json_is_array(json) || json_array_size(json) != count)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: '%s' is not an array of %u numbers", object->label, key, count);
    for (uint32_t i = 0; i < count; ++i)
        if (!to_float(json_array_get(json, i), &values[i]))
            return lx_fail(error, LX_ERROR_FORMAT, "%s: '%s' [%u] is not a finite number", object->label, key, i);
    return LX_OK;
}

// Whole numbers may be written as 3.0.
static bool to_size(const json_t *json, uint64_t *out)
{
    if (json_is_integer(json)) {
        const json_int_t value = json_integer_value(json);
        *out = (uint64_t)value;
        return value >= 0 && *out <= (1ull << 53);
    }
    if (!json_is_real(json)) return false;
    const double value = json_real_value(json);
    if (!(value >= 0 && value <= 0x1p53) || value != floor(value)) return false;
    *out = (uint64_t)value;
    return true;
}

lx_result lx_gltf_get_size(const lx_gltf_object *object, const char *key, uint64_t *value, lx_error *error)
{
    const json_t *json = json_object_get(object->json, key);
    uint64_t number;
    if (!json) return LX_OK;
    if (!to_size(json, &number)) return wrong_type(object, key, "a whole number of at least 0", error);
    *value = number;
    return LX_OK;
}

lx_result lx_gltf_index_of(const lx_gltf_object *object, const json_t *value, const char *what, uint32_t count,
                           uint32_t *index, lx_error *error)
{
    uint64_t number;
    if (!to_size(value, &number)) return wrong_type(object, what, "an index", error);
    if (number >= count)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %s %llu out of range (count %u)", object->label, what,
                       (unsigned long long)number, count);
    *index = (uint32_t)number;
    return LX_OK;
}

lx_result lx_gltf_get_index(const lx_gltf_object *object, const char *key, uint32_t count, int32_t *index,
                            lx_error *error)
{
    const json_t *json = json_object_get(object->json, key);
    *index = -1;
    if (!json) return LX_OK;
    uint32_t number = 0;
    const lx_result result = lx_gltf_index_of(object, json, key, count, &number, error);
    if (result == LX_OK) *index = (int32_t)number;
    return result;
}
