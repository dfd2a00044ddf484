// Any text as a request: what is resolved must stay below its folder, and ranges within the file. The first line is the target, the second
// the Host header, the third both a Range and an If-None-Match header.
#include "serve/request.h"

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(int condition)
{
    if (!condition) abort();
}

static void check_path(const char *path)
{
    const size_t length = strlen(path);
    require(length > 0 && length < lx_request_path_bytes && path[0] != '/' && path[length - 1] != '/');
    require(!strchr(path, '\\') && !strstr(path, "//"));
    require(path[0] != '.' && !strstr(path, "/."));
    for (const char *c = path; *c; ++c) require((unsigned char)*c >= 0x20 && *c != 0x7f);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char *text = malloc(size + 1), path[lx_request_path_bytes];
    require(text != NULL);
    memcpy(text, data, size);
    text[size] = '\0';
    char *lines[3] = {text, text + size, text + size};
    for (int i = 1; i < 3; ++i) {
        char *end = strchr(lines[i - 1], '\n');
        if (!end) break;
        *end = '\0';
        lines[i] = end + 1;
    }
    lx_site_folder folder;
    const int status = lx_request_resolve(lines[0], &folder, path);
    require(status == 200 || status == 400 || status == 403 || status == 404);
    if (status == 200) {
        check_path(path);
        require(folder == LX_SITE_VIEWER || folder == LX_SITE_BAKED);
        require(lx_request_content_type(path) != NULL);
    }
    if (lx_request_host_is_loopback(lines[1])) require(strlen(lines[1]) < 16);
    lx_request_etag_matches(lines[2], "\"1-2-3\"");
    for (uint64_t file_bytes = 0; file_bytes < 2000; file_bytes = file_bytes * 7 + 1) {
        uint64_t first = UINT64_MAX, last = UINT64_MAX;
        const int range = lx_request_range(lines[2], file_bytes, &first, &last);
        require(range == 200 || range == 416 || (range == 206 && first <= last && last < file_bytes));
    }
    free(text);
    return 0;
}
