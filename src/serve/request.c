#include "serve/request.h"

#include <string.h>

// ---- paths

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

// Undoes %41 once, and refuses what no file of ours has in its name: an escaped slash among it.
static int decode(const char *target, char out[lx_request_path_bytes])
{
    size_t length = 0;
    for (const char *c = target; *c && *c != '?' && *c != '#'; ++c) {
        unsigned char byte = (unsigned char)*c;
        bool escaped = false;
        if (byte == '%') {
            const int high = hex_digit(c[1]), low = high < 0 ? -1 : hex_digit(c[2]);
            if (low < 0) return 400;
            byte = (unsigned char)(high * 16 + low);
            escaped = true;
            c += 2;
        }
        if (byte < 0x20 || byte == 0x7f || byte == '\\' || (escaped && byte == '/')) return 403;
        if (length + 1 == lx_request_path_bytes) return 404;
        out[length++] = (char)byte;
    }
    out[length] = '\0';
    return 200;
}

static int check_names(const char *path)
{
    int status = 200;
    for (const char *name = path;;) {
        const size_t length = strcspn(name, "/");
        if (name[0] == '.') return 403;
        if (length == 0) status = 404; // a folder, or two slashes
        if (name[length] == '\0') return status;
        name += length + 1;
    }
}

int lx_request_resolve(const char *target, lx_site_folder *out_folder, char out_path[lx_request_path_bytes])
{
    static const char baked[] = "baked";
    char decoded[lx_request_path_bytes];
    if (target[0] != '/') return 400;
    int status = decode(target + 1, decoded);
    if (status != 200) return status;
    const char *path = decoded[0] ? decoded : "index.html";
    lx_site_folder folder = LX_SITE_VIEWER;
    if (strncmp(path, baked, sizeof baked - 1) == 0 && (path[sizeof baked - 1] == '/' || path[sizeof baked - 1] == '\0')) {
        if (path[sizeof baked - 1] == '\0') return 404; // also where a viewer has such a folder or file
        folder = LX_SITE_BAKED;
        path += sizeof baked;
    }
    status = check_names(path);
    if (status != 200) return status;
    memmove(out_path, path, strlen(path) + 1);
    *out_folder = folder;
    return 200;
}

// ---- headers

static char lower(char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c + ('a' - 'A')) : c;
}

static bool starts_with_ignoring_case(const char *text, const char *prefix)
{
    for (; *prefix; ++prefix, ++text)
        if (lower(*text) != *prefix) return false;
    return true;
}

bool lx_request_host_is_loopback(const char *host)
{
    static const char *const names[] = {"localhost", "127.0.0.1", "[::1]"};
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
        if (!starts_with_ignoring_case(host, names[i])) continue;
        const char *rest = host + strlen(names[i]);
        if (*rest == '\0') return true;
        // Any port: it may have been forwarded.
        return rest[0] == ':' && rest[1] && strlen(rest) <= 6 && strspn(rest + 1, "0123456789") == strlen(rest + 1);
    }
    return false;
}

const char *lx_request_content_type(const char *path)
{
    static const struct {
        const char *ending, *type;
    } types[] = {
        {"html", "text/html; charset=utf-8"},
        {"js", "text/javascript; charset=utf-8"},
        {"mjs", "text/javascript; charset=utf-8"},
        {"css", "text/css; charset=utf-8"},
        {"json", "application/json"},
        {"map", "application/json"},
        {"webmanifest", "application/manifest+json"},
        {"txt", "text/plain; charset=utf-8"},
        {"wasm", "application/wasm"},
        {"glb", "model/gltf-binary"},
        {"gltf", "model/gltf+json"},
        {"ktx2", "image/ktx2"},
        {"hdr", "image/vnd.radiance"},
        {"exr", "image/x-exr"},
        {"png", "image/png"},
        {"jpg", "image/jpeg"},
        {"jpeg", "image/jpeg"},
        {"webp", "image/webp"},
        {"svg", "image/svg+xml"},
        {"ico", "image/x-icon"},
        {"mp4", "video/mp4"},
        {"webm", "video/webm"},
        {"woff2", "font/woff2"},
    };
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < sizeof types / sizeof *types; ++i)
        if (starts_with_ignoring_case(dot + 1, types[i].ending) && strlen(dot + 1) == strlen(types[i].ending)) return types[i].type;
    return "application/octet-stream";
}

bool lx_request_etag_matches(const char *header, const char *etag)
{
    const size_t length = strlen(etag);
    for (const char *c = header;;) {
        c += strspn(c, " \t,");
        if (*c == '\0') return false;
        if (*c == '*') return true;
        if (c[0] == 'W' && c[1] == '/') c += 2;
        if (*c != '"') return false; // no list of tags
        const char *end = strchr(c + 1, '"');
        if (!end) return false;
        if ((size_t)(end + 1 - c) == length && memcmp(c, etag, length) == 0) return true;
        c = end + 1;
    }
}

// Digits only; what does not fit 64 bits counts as very far.
static const char *read_number(const char *text, uint64_t *out)
{
    uint64_t value = 0;
    const char *c = text;
    for (; *c >= '0' && *c <= '9'; ++c) {
        const uint64_t digit = (uint64_t)(*c - '0');
        value = value > (UINT64_MAX - digit) / 10 ? UINT64_MAX : 10 * value + digit;
    }
    *out = value;
    return c == text ? NULL : c;
}

int lx_request_range(const char *header, uint64_t size, uint64_t *out_first, uint64_t *out_last)
{
    if (!starts_with_ignoring_case(header, "bytes=")) return 200;
    const char *text = header + 6;
    uint64_t first, last = UINT64_MAX;
    if (text[0] == '-') { // the last so many bytes
        const char *end = read_number(text + 1, &last);
        if (!end || *end) return 200;
        if (last == 0 || size == 0) return 416;
        first = last < size ? size - last : 0;
        last = size - 1;
    } else {
        const char *end = read_number(text, &first);
        if (!end || *end != '-') return 200;
        if (end[1]) {
            end = read_number(end + 1, &last);
            if (!end || *end || last < first) return 200;
        }
        if (first >= size) return 416;
        if (last >= size) last = size - 1;
    }
    *out_first = first;
    *out_last = last;
    return 206;
}
