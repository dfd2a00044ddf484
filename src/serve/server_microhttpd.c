// HTTP through libmicrohttpd: its one thread asks site.c what to answer. No request is worth much here, so limits are low: they keep
// nonsense from eating memory or handles.
#include "luxel/serve.h"

#include "base/error.h"
#include "base/memory.h"
#include "base/socket.h"
#include "serve/site.h"

#include <microhttpd.h>
#include <stdio.h>
#include <string.h>

enum {
    header_bytes_max = 32 * 1024, // of a request; a browser needs about one
    connections_max = 256,        // a browser opens six
    idle_seconds_max = 15,
};

struct lx_server {
    struct MHD_Daemon *daemon;
    uint32_t port;
    char url[32];
    char *viewer, *baked; // owned
    lx_site site;
};

// ---- one request

typedef struct host_header {
    const char *value;
    int count;
} host_header;

static bool same_ignoring_case(const char *text, const char *lower)
{
    for (; *lower; ++text, ++lower)
        if ((*text >= 'A' && *text <= 'Z' ? *text + ('a' - 'A') : *text) != *lower) return false;
    return *text == '\0';
}

static enum MHD_Result note_host(void *user, enum MHD_ValueKind kind, const char *key, const char *value)
{
    (void)kind;
    host_header *host = user;
    if (same_ignoring_case(key, "host")) {
        host->value = value;
        ++host->count;
    }
    return MHD_YES;
}

static lx_request read_request(struct MHD_Connection *connection, const char *method, const char *target)
{
    host_header host = {0};
    MHD_get_connection_values(connection, MHD_HEADER_KIND, note_host, &host);
    const char *length = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_CONTENT_LENGTH);
    return (lx_request){
        .method = method,
        .target = target,
        .host = host.count == 1 ? host.value : NULL,
        .if_none_match = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_IF_NONE_MATCH),
        .range = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_RANGE),
        .if_range = MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_IF_RANGE),
        .has_body = (length && strcmp(length, "0") != 0) ||
                    MHD_lookup_connection_value(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_TRANSFER_ENCODING),
    };
}

// Takes over the answer's file. NULL: no memory.
static struct MHD_Response *create_response(lx_answer *answer)
{
    struct MHD_Response *response =
        answer->file.handle >= 0
            ? MHD_create_response_from_fd_at_offset64(answer->size, answer->file.handle, answer->offset)
            : MHD_create_response_from_buffer(answer->text ? strlen(answer->text) : 0, (void *)answer->text, MHD_RESPMEM_PERSISTENT);
    if (!response) {
        lx_open_file_close(&answer->file);
        return NULL;
    }
    bool ok = true;
    for (size_t i = 0; lx_site_headers[i][0]; ++i)
        ok = ok && MHD_add_response_header(response, lx_site_headers[i][0], lx_site_headers[i][1]) == MHD_YES;
    ok = ok && MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_TYPE, answer->content_type) == MHD_YES;
    if (answer->etag[0]) {
        ok = ok && MHD_add_response_header(response, MHD_HTTP_HEADER_ETAG, answer->etag) == MHD_YES;
        ok = ok && MHD_add_response_header(response, MHD_HTTP_HEADER_ACCEPT_RANGES, "bytes") == MHD_YES;
    }
    if (answer->content_range[0])
        ok = ok && MHD_add_response_header(response, MHD_HTTP_HEADER_CONTENT_RANGE, answer->content_range) == MHD_YES;
    if (answer->status == MHD_HTTP_METHOD_NOT_ALLOWED)
        ok = ok && MHD_add_response_header(response, MHD_HTTP_HEADER_ALLOW, "GET, HEAD") == MHD_YES;
    if (ok) return response;
    MHD_destroy_response(response);
    return NULL;
}

// Called when the headers are there, and again when the request is whole. What is refused is refused the first time, so that no body has
// to be waited for; an answer at that moment also closes the connection.
static enum MHD_Result on_request(void *user, struct MHD_Connection *connection, const char *target, const char *method,
                                  const char *version, const char *upload, size_t *upload_bytes, void **state)
{
    static char seen;
    (void)version;
    (void)upload;
    const lx_server *server = user;
    lx_answer answer;
    const lx_request request = read_request(connection, method, target);
    const bool first = *state == NULL;
    const bool may_pass = !request.has_body && (strcmp(method, "GET") == 0 || strcmp(method, "HEAD") == 0);
    *state = &seen;
    if (first && may_pass) return MHD_YES;
    *upload_bytes = 0;
    lx_site_answer(&server->site, &request, &answer);
    struct MHD_Response *response = create_response(&answer);
    if (!response) return MHD_NO; // closes the connection
    const enum MHD_Result result = MHD_queue_response(connection, (unsigned)answer.status, response);
    MHD_destroy_response(response);
    return result;
}

// Escapes stay as they were sent: request.c undoes them, once, and sees what was an escape.
static size_t keep_escapes(void *user, struct MHD_Connection *connection, char *text)
{
    (void)user;
    (void)connection;
    return strlen(text);
}

// ---- the server

lx_result lx_server_create(const char *viewer, const char *baked, uint32_t port, lx_server **out_server, lx_error *error)
{
    lx_result result = LX_OK;
    int listener = -1;
    lx_server *server = lx_calloc_array(1, sizeof *server);
    if (!server) return lx_fail_memory(error, "server");
    server->viewer = lx_strdup(viewer);
    server->baked = lx_strdup(baked);
    if (!server->viewer || !server->baked) {
        result = lx_fail_memory(error, "server");
        goto cleanup;
    }
    server->site = (lx_site){.folders = {[LX_SITE_VIEWER] = server->viewer, [LX_SITE_BAKED] = server->baked}};
    LX_TRY(lx_socket_listen_loopback(port, &listener, &server->port, error));
    snprintf(server->url, sizeof server->url, "http://127.0.0.1:%u/", server->port);
    server->daemon = MHD_start_daemon(MHD_USE_AUTO_INTERNAL_THREAD, 0, NULL, NULL, on_request, server,
                                      MHD_OPTION_LISTEN_SOCKET, listener,
                                      MHD_OPTION_UNESCAPE_CALLBACK, keep_escapes, NULL,
                                      MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)header_bytes_max,
                                      MHD_OPTION_CONNECTION_LIMIT, (unsigned)connections_max,
                                      MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)idle_seconds_max,
                                      MHD_OPTION_STRICT_FOR_CLIENT, 1,
                                      MHD_OPTION_END);
    if (!server->daemon) {
        result = lx_fail(error, LX_ERROR_BACKEND, "the HTTP server does not start");
        goto cleanup;
    }
    listener = -1; // the daemon closes it
    *out_server = server;
    server = NULL;
cleanup:
    lx_socket_close(listener);
    lx_server_destroy(server);
    return result;
}

uint32_t lx_server_port(const lx_server *server)
{
    return server->port;
}

const char *lx_server_url(const lx_server *server)
{
    return server->url;
}

void lx_server_destroy(lx_server *server)
{
    if (!server) return;
    if (server->daemon) MHD_stop_daemon(server->daemon);
    lx_free(server->viewer);
    lx_free(server->baked);
    lx_free(server);
}
