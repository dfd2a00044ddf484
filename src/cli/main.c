/// luxel: bakes light into glTF scenes. One file cmd_NAME.c per subcommand; this one finds the right one.
#include "commands.h"

#include "luxel/base.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static const cli_command *const commands[] = {&cli_bake,    &cli_render,     &cli_view,    &cli_inspect,
                                              &cli_compose, &cli_irradiance, &cli_compare, &cli_export_web};

static const cli_command *find_command(const char *name)
{
    for (size_t i = 0; i < CLI_COUNT(commands); ++i)
        if (strcmp(commands[i]->name, name) == 0) return commands[i];
    return NULL;
}

static int print_help(void)
{
    printf("Luxel bakes light once, so that it can be recoloured forever.\n"
           "\n"
           "Usage: luxel COMMAND [options]\n"
           "\n");
    for (size_t i = 0; i < CLI_COUNT(commands); ++i) printf("  %-12s %s\n", commands[i]->name, commands[i]->summary);
    printf("\n"
           "  luxel COMMAND --help   options and examples of a command\n"
           "  luxel --version        the version\n"
           "\n"
           "Exit codes: 0 done, 1 the input is wrong, 2 the command line is wrong,\n"
           "3 the machine failed (disk, memory), 130 stopped by Ctrl-C.\n");
    return CLI_DONE;
}

static int unknown_command(const char *name)
{
    const char *names[CLI_COUNT(commands)];
    for (size_t i = 0; i < CLI_COUNT(commands); ++i) names[i] = commands[i]->name;
    const char *const nearest = cli_nearest(name, names, CLI_COUNT(names));
    if (nearest) return cli_usage_error(NULL, "unknown command '%s'; did you mean '%s'?", name, nearest);
    return cli_usage_error(NULL, "unknown command '%s' (luxel --help lists them)", name);
}

static int dispatch(int argc, char **argv)
{
    if (argc < 2) {
        print_help();
        return CLI_USAGE_WRONG;
    }
    const char *name = argv[1];
    if (strcmp(name, "--version") == 0) {
        printf("luxel %s\n", LX_VERSION);
        return CLI_DONE;
    }
    const bool help_word = strcmp(name, "help") == 0;
    if (help_word || strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
        if (argc == 2) return print_help();
        const cli_command *const command = find_command(argv[2]);
        if (!command) return unknown_command(argv[2]);
        char *help_argv[] = {argv[2], "--help", NULL};
        return command->run(command, 2, help_argv);
    }
    const cli_command *const command = find_command(name);
    if (command) return command->run(command, argc - 1, argv + 1);
    if (name[0] == '-') return cli_usage_error(NULL, "unknown option '%s' (luxel --help)", name);
    return unknown_command(name);
}

int main(int argc, char **argv)
{
    const int status = dispatch(argc, argv);
    // A full disk behind a redirection must not pass for success.
    if ((fflush(stdout) != 0 || ferror(stdout)) && status == CLI_DONE) {
        fprintf(stderr, "luxel: cannot write to standard output\n");
        return CLI_MACHINE_FAILED;
    }
    return status;
}
