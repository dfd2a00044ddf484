/// Notes and warnings on their way to the caller's logger. One lx_log lives in each context.
#ifndef LX_BASE_LOG_H
#define LX_BASE_LOG_H

#include "luxel/base.h"

typedef struct lx_log lx_log;

lx_log *lx_log_create(lx_logger logger);
void lx_log_destroy(lx_log *log);

/// One line. Safe from any thread; `log` NULL drops it. Every warning is also kept (see lx_log_warning_count).
void lx_log_note(lx_log *log, const char *format, ...) LX_PRINTF(2, 3);
void lx_log_warning(lx_log *log, const char *format, ...) LX_PRINTF(2, 3);

/// The warnings so far, oldest first; borrowed, valid until the log is destroyed. For summaries and reports.
size_t lx_log_warning_count(lx_log *log);
const char *lx_log_warning_text(lx_log *log, size_t index);

#endif
