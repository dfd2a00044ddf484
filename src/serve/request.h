/// What a browser asks for, as text: which file it means, and which part of it. Pure functions on hostile strings; no system calls.
#ifndef LX_SERVE_REQUEST_H
#define LX_SERVE_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { lx_request_path_bytes = 1024 };

typedef enum lx_site_folder {
    LX_SITE_VIEWER, ///< `/`
    LX_SITE_BAKED,  ///< `/baked/`
} lx_site_folder;

/// From a request target as it was sent (`/baked/scene.glb?x`, escapes and all) to a folder and a path in it: names with single slashes
/// between, none empty, none with a dot in front (so no `..`, and no `.work`), no backslash, no control character. `/` is index.html.
/// Returns the HTTP status: 200, 400 (no such escape, no `/` in front), 403 (a path that Luxel never serves) or 404.
int lx_request_resolve(const char *target, lx_site_folder *out_folder, char out_path[lx_request_path_bytes]);

/// True for `localhost`, `127.0.0.1` and `[::1]`, with or without a port: what the Host header of an honest browser says. A page
/// elsewhere whose name was made to point here (DNS rebinding) says its own name.
bool lx_request_host_is_loopback(const char *host);

/// Content type by the file's ending, `application/octet-stream` if it is not known.
const char *lx_request_content_type(const char *path);

/// True if an If-None-Match header (a list, `*`, weak or not) names `etag`, which has its quotes.
bool lx_request_etag_matches(const char *header, const char *etag);

/// A Range header over `size` bytes: 206 and the part, 416 if it begins behind the end, 200 (send everything) for what is no single
/// range of bytes. The last byte counts in.
int lx_request_range(const char *header, uint64_t size, uint64_t *out_first, uint64_t *out_last);

#endif
