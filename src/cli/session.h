/// What every command that touches the library needs: a context, its warnings, its progress, and one way to report failures.
#ifndef LX_CLI_SESSION_H
#define LX_CLI_SESSION_H

#include "options.h"
#include "progress.h"

#include "luxel/bake.h"
#include "luxel/baked.h"

typedef struct cli_log_line {
    lx_log_level level;
    char *text; ///< Owned.
} cli_log_line;

typedef struct cli_session {
    bool quiet;                ///< --quiet: no progress, no notes. Warnings stay.
    lx_context_desc desc;      ///< --threads, --isa.
    lx_context *context;
    cli_progress progress;
    size_t warning_count;
    bool collect;              ///< Keep warnings and notes in `lines` instead of printing them (inspect).
    cli_log_line *lines;
    size_t line_count, line_capacity;
    double start_seconds;
} cli_session;

/// Options that fill a session. `session` is a variable.
#define CLI_SESSION_OPTIONS(session)                                                                                   \
    {.name = "threads", .argument = "N", .help = "worker threads (default: one per core)", .kind = CLI_UINT,           \
     .target = &(session).desc.thread_count, .min = 1, .max = 1024},                                                   \
    {.name = "isa", .argument = "NAME", .kind = CLI_TEXT, .target = &(session).desc.isa,                               \
     .help = "instruction set of the ray tracer: sse2, sse4.2, avx, avx2 or avx512 (default: the best there is)"},     \
    {.name = "quiet", .help = "no progress and no notes; warnings stay", .kind = CLI_FLAG, .target = &(session).quiet}

cli_session cli_session_default(void);
/// Creates the context and starts to listen for Ctrl-C.
lx_result cli_session_open(cli_session *session, lx_error *error);
void cli_session_close(cli_session *session);

/// Prints "luxel: PATH: message" (the path only where the message does not start with it) and returns the exit code that fits.
/// LX_OK is CLI_DONE and prints nothing. `path` may be NULL.
int cli_finish(cli_session *session, lx_result result, const lx_error *error, const char *path);

/// How light is followed, as typed. Shared by bake, render and irradiance.
typedef struct cli_transport {
    lx_transport_desc desc;
    const char *sky; ///< COLOUR or FILE; NULL: none.
} cli_transport;

/// `default_bounces`: what the help calls the default.
#define CLI_TRANSPORT_OPTIONS(transport, default_bounces)                                                              \
    {.name = "bounces", .argument = "N|inf", .kind = CLI_UINT_OR_INF, .target = &(transport).desc.bounces, .max = 1e6, \
     .help = "how often light bounces; 0: direct light only; inf: all bounces (default " default_bounces ")"},         \
    {.name = "coloured-shadows", .kind = CLI_FLAG, .target = &(transport).desc.coloured_shadows,                       \
     .help = "blended surfaces tint the light that passes"},                                                           \
    {.name = "seed", .argument = "N", .kind = CLI_UINT, .target = &(transport).desc.seed,                              \
     .help = "same seed, same bits, for any number of threads (default 1)"},                                           \
    {.name = "sky", .argument = "COLOUR|FILE", .kind = CLI_TEXT, .target = &(transport).sky,                           \
     .help = "light from outside: #rrggbb (sRGB), r,g,b (linear), or an equirectangular .hdr or .exr file; 1.0 is 1 nit"}, \
    {.name = "sky-rotation", .argument = "DEG", .help = "about the vertical", .kind = CLI_FLOAT,                       \
     .target = &(transport).desc.sky.rotation_deg, .min = -1e6},                                                       \
    {.name = "sky-intensity", .argument = "X", .help = "multiplies the sky (default 1)", .kind = CLI_FLOAT,            \
     .target = &(transport).desc.sky.intensity}

cli_transport cli_transport_default(void);
/// Reads --sky, checks that a sky file can be read. CLI_GO_ON or an exit code.
int cli_transport_check(const cli_command *command, cli_transport *transport);

/// "path/to/a.EXR" → "exr"; "" if there is no short ending.
void cli_extension(const char *path, char out[8]);

/// One size, in the unit that fits: "4.2 MiB".
void cli_format_bytes(char out[32], uint64_t bytes);
/// Two lines of a summary: what a baked folder costs at run time.
void cli_print_budget(const lx_budget *budget);
/// A number with k, M or G.
void cli_format_count(char out[32], double count);
/// "0.4 s", "1 m 05 s", "2 h 03 m".
void cli_format_seconds(char out[32], double seconds);

#endif
