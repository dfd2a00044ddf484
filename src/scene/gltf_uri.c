// Content named by URI: data: URIs and files in the scene's folder. A scene is untrusted, so nothing outside of that
// folder can be named, neither by the path nor through a symbolic link, and nothing is ever fetched.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <ctype.h>
#include <string.h>

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

// %41 → A. A percent sign without two digits stays: many exporters do not encode file names at all.
static size_t percent_decode(const char *text, size_t length, char *out)
{
    size_t used = 0;
    for (size_t i = 0; i < length; ++i) {
        const int high = text[i] == '%' && i + 2 < length ? hex_digit(text[i + 1]) : -1;
        const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
        if (low >= 0) {
            out[used++] = (char)(high * 16 + low);
            i += 2;
        } else {
            out[used++] = text[i];
        }
    }
    return used;
}

static int base64_value(char c)
{
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// `out` holds at least length / 4 * 3 + 3 bytes. White space is skipped, padding is optional. False: not base64.
static bool base64_decode(const char *text, size_t length, uint8_t *out, size_t *out_size)
{
    size_t used = 0, i = 0;
    uint32_t bits = 0;
    int bit_count = 0;
    for (; i < length && text[i] != '='; ++i) {
        if (isspace((unsigned char)text[i])) continue;
        const int value = base64_value(text[i]);
        if (value < 0) return false;
        bits = (bits << 6 | (uint32_t)value) & 0xffffff;
        bit_count += 6;
        if (bit_count < 8) continue;
        bit_count -= 8;
        out[used++] = (uint8_t)(bits >> bit_count);
    }
    for (; i < length; ++i)
        if (text[i] != '=' && !isspace((unsigned char)text[i])) return false;
    *out_size = used;
    return bit_count < 6;
}

static lx_result load_data_uri(const lx_gltf_reader *reader, const lx_gltf_object *object, const char *uri,
                               lx_bytes *out, lx_error *error)
{
    const char *comma = strchr(uri, ',');
    if (!comma) return lx_fail(error, LX_ERROR_FORMAT, "%s: data: URI without a comma", object->label);
    static const char marker[] = ";base64";
    const size_t marker_length = sizeof marker - 1, head = (size_t)(comma - uri);
    const bool base64 = head >= marker_length && memcmp(comma - marker_length, marker, marker_length) == 0;
    const size_t length = strlen(comma + 1);
    if (length / 4 > reader->max_file_bytes / 3)
        return lx_fail(error, LX_ERROR_LIMIT, "%s: data: URI is larger than the limit of %zu bytes", object->label,
                       reader->max_file_bytes);
    uint8_t *data = lx_malloc_array(length + 3, 1);
    if (!data) return lx_fail_memory(error, object->label);
    size_t size = 0;
    if (!base64) {
        size = percent_decode(comma + 1, length, (char *)data);
    } else if (!base64_decode(comma + 1, length, data, &size)) {
        lx_free(data);
        return lx_fail(error, LX_ERROR_FORMAT, "%s: data: URI is not valid base64", object->label);
    }
    *out = (lx_bytes){data, size};
    return LX_OK;
}

static bool has_scheme(const char *uri)
{
    if (!isalpha((unsigned char)uri[0])) return false;
    while (isalnum((unsigned char)*uri) || *uri == '+' || *uri == '-' || *uri == '.') ++uri;
    return *uri == ':';
}

// True if the path, read from its start, is ever above where it began. Backslashes count as slashes, to be safe
// everywhere.
static bool climbs_out(const char *path)
{
    long depth = 0;
    while (*path) {
        const size_t length = strcspn(path, "/\\");
        if (length == 2 && path[0] == '.' && path[1] == '.')
            --depth;
        else if (length > 0 && !(length == 1 && path[0] == '.'))
            ++depth;
        if (depth < 0) return true;
        path += length;
        path += *path != '\0';
    }
    return false;
}

static lx_result check_relative(const lx_gltf_object *object, const char *uri, const char *path, size_t length,
                                lx_error *error)
{
    const char *problem = NULL;
    if (length == 0)
        problem = "is empty";
    else if (strlen(path) != length)
        problem = "contains a zero byte";
    else if (path[0] == '/' || path[0] == '\\')
        problem = "is an absolute path";
    else if (climbs_out(path))
        problem = "leads out of the scene's folder";
    if (!problem) return LX_OK;
    return lx_fail(error, LX_ERROR_FORMAT, "%s: URI '%.200s' %s", object->label, uri, problem);
}

static lx_result load_file(lx_gltf_reader *reader, const lx_gltf_object *object, const char *relative, lx_bytes *out,
                           lx_error *error)
{
    char *path = lx_path_join(reader->folder, relative);
    if (!path) return lx_fail_memory(error, object->label);
    lx_result result = LX_OK;
    if (lx_path_exists(path) && !lx_path_is_inside(path, reader->folder)) {
        result = lx_fail(error, LX_ERROR_FORMAT, "%s: file '%.200s' is a link that leads out of the scene's folder",
                         object->label, relative);
    } else {
        result = lx_file_read(path, reader->max_file_bytes, out, error);
        if (result == LX_OK)
            lx_gltf_grant(reader, out->size);
        else
            lx_error_prefix(error, "%s: file '%.200s'", object->label, relative);
    }
    lx_free(path);
    return result;
}

lx_result lx_gltf_load_uri(lx_gltf_reader *reader, const lx_gltf_object *object, const char *uri, lx_bytes *out,
                           lx_error *error)
{
    if (strncmp(uri, "data:", 5) == 0) return load_data_uri(reader, object, uri, out, error);
    if (has_scheme(uri))
        return lx_fail(error, LX_ERROR_FORMAT, "%s: URI '%.200s' is not a relative path", object->label, uri);
    const size_t length = strlen(uri);
    char *path = lx_malloc_array(length + 1, 1);
    if (!path) return lx_fail_memory(error, object->label);
    const size_t decoded = percent_decode(uri, length, path);
    path[decoded] = '\0';
    lx_result result = check_relative(object, uri, path, decoded, error);
    if (result == LX_OK && !reader->folder)
        result =
            lx_fail(error, LX_ERROR_FORMAT, "%s: external file '%.200s' is not available here", object->label, path);
    if (result == LX_OK) result = load_file(reader, object, path, out, error);
    lx_free(path);
    return result;
}
