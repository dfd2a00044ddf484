#include "serve/site.h"

#include <stdio.h>
#include <string.h>

// blob: and data: are pictures and videos dropped on the page and what a loader unpacks from a .glb; unsafe-inline is for styles alone.
const char *const lx_site_headers[][2] = {
    {"Content-Security-Policy", "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
                                "img-src 'self' blob: data:; media-src 'self' blob: data:; connect-src 'self' blob: data:; "
                                "worker-src 'self' blob:; font-src 'self' data:; object-src 'none'; base-uri 'none'; "
                                "form-action 'none'; frame-ancestors 'none'"},
    {"Cross-Origin-Opener-Policy", "same-origin"},
    {"Cross-Origin-Embedder-Policy", "require-corp"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"X-Content-Type-Options", "nosniff"},
    {"Referrer-Policy", "no-referrer"},
    {"Cache-Control", "no-cache"},
    {NULL, NULL},
};

static void answer_text(lx_answer *out, int status, const char *text)
{
    *out = (lx_answer){.status = status, .content_type = "text/plain; charset=utf-8", .text = text, .file = {.handle = -1}};
}

static void answer_error(lx_answer *out, int status)
{
    answer_text(out, status, status == 400   ? "400 Bad Request\n"
                             : status == 403 ? "403 Forbidden\n"
                             : status == 405 ? "405 Method Not Allowed\n"
                                             : "404 Not Found\n");
}

// Whether the part that is asked for is still a part of this content. Dates are not understood: all of it is sent then. HEAD has no parts
// (RFC 9110, 14.2).
static bool range_applies(const lx_request *request, const char *etag)
{
    return request->range && strcmp(request->method, "GET") == 0 && (!request->if_range || strcmp(request->if_range, etag) == 0);
}

static void choose_part(const lx_request *request, lx_answer *out)
{
    const uint64_t size = out->file.size;
    uint64_t first = 0, last = 0;
    const int status = range_applies(request, out->etag) ? lx_request_range(request->range, size, &first, &last) : 200;
    if (status == 206) {
        out->status = 206;
        out->offset = first;
        out->size = last - first + 1;
        snprintf(out->content_range, sizeof out->content_range, "bytes %llu-%llu/%llu", (unsigned long long)first,
                 (unsigned long long)last, (unsigned long long)size);
    } else if (status == 416) {
        lx_open_file_close(&out->file);
        answer_text(out, 416, "416 Range Not Satisfiable\n");
        snprintf(out->content_range, sizeof out->content_range, "bytes */%llu", (unsigned long long)size);
    }
}

void lx_site_answer(const lx_site *site, const lx_request *request, lx_answer *out)
{
    char path[lx_request_path_bytes];
    lx_site_folder folder;
    if (strcmp(request->method, "GET") != 0 && strcmp(request->method, "HEAD") != 0) {
        answer_error(out, 405);
        return;
    }
    if (!request->host || !lx_request_host_is_loopback(request->host)) {
        answer_error(out, 403);
        return;
    }
    const int status = request->has_body ? 400 : lx_request_resolve(request->target, &folder, path);
    if (status != 200) {
        answer_error(out, status);
        return;
    }
    lx_open_file file;
    if (lx_file_open_below(site->folders[folder], path, &file, NULL) != LX_OK) {
        answer_error(out, 404);
        return;
    }
    *out = (lx_answer){.status = 200, .content_type = lx_request_content_type(path), .file = file, .size = file.size};
    snprintf(out->etag, sizeof out->etag, "\"%llx-%llx-%llx\"", (unsigned long long)file.number, (unsigned long long)file.size,
             (unsigned long long)file.modified_ns);
    if (request->if_none_match && lx_request_etag_matches(request->if_none_match, out->etag)) {
        lx_open_file_close(&out->file);
        out->status = 304;
        out->size = 0;
        return;
    }
    choose_part(request, out);
}
