/// luxel bake: scene in, baked folder out.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(LX_LIGHTMAP_KTX2 == 1 << 0 && LX_LIGHTMAP_EXR == 1 << 1 && LX_LIGHTMAP_HDR == 1 << 2,
               "--format lists its words in the order of these bits");

enum { quality_draft, quality_medium, quality_high };
static const struct {
    uint32_t samples;
    float noise;
} presets[] = {[quality_draft] = {64, 0.05f}, [quality_medium] = {256, 0.02f}, [quality_high] = {1024, 0.01f}};

static const char *const integrator_names[] = {[LX_INTEGRATOR_GATHER] = "gather", [LX_INTEGRATOR_PATH] = "path"};
static const char *const denoiser_names[] = {[LX_DENOISE_NONE] = "none", [LX_DENOISE_BUILTIN] = "builtin", [LX_DENOISE_OIDN] = "oidn"};
_Static_assert(LX_INTEGRATOR_GATHER == 0 && LX_INTEGRATOR_PATH == 1 && LX_DENOISE_NONE == 0 && LX_DENOISE_BUILTIN == 1 && LX_DENOISE_OIDN == 2,
               "--integrator and --denoise list their words in this order");

enum { samples_max = 16 * 1024 * 1024, path_bounces = 8 };
static const uint32_t not_given = UINT32_MAX - 1; // nobody can type so many bounces

typedef struct bake_options {
    cli_session session;
    cli_transport transport;
    lx_scene_load_desc load;
    lx_atlas_desc atlas;
    lx_bake_desc bake;
    lx_save_desc save;
    const char *scene_path, *output;
    int quality, layers, encoding, light_units;
    int integrator, denoise; // -1: not given
    uint32_t samples;        // 0: what the quality says
    float noise;             // -1: likewise
    float interpolation;     // -1: not given
    double time_s;           // 0: not given
    uint64_t memory_bytes;   // likewise
    char *scratch_folder;    // owned
    bool no_preview, no_report, json;
} bake_options;

// What only the gather integrator knows how to do; NULL: nothing of it was asked for.
static const char *gather_option(const bake_options *o)
{
    return o->noise >= 0.0f ? "noise" : o->interpolation >= 0.0f ? "interpolation" : o->time_s > 0.0 ? "time" : o->memory_bytes > 0 ? "memory" : o->denoise >= 0 ? "denoise" : NULL;
}

// Beside the result, where there is room for much if there is room for that; TMPDIR goes before it.
static char *folder_beside(const char *output)
{
    const char *const chosen = getenv("TMPDIR");
    if (chosen && *chosen) return NULL;
    size_t length = strlen(output);
    while (length > 1 && output[length - 1] == '/') --length;
    while (length > 0 && output[length - 1] != '/') --length;
    char *const folder = malloc(length + 3);
    if (!folder) return NULL;
    memcpy(folder, output, length);
    strcpy(folder + length, length ? "." : "./");
    return folder;
}

static int choose_quality(const cli_command *command, bake_options *o)
{
    if (o->integrator >= 0) o->bake.integrator = (lx_integrator)o->integrator;
    const bool paths = o->bake.integrator == LX_INTEGRATOR_PATH;
    const char *const refused = paths ? gather_option(o) : NULL;
    if (refused) return cli_usage_error(command, "--%s is for --integrator gather only", refused);
    if (o->transport.desc.bounces == not_given) o->transport.desc.bounces = paths ? path_bounces : LX_BOUNCES_INF;
    o->bake.samples = o->samples ? o->samples : presets[o->quality].samples;
    o->bake.noise = o->noise >= 0.0f ? o->noise : presets[o->quality].noise;
    if (o->interpolation >= 0.0f) o->bake.interpolation = o->interpolation;
    o->bake.time_s = o->time_s;
    o->bake.memory_bytes = o->memory_bytes;
    if (o->denoise >= 0) o->bake.denoise = (lx_denoiser)o->denoise;
    if (paths) o->bake.denoise = LX_DENOISE_NONE;
    if (o->memory_bytes) o->bake.scratch_folder = o->scratch_folder = folder_beside(o->output);
    return CLI_GO_ON;
}

