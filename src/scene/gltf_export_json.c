// Small helpers on jansson's DOM for the exporter.
#include "scene/gltf_export_private.h"

#include <string.h>

uint32_t lx_export_get_index(const json_t *object, const char *key, uint32_t missing)
{
    const json_t *value = json_object_get(object, key);
    const double number = json_is_number(value) ? json_number_value(value) : -1;
    return number >= 0 && number < (double)UINT32_MAX ? (uint32_t)number : missing;
}

size_t lx_export_get_size(const json_t *object, const char *key)
{
    const json_t *value = json_object_get(object, key);
    const double number = json_is_number(value) ? json_number_value(value) : 0;
    return number > 0 && number < 0x1p53 ? (size_t)number : 0;
}

static json_t *member_in(json_t *object, const char *key, json_t *fresh)
{
    json_t *member = json_object_get(object, key);
    if (member && json_typeof(member) == json_typeof(fresh)) {
        json_decref(fresh);
        return member;
    }
    return json_object_set_new(object, key, fresh) == 0 ? fresh : NULL;
}

json_t *lx_export_object_in(json_t *object, const char *key)
{
    json_t *fresh = json_object();
    return fresh ? member_in(object, key, fresh) : NULL;
}

json_t *lx_export_array_in(json_t *object, const char *key)
{
    json_t *fresh = json_array();
    return fresh ? member_in(object, key, fresh) : NULL;
}

lx_result lx_export_set(json_t *object, const char *key, json_t *value, lx_error *error)
{
    return json_object_set_new(object, key, value) == 0 ? LX_OK : lx_fail_memory(error, "glTF document");
}

lx_result lx_export_append(json_t *array, json_t *value, lx_error *error)
{
    return json_array_append_new(array, value) == 0 ? LX_OK : lx_fail_memory(error, "glTF document");
}

void lx_export_unlist(json_t *document, const char *key, const char *name)
{
    json_t *list = json_object_get(document, key);
    for (size_t i = json_array_size(list); i-- > 0;) {
        const char *entry = json_string_value(json_array_get(list, i));
        if (entry && strcmp(entry, name) == 0) json_array_remove(list, i);
    }
    if (json_is_array(list) && json_array_size(list) == 0) json_object_del(document, key);
}

json_t *lx_export_extension(const json_t *object, const char *name)
{
    return json_object_get(json_object_get(object, "extensions"), name);
}

bool lx_export_drop_extension(json_t *object, const char *name)
{
    json_t *extensions = json_object_get(object, "extensions");
    if (json_object_del(extensions, name) != 0) return false;
    if (json_object_size(extensions) == 0) json_object_del(object, "extensions");
    return true;
}
