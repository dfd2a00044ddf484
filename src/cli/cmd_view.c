/// luxel view: the viewer in the browser, served on this machine alone.
#include "commands.h"
#include "interrupt.h"
#include "session.h"

#include "luxel/host.h"
#include "luxel/serve.h"

#include <stdio.h>

static void wait_for_interrupt(void)
{
    while (!cli_interrupted()) lx_host_sleep(0.1); // the signal itself ends the sleep
}

static int run(const cli_command *command, int argc, char **argv)
{
    cli_session session = cli_session_default();
    const char *folder = NULL;
    uint32_t port = 0;
    bool no_browser = false;
    const cli_option options[] = {
        {.name = "port", .argument = "N", .kind = CLI_UINT, .target = &port, .max = 65535,
         .help = "where to listen on 127.0.0.1 (default 0: any free port)"},
        {.name = "no-browser", .kind = CLI_FLAG, .target = &no_browser, .help = "only print the address"},
    };
    int status = cli_parse(command, options, CLI_COUNT(options), argc, argv, &folder, 1, 1);
    if (status != CLI_GO_ON) return status;

    lx_error error = {0};
    char viewer[4096];
    lx_baked *baked = NULL;
    lx_server *server = NULL;
    const char *at_fault = folder;
    session.desc.thread_count = 1;
    lx_result result = cli_session_open(&session, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_baked_open(session.context, folder, false, &baked, &error); // says here what a page could only hint at
    if (result != LX_OK) goto cleanup;
    lx_baked_destroy(baked);
    baked = NULL;
    at_fault = NULL;
    result = lx_host_find_viewer(viewer, sizeof viewer, &error);
    if (result != LX_OK) goto cleanup;
    result = lx_server_create(viewer, folder, port, &server, &error);
    if (result != LX_OK) goto cleanup;
    printf("viewing %s at %s \u2014 Ctrl-C ends\n", folder, lx_server_url(server));
    fflush(stdout);
    if (!no_browser && lx_host_has_display() && !lx_host_open_browser(lx_server_url(server)))
        fprintf(stderr, "luxel: note: no browser could be started (there is no xdg-open); open the address yourself\n");
    wait_for_interrupt();
cleanup:
    status = cli_finish(&session, result, &error, at_fault);
    lx_server_destroy(server);
    lx_baked_destroy(baked);
    cli_session_close(&session);
    return status;
}

const cli_command cli_view = {
    .name = "view",
    .usage = "OUT [options]",
    .summary = "show a baked folder in the browser, lights at hand",
    .about = "Serves the viewer and the baked folder OUT on this machine alone (127.0.0.1) and opens the browser, if there is a display. "
             "Ctrl-C ends it, with exit code 0. A new bake into OUT shows when the page is loaded again.",
    .examples = "  luxel view room.baked\n"
                "  luxel view room.baked --port 8080 --no-browser\n",
    .run = run,
};
