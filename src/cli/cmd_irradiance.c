/// luxel irradiance: path-traced irradiance at points from a CSV file.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct points {
    float *positions, *normals; // xyz triples
    size_t count, capacity;
    bool header; // the file named its columns
} points;

static void points_release(points *p)
{
    free(p->positions);
    free(p->normals);
}

static lx_result fail(lx_error *error, lx_result code, const char *path, size_t line, const char *message)
{
    snprintf(error->message, sizeof error->message, "%s: line %zu: %s", path, line, message);
    return code;
}

static bool points_push(points *p, const float values[6])
{
    if (p->count == p->capacity) {
        const size_t capacity = p->capacity ? 2 * p->capacity : 256;
        float *const positions = realloc(p->positions, capacity * 3 * sizeof(float));
        if (positions) p->positions = positions;
        float *const normals = realloc(p->normals, capacity * 3 * sizeof(float));
        if (normals) p->normals = normals;
        if (!positions || !normals) return false;
        p->capacity = capacity;
    }
    memcpy(p->positions + 3 * p->count, values, 3 * sizeof(float));
    memcpy(p->normals + 3 * p->count, values + 3, 3 * sizeof(float));
    ++p->count;
    return true;
}

// Six numbers, separated by commas, with blanks around them. False: it is something else.
static bool parse_line(const char *text, float values[6])
{
    for (int i = 0; i < 6; ++i) {
        char *end = NULL;
        values[i] = strtof(text, &end);
        if (end == text) return false;
        end += strspn(end, " \t\r\n");
        if (*end != (i < 5 ? ',' : '\0')) return false;
        text = end + 1;
    }
    return true;
}

static lx_result read_points(const char *path, points *out, lx_error *error)
{
    lx_result result = LX_OK;
    FILE *const file = fopen(path, "r");
    if (!file) { // it could be read a moment ago
        snprintf(error->message, sizeof error->message, "%s: cannot read", path);
        return LX_ERROR_FORMAT;
    }
    char line[1024];
    for (size_t number = 1; fgets(line, sizeof line, file); ++number) {
        float values[6];
        if (!strchr(line, '\n') && !feof(file)) {
            result = fail(error, LX_ERROR_FORMAT, path, number, "is too long");
            break;
        }
        if (line[strspn(line, " \t\r\n")] == '\0') continue;
        if (!parse_line(line, values)) {
            if (out->count == 0 && !out->header) { // column names
                out->header = true;
                continue;
            }
            result = fail(error, LX_ERROR_FORMAT, path, number, "needs six numbers: x,y,z,nx,ny,nz");
            break;
        }
        bool finite = true;
        for (int i = 0; i < 6; ++i) finite &= isfinite(values[i]);
        if (!finite || (values[3] == 0.0f && values[4] == 0.0f && values[5] == 0.0f)) {
            result = fail(error, LX_ERROR_FORMAT, path, number, finite ? "the normal is zero" : "holds a number that is not finite");
            break;
        }
        if (!points_push(out, values)) {
            result = fail(error, LX_ERROR_OUT_OF_MEMORY, path, number, "out of memory");
            break;
        }
    }
    fclose(file);
    if (result == LX_OK && out->count == 0) {
        snprintf(error->message, sizeof error->message, "%s: holds no points", path);
        result = LX_ERROR_FORMAT;
    }
    return result;
}

static void print_points(FILE *file, const points *p, const float *rgb)
{
    fprintf(file, "x,y,z,nx,ny,nz,r,g,b\n");
    for (size_t i = 0; i < p->count; ++i) {
        const float *const x = p->positions + 3 * i, *const n = p->normals + 3 * i, *const e = rgb + 3 * i;
        fprintf(file, "%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", (double)x[0], (double)x[1], (double)x[2],
                (double)n[0], (double)n[1], (double)n[2], (double)e[0], (double)e[1], (double)e[2]);
    }
}

