/// luxel render: a picture of a baked folder at any colours, or the path-traced reference of it or of a scene.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"
#include "luxel/picture.h"
#include "luxel/render.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { size_max = 16384 };

typedef struct render_options {
    cli_session session;
    cli_transport transport;
    lx_render_desc render;
    const char *input, *output, *size, *exposure, *eye, *target;
    cli_texts assignments;
    int tonemap, view, light_units;
    uint32_t samples; // 0: the library's default
    bool reference;
} render_options;

// "1280x720"
static bool parse_size(const char *text, uint32_t *width, uint32_t *height)
{
    char *end = NULL;
    const unsigned long w = strtoul(text, &end, 10);
    if (end == text || *end != 'x' || strspn(text, "0123456789x") != strlen(text)) return false;
    const char *const second = end + 1;
    const unsigned long h = strtoul(second, &end, 10);
    if (end == second || *end || w < 1 || h < 1 || w > size_max || h > size_max) return false;
    *width = (uint32_t)w;
    *height = (uint32_t)h;
    return true;
}

// "1,2.5,-3"
static bool parse_point(const char *text, float point[3])
{
    for (int i = 0; i < 3; ++i) {
        char *end = NULL;
        point[i] = strtof(text, &end);
        if (end == text || *end != (i < 2 ? ',' : '\0') || !isfinite(point[i])) return false;
        text = end + 1;
    }
    return true;
}

static int parse_look(const cli_command *command, render_options *o)
{
    if (!o->eye && !o->target) return CLI_GO_ON;
    if (!o->eye || !o->target) return cli_usage_error(command, "--eye and --target go together");
    if (o->render.camera) return cli_usage_error(command, "--camera and --eye exclude each other");
    if (!parse_point(o->eye, o->render.eye)) return cli_usage_error(command, "--eye: '%s' is not X,Y,Z", o->eye);
    if (!parse_point(o->target, o->render.target)) return cli_usage_error(command, "--target: '%s' is not X,Y,Z", o->target);
    if (memcmp(o->render.eye, o->render.target, sizeof o->render.eye) == 0)
        return cli_usage_error(command, "--eye and --target are the same place");
    o->render.look = true;
    return CLI_GO_ON;
}

static int parse(const cli_command *command, int argc, char **argv, render_options *o)
{
    const cli_option options[] = {
        {.kind = CLI_HEADING, .help = "Picture"},
        {.name = "output", .letter = 'o', .argument = "IMG", .kind = CLI_TEXT, .target = &o->output,
         .help = ".png: developed with exposure and tone mapping; .exr, .hdr: linear radiance in nit"},
        {.name = "camera", .argument = "NAME|INDEX", .kind = CLI_TEXT, .target = &o->render.camera,
         .help = "default: the first in the file, else one that frames the scene"},
        {.name = "eye", .argument = "X,Y,Z", .kind = CLI_TEXT, .target = &o->eye,
         .help = "instead of a camera: look from here, in metres ..."},
        {.name = "target", .argument = "X,Y,Z", .kind = CLI_TEXT, .target = &o->target, .help = "... to here"},
        {.name = "fov", .argument = "DEG", .kind = CLI_FLOAT, .target = &o->render.yfov_deg, .min = 1, .max = 170,
         .help = "... over this height of view (default 60)"},
        {.name = "size", .argument = "WxH", .kind = CLI_TEXT, .target = &o->size, .help = "default 1280x720"},
        {.name = "exposure", .argument = "EV|auto", .kind = CLI_TEXT, .target = &o->exposure,
         .help = "pixel = sRGB(tone(2^EV x radiance)); auto (default): from the mean brightness"},
        {.name = "tonemap", .argument = "pbr-neutral|none", .kind = CLI_CHOICE, .target = &o->tonemap,
         .help = "default pbr-neutral"},
        {.name = "view", .argument = "lit|lightmap|albedo", .kind = CLI_CHOICE, .target = &o->view,
         .help = "what to show (default lit)"},
        {.name = "set", .argument = "LAYER=COLOUR[*X]", .kind = CLI_TEXTS, .target = &o->assignments,
         .help = "recolours a layer of a baked folder, X its intensity: #rrggbb (sRGB), r,g,b (linear) or off; LAYER may "
                 "be a pattern; may be repeated"},
        {.name = "samples", .argument = "N", .kind = CLI_UINT, .target = &o->samples, .min = 1, .max = 1 << 20,
         .help = "camera rays, or paths of the reference, per pixel (default 16)"},
        {.kind = CLI_HEADING, .help = "Light (of the reference, and of what is not baked)"},
        {.name = "reference", .kind = CLI_FLAG, .target = &o->reference,
         .help = "path-trace instead of using the lightmaps; always so for a scene"},
        CLI_TRANSPORT_OPTIONS(o->transport, "8"),
        {.name = "light-units", .argument = "gltf|blender", .kind = CLI_CHOICE, .target = &o->light_units,
         .help = "for a scene: blender multiplies emission by 683 (default gltf)"},
        {.kind = CLI_HEADING, .help = "Machine"},
        CLI_SESSION_OPTIONS(o->session),
    };
    const int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &o->input, 1, 1);
    if (status != CLI_GO_ON) return status;

    if (!o->output) return cli_usage_error(command, "where to? Give a picture with -o IMG.png");
    char extension[8];
    cli_extension(o->output, extension);
    if (strcmp(extension, "png") != 0 && strcmp(extension, "exr") != 0 && strcmp(extension, "hdr") != 0)
        return cli_usage_error(command, "-o: '%s' does not end with .png, .exr or .hdr", o->output);
    if (o->size && !parse_size(o->size, &o->render.width, &o->render.height))
        return cli_usage_error(command, "--size: '%s' is not WIDTHxHEIGHT, each 1 to %d", o->size, size_max);
    if (o->exposure && strcmp(o->exposure, "auto") != 0) {
        char *end = NULL;
        o->render.exposure_ev = strtof(o->exposure, &end);
        o->render.auto_exposure = false;
        if (end == o->exposure || *end || !(fabsf(o->render.exposure_ev) <= 100.0f))
            return cli_usage_error(command, "--exposure: '%s' is neither a number of stops nor auto", o->exposure);
    }
    const int look = parse_look(command, o);
    if (look != CLI_GO_ON) return look;
    o->render.tonemap = o->tonemap == 1 ? LX_TONEMAP_NONE : LX_TONEMAP_PBR_NEUTRAL;
    o->render.view = (lx_view)o->view;
    if (o->samples) o->render.samples = o->samples;
    return CLI_GO_ON;
}

