/// The subcommands, one per cmd_NAME.c.
#ifndef LX_CLI_COMMANDS_H
#define LX_CLI_COMMANDS_H

#include "options.h"

extern const cli_command cli_bake;
extern const cli_command cli_render;
extern const cli_command cli_inspect;
extern const cli_command cli_compose;
extern const cli_command cli_irradiance;
extern const cli_command cli_compare;
extern const cli_command cli_view;
extern const cli_command cli_export_web;

#endif
