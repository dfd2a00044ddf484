#include "progress.h"

#include "interrupt.h"
#include "luxel/host.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { bar_columns_max = 50 };
static const double plain_interval_s = 5.0;

void cli_progress_init(cli_progress *progress, bool quiet)
{
    *progress = (cli_progress){.quiet = quiet, .terminal = lx_host_stderr_is_terminal()};
}

void cli_progress_clear(cli_progress *progress)
{
    if (atomic_exchange(&progress->drawn, false)) fputs("\r\033[K", stderr);
}

// "1:05 left", "2:03:00 left"; "" while it is too early to tell.
static void format_time_left(char *out, size_t size, double fraction, double seconds)
{
    *out = '\0';
    if (fraction < 0.01 || seconds < 0.5) return;
    const double left = ceil(seconds * (1.0 - fraction) / fraction);
    if (left > 360000.0) return;
    const unsigned whole = (unsigned)left;
    if (whole >= 3600)
        snprintf(out, size, "%u:%02u:%02u left", whole / 3600, whole / 60 % 60, whole % 60);
    else
        snprintf(out, size, "%u:%02u left", whole / 60, whole % 60);
}

static void draw_bar(cli_progress *progress, const lx_progress *now, const char *time_left)
{
    char bar[bar_columns_max + 1];
    int columns = lx_host_columns() - 32; // stage, share, time left
    if (columns > bar_columns_max) columns = bar_columns_max;
    if (columns < 0) columns = 0;
    const int full = (int)(now->fraction * columns);
    for (int i = 0; i < columns; ++i) bar[i] = i < full ? '#' : '.';
    bar[columns] = '\0';
    fprintf(stderr, "\r%-8.12s %s %3d %% %s\033[K", now->stage, bar, (int)(now->fraction * 100.0), time_left);
    fflush(stderr);
    atomic_store(&progress->drawn, true);
}

static bool on_progress(void *user, const lx_progress *now)
{
    cli_progress *const progress = user;
    if (cli_interrupted()) return false;
    if (progress->quiet) return true;
    const bool new_stage = strncmp(progress->stage, now->stage, sizeof progress->stage - 1) != 0;
    if (new_stage) {
        snprintf(progress->stage, sizeof progress->stage, "%s", now->stage);
        progress->last_seconds = 0.0;
    }
    char time_left[32];
    format_time_left(time_left, sizeof time_left, now->fraction, now->seconds);
    if (progress->terminal) {
        draw_bar(progress, now, time_left);
    } else if (now->seconds - progress->last_seconds >= plain_interval_s) {
        progress->last_seconds = now->seconds;
        fprintf(stderr, "luxel: %s %d %%%s%s\n", now->stage, (int)(now->fraction * 100.0), *time_left ? ", " : "",
                time_left);
    }
    return true;
}

lx_progress_sink cli_progress_sink(cli_progress *progress)
{
    return (lx_progress_sink){on_progress, progress};
}