static int parse(const cli_command *command, int argc, char **argv, bake_options *o)
{
    const cli_option options[] = {
        {.kind = CLI_HEADING, .help = "Result"},
        {.name = "output", .letter = 'o', .argument = "OUT", .kind = CLI_TEXT, .target = &o->output,
         .help = "folder to write; an earlier result in it is replaced when the new one is whole"},
        {.name = "format", .argument = "ktx2,exr,hdr", .kind = CLI_CHOICES, .target = &o->save.formats,
         .help = "lightmap files besides luxel.pack, which is always written"},
        {.name = "encoding", .argument = "default|rgb9e5|half", .kind = CLI_CHOICE, .target = &o->encoding,
         .help = "of these files (default: rgb9e5 in KTX2, 32-bit float in EXR)"},
        {.name = "no-preview", .kind = CLI_FLAG, .target = &o->no_preview, .help = "do not render preview.png"},
        {.name = "no-report", .kind = CLI_FLAG, .target = &o->no_report, .help = "do not write report.html"},
        {.name = "json", .kind = CLI_FLAG, .target = &o->json, .help = "summary as JSON"},
        {.kind = CLI_HEADING, .help = "Lightmap"},
        {.name = "page-size", .argument = "N", .kind = CLI_UINT, .target = &o->atlas.page_size, .min = 16, .max = 4096,
         .help = "texels along an edge of a page, a multiple of 4 (default 1024)"},
        {.name = "max-pages", .argument = "N", .kind = CLI_UINT, .target = &o->atlas.max_pages, .min = 1, .max = 256,
         .help = "default 1"},
        {.name = "texels-per-meter", .argument = "T", .kind = CLI_FLOAT, .target = &o->atlas.texels_per_m, .min = 1e-6,
         .help = "default: what just fills the pages"},
        {.name = "padding", .argument = "N", .kind = CLI_UINT, .target = &o->atlas.padding, .min = 2, .max = 32,
         .help = "texels between charts (default 4)"},
        {.kind = CLI_HEADING, .help = "Quality"},
        {.name = "quality", .argument = "draft|medium|high", .kind = CLI_CHOICE, .target = &o->quality,
         .help = "presets of the next two: 64, 256 or 1024 samples, noise 0.05, 0.02 or 0.01 (default medium)"},
        {.name = "samples", .argument = "N", .kind = CLI_UINT, .target = &o->samples, .min = 1, .max = samples_max,
         .help = "looks at each light source per texel at most, with four rays for bounced light for each; four times as many halve the noise"},
        {.name = "noise", .argument = "E", .kind = CLI_FLOAT, .target = &o->noise, .max = 1,
         .help = "where every layer's error is estimated below that, 0.02 meaning 2 %, no more samples are taken; 0: take them all"},
        {.name = "interpolation", .argument = "E", .kind = CLI_FLOAT, .target = &o->interpolation, .max = 1,
         .help = "interpolate indirect light between texels where that errs by at most E, as distances tell; 0: nowhere (default 0.02)"},
        {.name = "time", .argument = "DURATION", .kind = CLI_DURATION, .target = &o->time_s, .max = 1e9,
         .help = "take no new samples once that much time has passed: 90s, 5m, 1h30m. The result then depends on the machine"},
        {.name = "denoise", .argument = "none|builtin|oidn", .kind = CLI_CHOICE, .target = &o->denoise,
         .help = "smooth what noise is left; oidn: by Intel Open Image Denoise, where its library is installed (default builtin)"},
        {.name = "integrator", .argument = "gather|path", .kind = CLI_CHOICE, .target = &o->integrator,
         .help = "how light is followed. gather: fast, one ray serves all layers and bounces; path: every texel by paths of its own, slow and "
                 "free of bias, for reference; it knows no --noise, --interpolation, --time, --denoise and --memory (default "
                 "gather)"},
        {.kind = CLI_HEADING, .help = "Light"},
        CLI_TRANSPORT_OPTIONS(o->transport, "inf; with --integrator path 8"),
        {.name = "direct-only", .kind = CLI_FLAG, .target = &o->bake.direct_only, .help = "leave out what bounces"},
        {.name = "indirect-only", .kind = CLI_FLAG, .target = &o->bake.indirect_only,
         .help = "leave out what comes straight from a source"},
        {.name = "light-units", .argument = "gltf|blender", .kind = CLI_CHOICE, .target = &o->light_units,
         .help = "blender: emission x 683, to match what Blender's exporter does to lamps (default gltf)"},
        {.name = "layers", .argument = "auto|combined", .kind = CLI_CHOICE, .target = &o->layers,
         .help = "auto: one per source or luxel_layer, each recolourable; combined: all light in one (default auto)"},
        {.name = "max-layers", .argument = "N", .kind = CLI_UINT, .target = &o->bake.max_layers, .min = 1, .max = 65535,
         .help = "more sources are grouped by material, then by parent (default 64)"},
        {.kind = CLI_HEADING, .help = "Machine"},
        {.name = "memory", .argument = "SIZE", .kind = CLI_SIZE, .target = &o->memory_bytes,
         .help = "stay below that: 2G, 1500M. Layers are baked in groups, one after the other, with the same result; finished ones wait in a file where "
                 "TMPDIR says, else beside OUT"},
        CLI_SESSION_OPTIONS(o->session),
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &o->scene_path, 1, 1);
    if (status != CLI_GO_ON) return status;

    if (!o->output) return cli_usage_error(command, "where to? Give a folder with -o OUT");
    if (o->atlas.page_size % 4 != 0)
        return cli_usage_error(command, "--page-size: %" PRIu32 " is no multiple of 4", o->atlas.page_size);
    if (o->bake.direct_only && o->bake.indirect_only)
        return cli_usage_error(command, "--direct-only and --indirect-only together leave no light");
    if (o->bake.indirect_only && o->transport.desc.bounces == 0)
        return cli_usage_error(command, "--indirect-only with --bounces 0 leaves no light");
    if (o->encoding == LX_ENCODING_RGB9E5 && o->save.formats && !(o->save.formats & LX_LIGHTMAP_KTX2))
        return cli_usage_error(command, "--encoding rgb9e5 is for --format ktx2 only");
    if (o->encoding != LX_ENCODING_DEFAULT && !o->save.formats)
        return cli_usage_error(command, "--encoding without --format has nothing to encode");
    status = choose_quality(command, o);
    if (status == CLI_GO_ON) status = cli_transport_check(command, &o->transport);
    if (status != CLI_GO_ON) return status;

    o->bake.transport = o->transport.desc;
    o->bake.combined = o->layers == 1;
    o->save.encoding = (lx_encoding)o->encoding;
    o->save.preview = !o->no_preview;
    o->save.report = !o->no_report;
    o->load.light_units = o->light_units == 1 ? LX_LIGHT_UNITS_BLENDER : LX_LIGHT_UNITS_GLTF;
    return CLI_GO_ON;
}

