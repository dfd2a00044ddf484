/// JSON as text for people: lists of objects become tables, the rest "name  value" lines.
#ifndef LX_CLI_TABLE_H
#define LX_CLI_TABLE_H

#include <jansson.h>

/// Prints an object to stdout: first its plain values, then a headed section for each list or object in it.
void cli_print_document(const json_t *object);

#endif
