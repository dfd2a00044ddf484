/// luxel bake: scene in, baked folder out.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

_Static_assert(LX_LIGHTMAP_KTX2 == 1 << 0 && LX_LIGHTMAP_EXR == 1 << 1 && LX_LIGHTMAP_HDR == 1 << 2,
               "--format lists its words in the order of these bits");

enum { quality_draft, quality_medium, quality_high };
static const uint32_t quality_samples[] = {[quality_draft] = 64, [quality_medium] = 256, [quality_high] = 1024};

enum { samples_max = 16 * 1024 * 1024 };

typedef struct bake_options {
    cli_session session;
    cli_transport transport;
    lx_scene_load_desc load;
    lx_atlas_desc atlas;
    lx_bake_desc bake;
    lx_save_desc save;
    const char *scene_path, *output;
    const char *integrator;
    int quality, layers, encoding, light_units;
    uint32_t samples; // 0: what the quality says
    bool no_preview, no_report, json;
} bake_options;

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
         .help = "64, 256 or 1024 samples (default medium)"},
        {.name = "samples", .argument = "N", .kind = CLI_UINT, .target = &o->samples, .min = 1, .max = samples_max,
         .help = "paths per texel; four times as many halve the noise"},
        {.name = "integrator", .argument = "path", .kind = CLI_TEXT, .target = &o->integrator,
         .help = "how light is followed; path is the only one so far"},
        {.kind = CLI_HEADING, .help = "Light"},
        CLI_TRANSPORT_OPTIONS(o->transport),
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
        CLI_SESSION_OPTIONS(o->session),
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &o->scene_path, 1, 1);
    if (status != CLI_GO_ON) return status;

    if (!o->output) return cli_usage_error(command, "where to? Give a folder with -o OUT");
    if (strcmp(o->integrator, "path") != 0 && strcmp(o->integrator, "gather") != 0)
        return cli_usage_error(command, "--integrator: '%s' does not exist", o->integrator);
    o->bake.integrator = strcmp(o->integrator, "path") == 0 ? LX_INTEGRATOR_PATH : LX_INTEGRATOR_GATHER;
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
    status = cli_transport_check(command, &o->transport);
    if (status != CLI_GO_ON) return status;

    o->bake.transport = o->transport.desc;
    o->bake.samples = o->samples ? o->samples : quality_samples[o->quality];
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

static void print_summary(const bake_options *o, const lx_bake_summary *s)
{
    const double total = lx_host_seconds() - o->session.start_seconds;
    char seconds[32], total_seconds[32], rays[32], rate[32], pack[32], memory[32], bounces[16];
    cli_format_seconds(seconds, s->seconds);
    cli_format_seconds(total_seconds, total);
    cli_format_count(rays, (double)s->ray_count);
    cli_format_count(rate, s->seconds > 0.0 ? (double)s->ray_count / s->seconds : 0.0);
    cli_format_bytes(pack, s->pack_bytes);
    cli_format_bytes(memory, lx_host_peak_memory());
    if (o->bake.transport.bounces == LX_BOUNCES_INF)
        snprintf(bounces, sizeof bounces, "inf");
    else
        snprintf(bounces, sizeof bounces, "%" PRIu32, o->bake.transport.bounces);

    printf("%s\n", o->output);
    printf("  lightmap  %" PRIu32 " page%s of %" PRIu32 " x %" PRIu32 ", %.1f %% covered, %.3g texels/m\n", s->page_count,
           plural(s->page_count), s->page_size, s->page_size, 100.0 * (double)s->coverage, (double)s->texels_per_m);
    printf("  light     %" PRIu32 " layer%s from %" PRIu32 " source%s, %" PRIu32 " samples, %s bounces\n", s->layer_count,
           plural(s->layer_count), s->source_count, plural(s->source_count), o->bake.samples, bounces);
    printf("  time      %s of baking, %s in all; %s rays, %s rays/s; %s of memory\n", seconds, total_seconds, rays, rate,
           memory);
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
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "import", s->import, "unwrap", s->unwrap, "luxels", s->luxels, "bake", s->bake,
                     "post", s->post, "save", s->save, "preview", s->preview);
}

static int print_json(const bake_options *o, const lx_bake_summary *s)
{
    json_t *const root = json_pack(
        "{s:s, s:s, s:I, s:I, s:f, s:f, s:I, s:I, s:I, s:o, s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:I, s:I, s:o, s:o, s:s?, s:s?, s:f, s:I}",
        "scene", o->scene_path, "folder", o->output,
        "pages", (json_int_t)s->page_count, "page_size", (json_int_t)s->page_size,
        "coverage", (double)s->coverage, "texels_per_meter", (double)s->texels_per_m,
        "layers", (json_int_t)s->layer_count, "sources", (json_int_t)s->source_count,
        "samples", (json_int_t)o->bake.samples,
        "bounces", o->bake.transport.bounces == LX_BOUNCES_INF ? json_string("inf")
                                                               : json_integer(o->bake.transport.bounces),
        "texels", (json_int_t)s->texel_count, "invalid_texels", (json_int_t)s->invalid_count,
        "paths", (json_int_t)s->path_count, "rays", (json_int_t)s->ray_count,
        "seconds", s->seconds, "total_seconds", lx_host_seconds() - o->session.start_seconds,
        "rays_per_second", s->seconds > 0.0 ? (double)s->ray_count / s->seconds : 0.0,
        "pack_bytes", (json_int_t)s->pack_bytes, "peak_memory_bytes", (json_int_t)lx_host_peak_memory(),
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
                      .integrator = "path", .quality = quality_medium};
    int status = parse(command, argc, argv, &o);
    if (status != CLI_GO_ON) return status;

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
                "  luxel bake bar.glb -o bar.baked --format ktx2,exr --encoding half\n",
    .run = run,
};
