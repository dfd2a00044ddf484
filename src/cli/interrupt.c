#include "interrupt.h"

#include <signal.h>

static volatile sig_atomic_t interrupted;

static void note_interrupt(int signal_number)
{
    interrupted = 1;
    signal(signal_number, SIG_DFL); // the next one is not caught
}

void cli_catch_interrupts(void)
{
    // Started in the background by a shell, SIGINT is ignored: leave it so.
    if (signal(SIGINT, SIG_IGN) != SIG_IGN) signal(SIGINT, note_interrupt);
    signal(SIGTERM, note_interrupt);
}

bool cli_interrupted(void)
{
    return interrupted != 0;
}
