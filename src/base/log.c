#include "base/log.h"

#include "base/memory.h"
#include "base/thread.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

struct lx_log {
    lx_logger logger;
    lx_mutex *mutex;
    char **warnings;
    size_t warning_count, warning_capacity;
};

static void write_to_stderr(void *user, lx_log_level level, const char *message)
{
    (void)user;
    fprintf(stderr, "luxel: %s: %s\n", level == LX_LOG_WARNING ? "warning" : "note", message);
}

lx_log *lx_log_create(lx_logger logger)
{
    lx_log *log = lx_calloc_array(1, sizeof *log);
    if (!log) return NULL;
    log->logger = logger;
    if (!log->logger.func) log->logger.func = write_to_stderr;
    log->mutex = lx_mutex_create();
    if (!log->mutex) {
        lx_free(log);
        return NULL;
    }
    return log;
}

void lx_log_destroy(lx_log *log)
{
    if (!log) return;
    for (size_t i = 0; i < log->warning_count; ++i) lx_free(log->warnings[i]);
    lx_free(log->warnings);
    lx_mutex_destroy(log->mutex);
    lx_free(log);
}

static void write_line(lx_log *log, lx_log_level level, const char *format, va_list arguments)
{
    if (!log) return;
    char line[1024];
    vsnprintf(line, sizeof line, format, arguments);
    for (char *c = line; *c; ++c)
        if ((unsigned char)*c < 0x20 || *c == 0x7f) *c = '?';
    lx_mutex_lock(log->mutex);
    if (level == LX_LOG_WARNING &&
        lx_array_reserve(&log->warnings, &log->warning_capacity, log->warning_count + 1, sizeof *log->warnings)) {
        char *copy = lx_strdup(line);
        if (copy) log->warnings[log->warning_count++] = copy;
    }
    log->logger.func(log->logger.user, level, line);
    lx_mutex_unlock(log->mutex);
}

void lx_log_note(lx_log *log, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    write_line(log, LX_LOG_NOTE, format, arguments);
    va_end(arguments);
}

void lx_log_warning(lx_log *log, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    write_line(log, LX_LOG_WARNING, format, arguments);
    va_end(arguments);
}

size_t lx_log_warning_count(lx_log *log)
{
    if (!log) return 0;
    lx_mutex_lock(log->mutex);
    const size_t count = log->warning_count;
    lx_mutex_unlock(log->mutex);
    return count;
}

const char *lx_log_warning_text(lx_log *log, size_t index)
{
    lx_mutex_lock(log->mutex);
    const char *text = index < log->warning_count ? log->warnings[index] : "";
    lx_mutex_unlock(log->mutex);
    return text;
}