static lx_result render(const render_options *o, lx_scene *scene, lx_baked *baked, const lx_progress_sink *sink, float *rgb,
                        float *ev, lx_error *error)
{
    if (baked) return lx_render_baked(baked, &o->render, o->reference, sink, rgb, ev, error);
    return lx_render_scene(scene, &o->render, sink, rgb, ev, error);
}

static lx_result save(const render_options *o, const float *rgb, float ev, lx_error *error)
{
    char extension[8];
    cli_extension(o->output, extension);
    const uint32_t width = o->render.width, height = o->render.height;
    if (strcmp(extension, "png") != 0) return lx_picture_save(o->output, width, height, rgb, error);
    uint8_t *const bytes = malloc((size_t)width * height * 3);
    if (!bytes) {
        snprintf(error->message, sizeof error->message, "out of memory (picture)");
        return LX_ERROR_OUT_OF_MEMORY;
    }
    lx_render_develop(&o->render, ev, rgb, bytes);
    const lx_result result = lx_picture_save_bytes(o->output, width, height, bytes, error);
    free(bytes);
    return result;
}

static int run(const cli_command *command, int argc, char **argv)
{
    render_options o = {.session = cli_session_default(), .transport = cli_transport_default(),
                        .render = lx_render_desc_default()};
    int status = parse(command, argc, argv, &o);
    if (status != CLI_GO_ON) return status;
    const bool is_baked = lx_baked_is_folder(o.input);
    if (o.assignments.count && !is_baked)
        return cli_usage_error(command, "--set needs a baked folder, and '%s' is none", o.input);
    if (o.light_units && is_baked)
        return cli_usage_error(command, "--light-units is for scenes; '%s' is baked already", o.input);
    status = cli_transport_check(command, &o.transport);
    if (status != CLI_GO_ON) return status;
    o.render.transport = o.transport.desc;

    lx_error error = {0};
    lx_scene *scene = NULL;
    lx_baked *baked = NULL;
    float *rgb = NULL;
    float ev = 0.0f;
    const char *at_fault = o.output;
    lx_result result = lx_host_check_output(o.output, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = o.input;
    result = cli_session_open(&o.session, &error);
    if (result != LX_OK) goto cleanup;
    const lx_progress_sink sink = cli_progress_sink(&o.session.progress);
    if (is_baked) {
        result = lx_baked_open(o.session.context, o.input, true, &baked, &error);
    } else {
        lx_scene_load_desc load = lx_scene_load_desc_default();
        load.light_units = o.light_units == 1 ? LX_LIGHT_UNITS_BLENDER : LX_LIGHT_UNITS_GLTF;
        result = lx_scene_load(o.session.context, o.input, &load, &scene, &error);
    }
    if (result != LX_OK) goto cleanup;
    for (size_t i = 0; i < o.assignments.count; ++i) {
        result = lx_baked_set(baked, o.assignments.items[i], &error);
        if (result != LX_OK) goto cleanup;
    }
    rgb = malloc((size_t)o.render.width * o.render.height * 3 * sizeof *rgb);
    if (!rgb) {
        result = LX_ERROR_OUT_OF_MEMORY;
        goto cleanup;
    }
    result = render(&o, scene, baked, &sink, rgb, &ev, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = o.output;
    result = save(&o, rgb, ev, &error);
cleanup:
    status = cli_finish(&o.session, result, &error, at_fault);
    if (result == LX_OK && !o.session.quiet)
        printf("%s  %" PRIu32 " x %" PRIu32 ", exposure %+.2f EV\n", o.output, o.render.width, o.render.height, (double)ev);
    free(rgb);
    lx_baked_destroy(baked);
    lx_scene_destroy(scene);
    cli_session_close(&o.session);
    return status;
}

const cli_command cli_render = {
    .name = "render",
    .usage = "OUT|SCENE -o IMG.png [options]",
    .summary = "make a picture of a baked folder, or path-trace a scene",
    .about = "Makes a picture on the CPU: of a baked folder from its lightmaps, at authored or other colours, without "
             "baking again; or path-traced, of a folder (--reference) or of a scene file.",
    .examples = "  luxel render room.baked -o room.png\n"
                "  luxel render room.baked -o red.png --set 'lamp=#ff2010*3' --set 'neon*=off'\n"
                "  luxel render room.baked -o truth.png --reference --samples 256\n"
                "  luxel render room.glb -o room.exr --camera 1 --size 640x360\n",
    .run = run,
};
