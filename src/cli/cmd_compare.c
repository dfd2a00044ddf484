/// luxel compare: how far one picture is from another.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"
#include "luxel/picture.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>

static void print_table(const lx_comparison *c)
{
    const double pixels = (double)c->width * c->height;
    printf("size           %" PRIu32 " x %" PRIu32 ", %" PRIu64 " valid (%.1f %%)\n", c->width, c->height, c->valid_count,
           100.0 * (double)c->valid_count / pixels);
    printf("mean           %.6g and %.6g\n", c->mean_a, c->mean_b);
    printf("RMSE           %.6g\n", c->rmse);
    printf("relative RMSE  %.6g\n", c->relative_rmse);
    printf("relMSE         %.6g\n", c->rel_mse);
    printf("worst          %.6g at (%" PRIu32 ", %" PRIu32 ")\n", c->worst, c->worst_x, c->worst_y);
}

static json_t *real_or_null(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

static int print_json(const lx_comparison *c)
{
    json_t *const root =
        json_pack("{s:I, s:I, s:I, s:o, s:o, s:o, s:o, s:o, s:o, s:[I, I]}", "width", (json_int_t)c->width, "height",
                  (json_int_t)c->height, "valid", (json_int_t)c->valid_count, "mean_a", real_or_null(c->mean_a), "mean_b",
                  real_or_null(c->mean_b), "rmse", real_or_null(c->rmse), "relative_rmse", real_or_null(c->relative_rmse),
                  "rel_mse", real_or_null(c->rel_mse), "worst", real_or_null(c->worst), "worst_pixel",
                  (json_int_t)c->worst_x, (json_int_t)c->worst_y);
    if (!root) {
        fprintf(stderr, "luxel: out of memory (JSON)\n");
        return CLI_MACHINE_FAILED;
    }
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    putchar('\n');
    json_decref(root);
    return CLI_DONE;
}

static int run(const cli_command *command, int argc, char **argv)
{
    const char *paths[2] = {NULL, NULL}, *difference = NULL;
    uint32_t erode = 0;
    float limit = -1.0f;
    bool json = false;
    const cli_option options[] = {
        {.name = "erode", .argument = "N", .kind = CLI_UINT, .target = &erode, .max = 4096,
         .help = "leave out pixels within N of one whose alpha is zero"},
        {.name = "difference", .argument = "D.png", .kind = CLI_TEXT, .target = &difference,
         .help = "save |B - A| as a picture (.png, .exr, .hdr)"},
        {.name = "max-relative-rmse", .argument = "X", .kind = CLI_FLOAT, .target = &limit,
         .help = "exit with 1 if the relative RMSE is above X"},
        {.name = "json", .kind = CLI_FLAG, .target = &json, .help = "as JSON"},
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, paths, 2, 2);
    if (status != CLI_GO_ON) return status;

    lx_error error = {0};
    lx_result result = difference ? lx_host_check_output(difference, &error) : LX_OK;
    lx_comparison comparison;
    if (result == LX_OK) result = lx_picture_compare(paths[0], paths[1], erode, difference, &comparison, &error);
    if (result != LX_OK) return cli_finish(NULL, result, &error, NULL);
    if (json)
        status = print_json(&comparison);
    else
        print_table(&comparison);
    if (json && status != CLI_DONE) return status;
    if (limit >= 0.0f && !(comparison.relative_rmse <= (double)limit)) {
        fprintf(stderr, "luxel: %s: relative RMSE %.6g is above %g\n", paths[1], comparison.relative_rmse, (double)limit);
        return CLI_INPUT_WRONG;
    }
    return CLI_DONE;
}

const cli_command cli_compare = {
    .name = "compare",
    .usage = "A B [options]",
    .summary = "measure how far one picture is from another",
    .about = "Measures how far picture B is from picture A (.exr .hdr .png .jpg .webp; 8-bit ones are read as sRGB), over "
             "the pixels that are valid in both: alpha above zero where there is alpha, else all.",
    .examples = "  luxel compare truth.exr baked.exr\n"
                "  luxel compare truth.png baked.png --difference difference.png\n"
                "  luxel compare a.exr b.exr --erode 2 --max-relative-rmse 0.02\n",
    .run = run,
};
