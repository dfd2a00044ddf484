/// Luxel: results, errors, logging, progress and the context. Everything else takes a context.
///
/// Conventions of all headers in this folder: handles are opaque pointers, `create`/`load` gives ownership and
/// `destroy` takes it (NULL is legal); every call that can fail returns an lx_result and fills an optional,
/// caller-owned lx_error with one sentence that names the object. Outputs are written on success only.
/// The library keeps no global state, never exits, and prints through the logger alone.
#ifndef LUXEL_BASE_H
#define LUXEL_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define LX_API __attribute__((visibility("default")))
#define LX_PRINTF(format_index, first_index) __attribute__((format(printf, format_index, first_index)))
#else
#define LX_API
#define LX_PRINTF(format_index, first_index)
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define LX_VERSION "0.1.0"

typedef enum lx_result {
    LX_OK = 0,
    LX_ERROR_INVALID_ARGUMENT, ///< The caller's values make no sense (command line: exit code 2).
    LX_ERROR_OUT_OF_MEMORY,    ///< An allocation failed (exit code 3).
    LX_ERROR_IO,               ///< The machine failed: disk full, permission, … (exit code 3).
    LX_ERROR_FORMAT,           ///< An input file is wrong (exit code 1).
    LX_ERROR_LIMIT,            ///< An input is larger than what is allowed (exit code 1).
    LX_ERROR_UNSUPPORTED,      ///< An input needs something Luxel does not do (exit code 1).
    LX_ERROR_BACKEND,          ///< A library underneath failed (exit code 3).
    LX_ERROR_CANCELLED,        ///< A progress sink returned false (exit code 130).
} lx_result;

/// Detail of a failure, owned by the caller. `message` is one line without a final full stop.
typedef struct lx_error {
    lx_result code;
    char message[512];
} lx_error;

/// English name of a result, e.g. "out of memory". Never NULL.
LX_API const char *lx_result_name(lx_result result);

typedef enum lx_log_level { LX_LOG_NOTE, LX_LOG_WARNING } lx_log_level;

/// Receives notes and warnings, one line each without a newline. May be called from any thread, never concurrently.
/// All zero: warnings and notes go to stderr as `luxel: warning: …`.
typedef struct lx_logger {
    void (*func)(void *user, lx_log_level level, const char *message);
    void *user;
} lx_logger;

typedef struct lx_progress {
    const char *stage;  ///< "import", "unwrap", "bake", … Valid during the call.
    double fraction;    ///< Share of the stage that is done, in [0, 1]; never falls within a stage.
    double seconds;     ///< Since the stage began.
} lx_progress;

/// Called now and then (at most some ten times a second) on the thread that called the library.
/// Returning false cancels: the call ends soon with LX_ERROR_CANCELLED and leaves nothing half-written. `func` NULL: silent.
typedef struct lx_progress_sink {
    bool (*func)(void *user, const lx_progress *progress);
    void *user;
} lx_progress_sink;

typedef struct lx_context lx_context;

typedef struct lx_context_desc {
    lx_logger logger;
    uint32_t thread_count; ///< Worker threads. 0 (default): one per core.
    const char *isa;       ///< Embree's instruction set: "sse2", "sse4.2", "avx", "avx2", "avx512"; NULL (default): the best there is.
} lx_context_desc;

LX_API lx_context_desc lx_context_desc_default(void);
LX_API lx_result lx_context_create(const lx_context_desc *desc, lx_context **out_context, lx_error *error);
LX_API void lx_context_destroy(lx_context *context);

#ifdef __cplusplus
}
#endif
#endif