static const char *plural(uint64_t count)
{
    return count == 1 ? "" : "s";
}

// Parts of the bake that there were: ": direct 1.0 s, gather 5.3 s", or "".
static void format_parts(char *out, size_t size, const lx_stage_seconds *s)
{
    const struct {
        const char *name;
        double seconds;
    } parts[] = {{"direct", s->direct}, {"cache", s->cache}, {"gather", s->gather}, {"denoise", s->denoise}};
    *out = '\0';
    for (size_t i = 0, length = 0; i < CLI_COUNT(parts) && length < size; ++i) {
        char seconds[32];
        if (parts[i].seconds <= 0.0) continue;
        cli_format_seconds(seconds, parts[i].seconds);
        length += (size_t)snprintf(out + length, size - length, "%s%s %s", length ? ", " : ": ", parts[i].name, seconds);
    }
}

static void print_quality(const bake_options *o, const lx_bake_summary *s)
{
    char bounces[16];
    if (o->bake.transport.bounces == LX_BOUNCES_INF)
        snprintf(bounces, sizeof bounces, "inf");
    else
        snprintf(bounces, sizeof bounces, "%" PRIu32, o->bake.transport.bounces);
    printf("  light     %" PRIu32 " layer%s from %" PRIu32 " source%s, %" PRIu32 " samples, %s bounces\n", s->layer_count,
           plural(s->layer_count), s->source_count, plural(s->source_count), o->bake.samples, bounces);
    printf("  quality   %s", integrator_names[o->bake.integrator]);
    if (s->noise > 0.0f) printf(", noise %.2g %% estimated", 100.0 * (double)s->noise);
    if (o->bake.denoise != LX_DENOISE_NONE) printf(", then denoised (%s)", denoiser_names[o->bake.denoise]);
    putchar('\n');
}

