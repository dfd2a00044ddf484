/// The viewer: served on this machine, or exported as a site for any web server.
///
/// Both show the same layout: the built viewer at `/`, a baked folder at `/baked/`.
#ifndef LUXEL_SERVE_H
#define LUXEL_SERVE_H

#include "luxel/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/// A web server on 127.0.0.1, reading only, with a thread of its own. Nothing else of the disk can be reached through it, and no program
/// on another machine nor page of another host can use it.
typedef struct lx_server lx_server;

/// Starts to serve the folder `viewer` (the built viewer; see lx_host_find_viewer) and the folder `baked` below `/baked/`. A baked folder
/// that is replaced later shows its new content. `port` 0: any free one.
LX_API lx_result lx_server_create(const char *viewer, const char *baked, uint32_t port, lx_server **out_server, lx_error *error);
LX_API uint32_t lx_server_port(const lx_server *server);
/// "http://127.0.0.1:PORT/"; borrowed.
LX_API const char *lx_server_url(const lx_server *server);
/// Stops at once: transfers that are under way are cut.
LX_API void lx_server_destroy(lx_server *server);

typedef struct lx_web_export {
    uint32_t file_count;
    uint64_t bytes;
} lx_web_export;

/// Checks early that `folder` can be (re)placed by an export: its parent exists, and it is missing, empty or an earlier export to which
/// nothing was added.
LX_API lx_result lx_export_web_check(const char *folder, lx_error *error);
/// Writes viewer and baked folder into `folder` as a static site, all at once: the folder holds the old or the new site, never a mixture. All
/// its addresses are relative, so it works below any path of any web server. Of the baked folder only what the viewer shows is
/// copied. `out` may be NULL.
LX_API lx_result lx_export_web(const char *viewer, const char *baked, const char *folder, lx_web_export *out, lx_error *error);

#ifdef __cplusplus
}
#endif
#endif
