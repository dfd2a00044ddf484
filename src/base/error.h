/// Filling lx_error and leaving a function early with one cleanup label.
#ifndef LX_BASE_ERROR_H
#define LX_BASE_ERROR_H

#include "luxel/base.h"

/// Writes code and message into `error` (may be NULL) and returns the code.
lx_result lx_fail(lx_error *error, lx_result code, const char *format, ...) LX_PRINTF(3, 4);

/// Puts "context: " in front of the message that is already in `error`.
void lx_error_prefix(lx_error *error, const char *format, ...) LX_PRINTF(2, 3);

lx_result lx_fail_memory(lx_error *error, const char *what);

/// Runs `expression`; if it fails, stores the code in the local `result` and jumps to the local label `cleanup`.
#define LX_TRY(expression)                                                                                             \
    do {                                                                                                               \
        result = (expression);                                                                                         \
        if (result != LX_OK) goto cleanup;                                                                             \
    } while (0)

#endif
