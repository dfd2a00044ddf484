/// luxel export-web: viewer and baked folder as a static site.
#include "commands.h"
#include "session.h"

#include "luxel/host.h"
#include "luxel/serve.h"

#include <inttypes.h>
#include <stdio.h>

static int run(const cli_command *command, int argc, char **argv)
{
    cli_session session = cli_session_default();
    const char *folder = NULL, *output = NULL;
    bool quiet = false;
    const cli_option options[] = {
        {.name = "output", .letter = 'o', .argument = "DIR", .kind = CLI_TEXT, .target = &output,
         .help = "folder to write; an earlier export in it is replaced when the new one is whole"},
        {.name = "quiet", .kind = CLI_FLAG, .target = &quiet, .help = "print nothing"},
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &folder, 1, 1);
    if (status != CLI_GO_ON) return status;
    if (!output) return cli_usage_error(command, "where to? Give a folder with -o DIR");

    lx_error error = {0};
    char viewer[4096], size[32];
    lx_baked *baked = NULL;
    lx_web_export summary = {0};
    const char *at_fault = output;
    session.desc.thread_count = 1;
    lx_result result = lx_export_web_check(output, &error);
    if (result != LX_OK) goto cleanup;
    at_fault = folder;
    result = cli_session_open(&session, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_baked_open(session.context, folder, false, &baked, &error); // no site from a folder that cannot be shown
    if (result != LX_OK) goto cleanup;
    at_fault = NULL;
    result = lx_host_find_viewer(viewer, sizeof viewer, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_export_web(viewer, folder, output, &summary, &error);
cleanup:
    status = cli_finish(&session, result, &error, at_fault);
    if (result == LX_OK && !quiet) {
        cli_format_bytes(size, summary.bytes);
        printf("%s  %" PRIu32 " files, %s\n", output, summary.file_count, size);
        printf("  to see it   python3 -m http.server -d %s\n", output);
        printf("  to host it  copy the folder to any web server, below any path\n");
    }
    lx_baked_destroy(baked);
    cli_session_close(&session);
    return status;
}

const cli_command cli_export_web = {
    .name = "export-web",
    .usage = "OUT -o DIR",
    .summary = "write viewer and baked folder as a static web site",
    .about = "Writes the viewer with the baked folder OUT as a static site into DIR: any web server can host it, below any path, and the page "
             "asks no other host for anything.",
    .examples = "  luxel export-web room.baked -o site\n"
                "  python3 -m http.server -d site\n",
    .run = run,
};
