/// What a command-line front end asks of the machine. Nothing here knows of light.
#ifndef LUXEL_HOST_H
#define LUXEL_HOST_H

#include "luxel/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/// True if stderr is a terminal, so that a line can be drawn over.
LX_API bool lx_host_stderr_is_terminal(void);
/// Columns of the terminal on stderr, 80 if unknown.
LX_API int lx_host_columns(void);

/// Monotonic seconds since some fixed moment.
LX_API double lx_host_seconds(void);
/// Largest resident size of this process so far, in bytes; 0 if the system does not tell.
LX_API uint64_t lx_host_peak_memory(void);

/// Checks early that `path` is a regular file that may be read. The message starts with the path.
LX_API lx_result lx_host_check_input(const char *path, lx_error *error);
/// Checks early that a file could be written at `path`: its folder exists and may be written, and it is no folder itself.
LX_API lx_result lx_host_check_output(const char *path, lx_error *error);

/// Waits; a signal may end it early.
LX_API void lx_host_sleep(double seconds);

/// The folder of the built viewer: $LUXEL_VIEWER if that is set, else `viewer` beside this program, else `../share/luxel/viewer` from there.
/// LX_ERROR_FORMAT if none of them holds an index.html. `size` bytes in `out`.
LX_API lx_result lx_host_find_viewer(char *out, size_t size, lx_error *error);

/// True if there is a display on which a browser could open.
LX_API bool lx_host_has_display(void);
/// Shows an address in the person's browser, which runs on its own. False: there is no program for it (xdg-open).
LX_API bool lx_host_open_browser(const char *url);

#ifdef __cplusplus
}
#endif
#endif
