/// Ctrl-C: the first one asks for a clean stop, the second ends the process at once.
#ifndef LX_CLI_INTERRUPT_H
#define LX_CLI_INTERRUPT_H

#include <stdbool.h>

/// From here on SIGINT and SIGTERM are noted instead of ending the process; long work asks cli_interrupted() now and then.
void cli_catch_interrupts(void);
bool cli_interrupted(void);

#endif