static void print_summary(const bake_options *o, const lx_bake_summary *s)
{
    const double total = lx_host_seconds() - o->session.start_seconds;
    char seconds[32], total_seconds[32], rays[32], rate[32], pack[32], memory[32], predicted[32], parts[128];
    cli_format_seconds(seconds, s->seconds);
    cli_format_seconds(total_seconds, total);
    cli_format_count(rays, (double)s->ray_count);
    cli_format_count(rate, s->seconds > 0.0 ? (double)s->ray_count / s->seconds : 0.0);
    cli_format_bytes(pack, s->pack_bytes);
    cli_format_bytes(memory, lx_host_peak_memory());
    cli_format_bytes(predicted, s->predicted_bytes);
    format_parts(parts, sizeof parts, &s->stages);

    printf("%s\n", o->output);
    printf("  lightmap  %" PRIu32 " page%s of %" PRIu32 " x %" PRIu32 ", %.1f %% covered, %.3g texels/m\n", s->page_count,
           plural(s->page_count), s->page_size, s->page_size, 100.0 * (double)s->coverage, (double)s->texels_per_m);
    print_quality(o, s);
    printf("  time      %s of baking%s; %s in all; %s rays, %s rays/s\n", seconds, parts, total_seconds, rays, rate);
    printf("  machine   %s of memory at most", memory);
    if (s->predicted_bytes) printf(", %s predicted", predicted);
    if (s->group_count > 1) printf("; layers in %" PRIu32 " groups", s->group_count);
    putchar('\n');
    printf("  pack      %s/luxel.pack, %s\n", o->output, pack);
    cli_print_budget(&s->budget);
    if (o->save.report) printf("  report    %s/report.html\n", o->output);
    if (o->save.preview) printf("  preview   %s/preview.png, exposure %+.2f EV\n", o->output, (double)s->view_ev);
    if (s->invalid_count)
        printf("  note      %" PRIu64 " of %" PRIu64 " texels lie inside solid geometry and were filled from neighbours\n",
               s->invalid_count, s->texel_count);
    if (o->session.warning_count)
        printf("  warnings  %zu, printed above\n", o->session.warning_count);
}

static json_t *budget_json(const lx_budget *b)
{
    return json_pack("{s:I, s:I, s:I, s:I, s:I}", "ram", (json_int_t)b->ram, "accumulator", (json_int_t)b->accumulator, "gpu_composed",
                     (json_int_t)b->gpu_composed, "gpu_layers", (json_int_t)b->gpu_layers, "dense", (json_int_t)b->dense);
}

static json_t *stages_json(const lx_stage_seconds *s)
{
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "import", s->import, "unwrap", s->unwrap, "luxels", s->luxels,
                     "bake", s->bake, "direct", s->direct, "cache", s->cache, "gather", s->gather, "denoise", s->denoise, "post", s->post, "save", s->save,
                     "preview", s->preview);
}

