#include "base/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const char *lx_result_name(lx_result result)
{
    switch (result) {
    case LX_OK: return "ok";
    case LX_ERROR_INVALID_ARGUMENT: return "invalid argument";
    case LX_ERROR_OUT_OF_MEMORY: return "out of memory";
    case LX_ERROR_IO: return "input/output error";
    case LX_ERROR_FORMAT: return "invalid data";
    case LX_ERROR_LIMIT: return "limit exceeded";
    case LX_ERROR_UNSUPPORTED: return "unsupported";
    case LX_ERROR_BACKEND: return "library failure";
    case LX_ERROR_CANCELLED: return "cancelled";
    }
    return "unknown result";
}

// Names in files may hold anything; a message is one line, so control characters become '?'.
static void make_one_line(char *text)
{
    for (; *text; ++text)
        if ((unsigned char)*text < 0x20 || *text == 0x7f) *text = '?';
}

lx_result lx_fail(lx_error *error, lx_result code, const char *format, ...)
{
    if (error) {
        va_list arguments;
        va_start(arguments, format);
        error->code = code;
        vsnprintf(error->message, sizeof error->message, format, arguments);
        va_end(arguments);
        make_one_line(error->message);
    }
    return code;
}

void lx_error_prefix(lx_error *error, const char *format, ...)
{
    if (!error) return;
    char tail[sizeof error->message];
    memcpy(tail, error->message, sizeof tail);
    va_list arguments;
    va_start(arguments, format);
    const int head = vsnprintf(error->message, sizeof error->message, format, arguments);
    va_end(arguments);
    if (head >= 0 && (size_t)head + 2 < sizeof error->message) {
        const size_t used = (size_t)head;
        snprintf(error->message + used, sizeof error->message - used, ": %.*s", (int)(sizeof tail - used - 3), tail);
    }
    make_one_line(error->message);
}

lx_result lx_fail_memory(lx_error *error, const char *what)
{
    return lx_fail(error, LX_ERROR_OUT_OF_MEMORY, "out of memory (%s)", what);
}
