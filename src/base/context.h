/// What a context holds. Internal code borrows its log and its pool from here.
#ifndef LX_BASE_CONTEXT_H
#define LX_BASE_CONTEXT_H

#include "base/log.h"
#include "base/thread.h"

struct lx_context {
    lx_log *log;
    lx_pool *pool;
    char isa[16]; ///< "" = the best there is.
};

#endif