static int print_json(const bake_options *o, const lx_bake_summary *s)
{
    json_t *const root = json_pack(
        "{s:s, s:s, s:I, s:I, s:f, s:f, s:I, s:I, s:s, s:I, s:o, s:o, s:s, s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:I, s:I, s:I, s:I, s:o, s:o, s:s?, s:s?, "
        "s:f, s:I}",
        "scene", o->scene_path, "folder", o->output,
        "pages", (json_int_t)s->page_count, "page_size", (json_int_t)s->page_size,
        "coverage", (double)s->coverage, "texels_per_meter", (double)s->texels_per_m,
        "layers", (json_int_t)s->layer_count, "sources", (json_int_t)s->source_count,
        "integrator", integrator_names[o->bake.integrator], "samples", (json_int_t)o->bake.samples,
        "bounces", o->bake.transport.bounces == LX_BOUNCES_INF ? json_string("inf")
                                                               : json_integer(o->bake.transport.bounces),
        "noise", s->noise > 0.0f ? json_real((double)s->noise) : json_null(), "denoise", denoiser_names[o->bake.denoise],
        "texels", (json_int_t)s->texel_count, "invalid_texels", (json_int_t)s->invalid_count,
        "paths", (json_int_t)s->path_count, "rays", (json_int_t)s->ray_count,
        "seconds", s->seconds, "total_seconds", lx_host_seconds() - o->session.start_seconds,
        "rays_per_second", s->seconds > 0.0 ? (double)s->ray_count / s->seconds : 0.0,
        "pack_bytes", (json_int_t)s->pack_bytes, "peak_memory_bytes", (json_int_t)lx_host_peak_memory(),
        "predicted_memory_bytes", (json_int_t)s->predicted_bytes, "groups", (json_int_t)s->group_count,
        "memory", budget_json(&s->budget), "stages", stages_json(&s->stages),
        "report", o->save.report ? "report.html" : NULL, "preview", o->save.preview ? "preview.png" : NULL, "view_ev", (double)s->view_ev,
        "warnings", (json_int_t)o->session.warning_count);
    if (!root) {
        fprintf(stderr, "luxel: cannot write the summary as JSON: names are no UTF-8, or memory is short\n");
        return CLI_MACHINE_FAILED;
    }
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    putchar('\n');
    json_decref(root);
    return CLI_DONE;
}

static int run(const cli_command *command, int argc, char **argv)
{
    bake_options o = {.session = cli_session_default(), .transport = cli_transport_default(),
                      .load = lx_scene_load_desc_default(), .atlas = lx_atlas_desc_default(),
                      .bake = lx_bake_desc_default(), .save = lx_save_desc_default(),
                      .quality = quality_medium, .integrator = -1, .denoise = -1, .noise = -1.0f, .interpolation = -1.0f};
    o.transport.desc.bounces = not_given;
    int status = parse(command, argc, argv, &o);
    if (status != CLI_GO_ON) {
        free(o.scratch_folder);
        return status;
    }

    lx_error error = {0};
    lx_scene *scene = NULL;
    lx_atlas *atlas = NULL;
    lx_bake *bake = NULL;
    const char *at_fault = o.output;
    lx_result result = lx_bake_check_folder(o.output, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = o.scene_path;
    result = cli_session_open(&o.session, &error);
    if (result != LX_OK) goto cleanup;
    const lx_progress_sink sink = cli_progress_sink(&o.session.progress);
    result = lx_scene_load(o.session.context, o.scene_path, &o.load, &scene, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_atlas_build(scene, &o.atlas, &sink, &atlas, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_bake_create(scene, atlas, &o.bake, &bake, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_bake_run(bake, &sink, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = o.output;
    result = lx_bake_save(bake, o.output, &o.save, &sink, &error);
cleanup:
    status = cli_finish(&o.session, result, &error, at_fault);
    if (result == LX_OK) {
        lx_bake_summary summary;
        lx_bake_get_summary(bake, &summary);
        if (o.json)
            status = print_json(&o, &summary);
        else
            print_summary(&o, &summary);
    }
    lx_bake_destroy(bake);
    lx_atlas_destroy(atlas);
    lx_scene_destroy(scene);
    cli_session_close(&o.session);
    free(o.scratch_folder);
    return status;
}

const cli_command cli_bake = {
    .name = "bake",
    .usage = "SCENE.glb -o OUT [options]",
    .summary = "bake the light of a glTF scene into a folder",
    .about = "Bakes the light of a glTF scene (.glb or .gltf) into lightmaps, one layer per light source, and writes "
             "the folder OUT: scene.glb with lightmap coordinates, luxel.json, luxel.pack, preview.png, report.html.",
    .examples = "  luxel bake room.glb -o room.baked\n"
                "  luxel bake room.glb -o room.baked --quality draft --page-size 512\n"
                "  luxel bake house.glb -o house.baked --sky noon.hdr --max-pages 4\n"
                "  luxel bake house.glb -o house.baked --quality high --time 30m\n"
                "  luxel bake club.glb -o club.baked --max-layers 300 --memory 4G\n"
                "  luxel bake room.glb -o truth.baked --integrator path --samples 4096\n"
                "  luxel bake bar.glb -o bar.baked --format ktx2,exr --encoding half\n",
    .run = run,
};
