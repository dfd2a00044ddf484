#include "session.h"

#include "interrupt.h"
#include "luxel/host.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- Session ----------------------------------------------------------------------------------------------------------

static void keep_line(cli_session *session, lx_log_level level, const char *message)
{
    if (session->line_count == session->line_capacity) {
        const size_t capacity = session->line_capacity ? 2 * session->line_capacity : 16;
        cli_log_line *const lines = realloc(session->lines, capacity * sizeof *lines);
        if (!lines) return; // a lost note is no reason to fail
        session->lines = lines;
        session->line_capacity = capacity;
    }
    char *const text = malloc(strlen(message) + 1);
    if (!text) return;
    strcpy(text, message);
    session->lines[session->line_count++] = (cli_log_line){level, text};
}

static void on_log(void *user, lx_log_level level, const char *message)
{
    cli_session *const session = user;
    if (level == LX_LOG_WARNING) ++session->warning_count;
    if (session->collect) {
        keep_line(session, level, message);
    } else if (level == LX_LOG_WARNING || !session->quiet) {
        cli_progress_clear(&session->progress);
        fprintf(stderr, "luxel: %s: %s\n", level == LX_LOG_WARNING ? "warning" : "note", message);
    }
}

cli_session cli_session_default(void)
{
    return (cli_session){.desc = lx_context_desc_default()};
}

lx_result cli_session_open(cli_session *session, lx_error *error)
{
    session->start_seconds = lx_host_seconds();
    session->desc.logger = (lx_logger){on_log, session};
    cli_progress_init(&session->progress, session->quiet);
    cli_catch_interrupts();
    return lx_context_create(&session->desc, &session->context, error);
}

void cli_session_close(cli_session *session)
{
    cli_progress_clear(&session->progress);
    lx_context_destroy(session->context);
    for (size_t i = 0; i < session->line_count; ++i) free(session->lines[i].text);
    free(session->lines);
    session->context = NULL;
    session->lines = NULL;
    session->line_count = session->line_capacity = 0;
}

int cli_finish(cli_session *session, lx_result result, const lx_error *error, const char *path)
{
    if (session) cli_progress_clear(&session->progress);
    if (result == LX_OK) return CLI_DONE;
    if (result == LX_ERROR_CANCELLED) {
        fprintf(stderr, "luxel: stopped, nothing was written\n");
        return CLI_STOPPED;
    }
    const char *const message = error->message[0] ? error->message : lx_result_name(result);
    const bool named = !path || strncmp(message, path, strlen(path)) == 0;
    fprintf(stderr, "luxel: %s%s%s\n", named ? "" : path, named ? "" : ": ", message);
    switch (result) {
    case LX_ERROR_INVALID_ARGUMENT: return CLI_USAGE_WRONG;
    case LX_ERROR_FORMAT:
    case LX_ERROR_LIMIT:
    case LX_ERROR_UNSUPPORTED: return CLI_INPUT_WRONG;
    default: return CLI_MACHINE_FAILED;
    }
}

// --- Transport --------------------------------------------------------------------------------------------------------

cli_transport cli_transport_default(void)
{
    return (cli_transport){.desc = lx_transport_desc_default()};
}

static float linear_from_srgb(float value)
{
    return value <= 0.04045f ? value / 12.92f : powf((value + 0.055f) / 1.055f, 2.4f);
}

// #rrggbb (sRGB) or r,g,b (linear). False: it is neither.
static bool parse_color(const char *text, float out[3])
{
    char *end = NULL;
    if (text[0] == '#') {
        if (strlen(text) != 7 || strspn(text + 1, "0123456789abcdefABCDEF") != 6) return false;
        const unsigned long bits = strtoul(text + 1, &end, 16);
        for (int i = 0; i < 3; ++i) out[i] = linear_from_srgb((float)(bits >> (16 - 8 * i) & 0xff) / 255.0f);
        return true;
    }
    for (int i = 0; i < 3; ++i) {
        out[i] = strtof(text, &end);
        if (end == text || *end != (i < 2 ? ',' : '\0')) return false;
        text = end + 1;
    }
    return true;
}

int cli_transport_check(const cli_command *command, cli_transport *transport)
{
    const char *const sky = transport->sky;
    if (!sky) {
        if (transport->desc.sky.rotation_deg != 0.0f)
            return cli_usage_error(command, "--sky-rotation without --sky turns nothing");
        return CLI_GO_ON;
    }
    float *const color = transport->desc.sky.color;
    if (parse_color(sky, color)) {
        for (int i = 0; i < 3; ++i)
            if (!(color[i] >= 0.0f) || !isfinite(color[i]))
                return cli_usage_error(command, "--sky: '%s' holds a negative or infinite value", sky);
        return CLI_GO_ON;
    }
    char extension[8];
    cli_extension(sky, extension);
    if (strcmp(extension, "hdr") != 0 && strcmp(extension, "exr") != 0)
        return cli_usage_error(command, "--sky: '%s' is no colour (#rrggbb or r,g,b) and no .hdr or .exr file", sky);
    lx_error error = {0};
    const lx_result result = lx_host_check_input(sky, &error);
    if (result != LX_OK) return cli_finish(NULL, result, &error, sky);
    transport->desc.sky.file = sky;
    color[0] = color[1] = color[2] = 1.0f;
    return CLI_GO_ON;
}

// --- Small things -----------------------------------------------------------------------------------------------------

void cli_extension(const char *path, char out[8])
{
    const char *const slash = strrchr(path, '/');
    const char *const dot = strrchr(slash ? slash : path, '.');
    out[0] = '\0';
    if (!dot || strlen(dot + 1) > 7) return;
    size_t length = 0;
    for (const char *c = dot + 1; *c; ++c) out[length++] = (char)tolower((unsigned char)*c);
    out[length] = '\0';
}

void cli_format_bytes(char out[32], uint64_t bytes)
{
    static const char *const units[] = {"bytes", "KiB", "MiB", "GiB", "TiB"};
    double value = (double)bytes;
    size_t unit = 0;
    for (; value >= 1024.0 && unit + 1 < CLI_COUNT(units); ++unit) value /= 1024.0;
    snprintf(out, 32, unit == 0 ? "%.0f %s" : "%.1f %s", value, units[unit]);
}

void cli_print_budget(const lx_budget *budget)
{
    char ram[32], accumulator[32], composed[32], layers[32];
    cli_format_bytes(ram, budget->ram);
    cli_format_bytes(accumulator, budget->accumulator);
    cli_format_bytes(composed, budget->gpu_composed);
    cli_format_bytes(layers, budget->gpu_layers);
    printf("  memory    %s in RAM at run time; %s more to add only what changes\n", ram, accumulator);
    printf("  GPU       %s composed on the CPU, or %s as layers\n", composed, layers);
}

void cli_format_count(char out[32], double count)
{
    if (count >= 1e9)
        snprintf(out, 32, "%.2f G", count / 1e9);
    else if (count >= 1e6)
        snprintf(out, 32, "%.2f M", count / 1e6);
    else if (count >= 1e4)
        snprintf(out, 32, "%.1f k", count / 1e3);
    else
        snprintf(out, 32, "%.0f", count);
}

void cli_format_seconds(char out[32], double seconds)
{
    const unsigned long whole = (unsigned long)(seconds + 0.5);
    if (seconds < 59.95)
        snprintf(out, 32, "%.1f s", seconds);
    else if (whole < 3600)
        snprintf(out, 32, "%lu m %02lu s", whole / 60, whole % 60);
    else
        snprintf(out, 32, "%lu h %02lu m", whole / 3600, whole / 60 % 60);
}
