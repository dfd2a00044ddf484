/// Two folders as one web site, and what it answers to a request. Knows no sockets.
#ifndef LX_SERVE_SITE_H
#define LX_SERVE_SITE_H

#include "base/file.h"
#include "serve/request.h"

/// Paths, not handles: a folder that is replaced by a new bake shows its new content. Strings are borrowed.
typedef struct lx_site {
    const char *folders[2]; ///< By lx_site_folder.
} lx_site;

/// A header that is not there is NULL.
typedef struct lx_request {
    const char *method, *target; ///< As sent.
    const char *host;            ///< NULL also where there are several.
    const char *if_none_match, *range, *if_range;
    bool has_body;
} lx_request;

typedef struct lx_answer {
    int status;                ///< 200, 206, 304 and errors. Of an error the text is its body.
    const char *content_type;
    const char *text;          ///< Body where there is no file.
    lx_open_file file;         ///< Open for 200 and 206: the caller's to close.
    uint64_t offset, size;     ///< Part of the file that is the body.
    char etag[64];             ///< "": none.
    char content_range[80];    ///< "": none.
} lx_answer;

void lx_site_answer(const lx_site *site, const lx_request *request, lx_answer *out);

/// Headers of every answer, name then value: nothing may come from or go to another host, nobody may embed these pages, and nothing is
/// kept without asking again. Ends with a NULL name.
extern const char *const lx_site_headers[][2];

#endif
