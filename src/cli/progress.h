/// Progress on stderr: a bar that is drawn over on a terminal, plain lines every few seconds elsewhere.
#ifndef LX_CLI_PROGRESS_H
#define LX_CLI_PROGRESS_H

#include "luxel/base.h"

#include <stdatomic.h>

typedef struct cli_progress {
    bool quiet;
    bool terminal;
    atomic_bool drawn;    ///< A bar stands on the terminal's last line. Log lines come from other threads.
    char stage[32];
    double last_seconds;  ///< When the last plain line was printed, in the stage's time.
} cli_progress;

void cli_progress_init(cli_progress *progress, bool quiet);

/// A sink for the library: shows what is done, and cancels after Ctrl-C.
lx_progress_sink cli_progress_sink(cli_progress *progress);

/// Removes the bar, so that a line can be printed; the next call of the sink draws it again.
void cli_progress_clear(cli_progress *progress);

#endif
