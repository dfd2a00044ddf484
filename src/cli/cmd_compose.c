/// luxel compose: one lightmap page at the wanted colours, as a picture.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"
#include "luxel/picture.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int run(const cli_command *command, int argc, char **argv)
{
    cli_session session = cli_session_default();
    const char *folder = NULL, *output = NULL;
    uint32_t page = 0;
    cli_texts assignments = {.count = 0};
    const cli_option options[] = {
        {.name = "output", .letter = 'o', .argument = "FILE", .kind = CLI_TEXT, .target = &output,
         .help = ".exr or .hdr: irradiance in lux; .png: the same clamped to 0..1, as sRGB"},
        {.name = "page", .argument = "N", .kind = CLI_UINT, .target = &page, .help = "counted from 0 (default 0)"},
        {.name = "set", .argument = "LAYER=COLOUR[*X]", .kind = CLI_TEXTS, .target = &assignments,
         .help = "recolours a layer, X its intensity: #rrggbb (sRGB), r,g,b (linear) or off; LAYER may be a pattern; may "
                 "be repeated"},
        {.name = "quiet", .help = "print nothing but warnings", .kind = CLI_FLAG, .target = &session.quiet},
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &folder, 1, 1);
    if (status != CLI_GO_ON) return status;
    if (!output) return cli_usage_error(command, "where to? Give a picture with -o FILE.exr");
    char extension[8];
    cli_extension(output, extension);
    if (strcmp(extension, "png") != 0 && strcmp(extension, "exr") != 0 && strcmp(extension, "hdr") != 0)
        return cli_usage_error(command, "-o: '%s' does not end with .exr, .hdr or .png", output);

    lx_error error = {0};
    lx_baked *baked = NULL;
    float *rgb = NULL;
    const char *at_fault = output;
    lx_result result = lx_host_check_output(output, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = folder;
    session.desc.thread_count = 1; // a sum of pictures
    result = cli_session_open(&session, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_baked_open(session.context, folder, false, &baked, &error);
    if (result != LX_OK) goto cleanup;
    const uint32_t page_count = lx_baked_page_count(baked), size = lx_baked_page_size(baked);
    if (page >= page_count) {
        snprintf(error.message, sizeof error.message, "--page: there is no page %" PRIu32 ", the last is %" PRIu32, page,
                 page_count - 1);
        result = LX_ERROR_INVALID_ARGUMENT;
        goto cleanup;
    }
    for (size_t i = 0; i < assignments.count; ++i) {
        result = lx_baked_set(baked, assignments.items[i], &error);
        if (result != LX_OK) goto cleanup;
    }
    rgb = malloc((size_t)size * size * 3 * sizeof *rgb);
    if (!rgb) {
        result = LX_ERROR_OUT_OF_MEMORY;
        goto cleanup;
    }
    result = lx_baked_compose(baked, page, rgb, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = output;
    result = lx_picture_save(output, size, size, rgb, &error);
cleanup:
    status = cli_finish(&session, result, &error, at_fault);
    if (result == LX_OK && !session.quiet) printf("%s  page %" PRIu32 ", %" PRIu32 " x %" PRIu32 "\n", output, page, size, size);
    free(rgb);
    lx_baked_destroy(baked);
    cli_session_close(&session);
    return status;
}

const cli_command cli_compose = {
    .name = "compose",
    .usage = "OUT -o FILE.exr [options]",
    .summary = "sum the layers of a baked folder into one lightmap",
    .about = "Sums the layers of one lightmap page at authored or other colours and saves the irradiance.",
    .examples = "  luxel compose room.baked -o lightmap.exr\n"
                "  luxel compose room.baked -o lamp.hdr --set '*=off' --set lamp=1,1,1\n",
    .run = run,
};