// Into a file beside `path` first, so that `path` is whole or untouched.
static lx_result save_points(const char *path, const points *p, const float *rgb, lx_error *error)
{
    char partial[4096];
    if ((size_t)snprintf(partial, sizeof partial, "%s.partial", path) >= sizeof partial) {
        snprintf(error->message, sizeof error->message, "the name of the output file is too long");
        return LX_ERROR_INVALID_ARGUMENT;
    }
    FILE *const file = fopen(partial, "w");
    bool good = file != NULL;
    if (file) {
        print_points(file, p, rgb);
        good = !ferror(file);
        good = fclose(file) == 0 && good;
    }
    if (good && rename(partial, path) == 0) return LX_OK;
    if (file) remove(partial);
    snprintf(error->message, sizeof error->message, "cannot write");
    return LX_ERROR_IO;
}

static int run(const cli_command *command, int argc, char **argv)
{
    cli_session session = cli_session_default();
    cli_transport transport = cli_transport_default();
    const char *scene_path = NULL, *points_path = NULL, *output = NULL;
    uint32_t samples = 1024;
    int light_units = 0;
    const cli_option options[] = {
        {.name = "points", .argument = "P.csv", .kind = CLI_TEXT, .target = &points_path,
         .help = "x,y,z,nx,ny,nz in world space, a point a line; a first line with column names is skipped"},
        {.name = "output", .letter = 'o', .argument = "FILE", .kind = CLI_TEXT, .target = &output,
         .help = "default: standard output"},
        {.name = "samples", .argument = "N", .kind = CLI_UINT, .target = &samples, .min = 1, .max = 16 * 1024 * 1024,
         .help = "paths per point (default 1024)"},
        CLI_TRANSPORT_OPTIONS(transport, "8"),
        {.name = "light-units", .argument = "gltf|blender", .kind = CLI_CHOICE, .target = &light_units,
         .help = "blender: emission x 683, to match what Blender's exporter does to lamps (default gltf)"},
        CLI_SESSION_OPTIONS(session),
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &scene_path, 1, 1);
    if (status != CLI_GO_ON) return status;
    if (!points_path) return cli_usage_error(command, "where? Give points with --points P.csv");
    status = cli_transport_check(command, &transport);
    if (status != CLI_GO_ON) return status;

    lx_error error = {0};
    lx_scene *scene = NULL;
    points p = {0};
    float *rgb = NULL;
    const char *at_fault = output;
    lx_result result = output ? lx_host_check_output(output, &error) : LX_OK;
    if (result != LX_OK) goto cleanup;
    at_fault = points_path;
    result = lx_host_check_input(points_path, &error);
    if (result != LX_OK) goto cleanup;
    result = read_points(points_path, &p, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = scene_path;
    result = cli_session_open(&session, &error);
    if (result != LX_OK) goto cleanup;
    lx_scene_load_desc load = lx_scene_load_desc_default();
    load.light_units = light_units == 1 ? LX_LIGHT_UNITS_BLENDER : LX_LIGHT_UNITS_GLTF;
    result = lx_scene_load(session.context, scene_path, &load, &scene, &error);
    if (result != LX_OK) goto cleanup;
    rgb = calloc(p.count, 3 * sizeof *rgb);
    if (!rgb) {
        result = LX_ERROR_OUT_OF_MEMORY;
        goto cleanup;
    }
    const lx_progress_sink sink = cli_progress_sink(&session.progress);
    result = lx_irradiance(scene, &transport.desc, samples, p.positions, p.normals, p.count, &sink, rgb, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = output;
    cli_progress_clear(&session.progress);
    if (output)
        result = save_points(output, &p, rgb, &error);
    else
        print_points(stdout, &p, rgb);
cleanup:
    status = cli_finish(&session, result, &error, at_fault);
    free(rgb);
    points_release(&p);
    lx_scene_destroy(scene);
    cli_session_close(&session);
    return status;
}

const cli_command cli_irradiance = {
    .name = "irradiance",
    .usage = "SCENE --points P.csv [options]",
    .summary = "path-trace the irradiance at points of a scene",
    .about = "Path-traces the irradiance (lux, linear Rec. 709) at free points of a scene at its authored colours. Writes "
             "the columns x,y,z,nx,ny,nz,r,g,b.",
    .examples = "  luxel irradiance room.glb --points desk.csv\n"
                "  luxel irradiance room.glb --points desk.csv -o lux.csv --samples 65536\n"
                "  luxel irradiance room.glb --points desk.csv --bounces inf --sky 200,210,255\n",
    .run = run,
};
