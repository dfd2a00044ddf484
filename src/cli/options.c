#include "options.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { page_columns = 80, help_column = 28 };

int cli_usage_error(const cli_command *command, const char *format, ...)
{
    char line[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    for (char *c = line; *c; ++c) // what was typed may hold anything; a message is one line
        if ((unsigned char)*c < 0x20 || *c == 0x7f) *c = '?';
    if (command)
        fprintf(stderr, "luxel %s: %s\n", command->name, line);
    else
        fprintf(stderr, "luxel: %s\n", line);
    return CLI_USAGE_WRONG;
}

// --- Near words -------------------------------------------------------------------------------------------------------

enum { longest_word = 48 };

// Letters to insert, delete, replace or swap with their neighbour (optimal string alignment distance).
static size_t edit_distance(const char *a, size_t a_length, const char *b, size_t b_length)
{
    size_t rows[3][longest_word + 1];
    size_t *before = rows[0], *above = rows[1], *row = rows[2];
    for (size_t j = 0; j <= b_length; ++j) above[j] = j;
    for (size_t i = 1; i <= a_length; ++i) {
        row[0] = i;
        for (size_t j = 1; j <= b_length; ++j) {
            size_t best = above[j - 1] + (a[i - 1] != b[j - 1]);
            if (above[j] + 1 < best) best = above[j] + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && before[j - 2] + 1 < best)
                best = before[j - 2] + 1;
            row[j] = best;
        }
        size_t *const free_row = before;
        before = above;
        above = row;
        row = free_row;
    }
    return above[b_length];
}

const char *cli_nearest(const char *given, const char *const *words, size_t count)
{
    const size_t length = strlen(given);
    if (length == 0 || length > longest_word) return NULL;
    const char *best = NULL;
    size_t best_distance = length / 3 + 2; // farther than that is a guess
    for (size_t i = 0; i < count; ++i) {
        const size_t word_length = strlen(words[i]);
        if (word_length > longest_word) continue;
        size_t distance = edit_distance(given, length, words[i], word_length);
        if (length >= 3 && strncmp(given, words[i], length) == 0) distance = 1; // the start of a word
        if (distance < best_distance) {
            best = words[i];
            best_distance = distance;
        }
    }
    return best;
}

// --- Help -------------------------------------------------------------------------------------------------------------

void cli_print_wrapped(const char *text, int column, int indent)
{
    for (bool first_of_line = true; *text;) {
        if (*text == '\n') {
            printf("\n%*s", text[1] ? indent : 0, "");
            column = indent;
            first_of_line = true;
            ++text;
            continue;
        }
        const size_t length = strcspn(text, " \n");
        if (!first_of_line && column + 1 + (int)length > page_columns - 1) {
            printf("\n%*s", indent, "");
            column = indent;
            first_of_line = true;
        }
        column += printf("%s%.*s", first_of_line ? "" : " ", (int)length, text);
        first_of_line = false;
        text += length;
        while (*text == ' ') ++text;
    }
    putchar('\n');
}

static void print_option(const cli_option *option)
{
    if (option->kind == CLI_HEADING) {
        printf("\n%s:\n", option->help);
        return;
    }
    int column = option->letter ? printf("  -%c, --%s", option->letter, option->name) : printf("  --%s", option->name);
    if (option->argument) column += printf(" %s", option->argument);
    if (column > help_column - 2) {
        putchar('\n');
        column = 0;
    }
    printf("%*s", help_column - column, "");
    cli_print_wrapped(option->help, help_column, help_column);
}

static void print_help(const cli_command *command, const cli_option *options, size_t count)
{
    printf("Usage: luxel %s %s\n\n", command->name, command->usage);
    cli_print_wrapped(command->about ? command->about : command->summary, 0, 0);
    if (count && options[0].kind != CLI_HEADING) printf("\nOptions:\n");
    for (size_t i = 0; i < count; ++i) print_option(&options[i]);
    if (command->examples) printf("\nExamples:\n%s", command->examples);
}

// --- Values -----------------------------------------------------------------------------------------------------------

// Position of the first `length` letters of `text` among words separated by `separator`; -1: none of them.
static int find_word(const char *words, char separator, const char *text, size_t length)
{
    for (int index = 0;; ++index) {
        const char *const end = strchr(words, separator);
        const size_t word_length = end ? (size_t)(end - words) : strlen(words);
        if (word_length == length && memcmp(words, text, length) == 0) return index;
        if (!end) return -1;
        words = end + 1;
    }
}

static int check_range(const cli_command *command, const cli_option *option, double value, const char *text)
{
    if (value < option->min) return cli_usage_error(command, "--%s: %s is below %g", option->name, text, option->min);
    if (option->max > 0.0 && value > option->max)
        return cli_usage_error(command, "--%s: %s is above %.10g", option->name, text, option->max);
    return CLI_GO_ON;
}

static int store_uint(const cli_command *command, const cli_option *option, const char *text)
{
    char *end = NULL;
    errno = 0;
    const unsigned long long value = strtoull(text, &end, 10);
    if (!isdigit((unsigned char)text[0]) || *end) // strtoull would take " 7" and "-1"
        return cli_usage_error(command, "--%s: '%s' is not a whole number%s", option->name, text,
                               option->kind == CLI_UINT_OR_INF ? " or inf" : "");
    if (errno || value > UINT32_MAX - 1) return cli_usage_error(command, "--%s: %s is too large", option->name, text);
    const int status = check_range(command, option, (double)value, text);
    if (status == CLI_GO_ON) *(uint32_t *)option->target = (uint32_t)value;
    return status;
}

static int store_float(const cli_command *command, const cli_option *option, const char *text)
{
    char *end = NULL;
    const float value = strtof(text, &end);
    if (end == text || *end || isspace((unsigned char)text[0]) || !isfinite(value))
        return cli_usage_error(command, "--%s: '%s' is not a number", option->name, text);
    const int status = check_range(command, option, (double)value, text);
    if (status == CLI_GO_ON) *(float *)option->target = value;
    return status;
}

// Digits with at most one point, nothing else: strtod would take "inf", "0x1p3" and " 7". Returns what follows; NULL: no number.
static const char *read_decimal(const char *text, double *out)
{
    char digits[64];
    const size_t length = strspn(text, "0123456789.");
    if (length == 0 || length >= sizeof digits) return NULL;
    memcpy(digits, text, length);
    digits[length] = '\0';
    char *end = NULL;
    *out = strtod(digits, &end);
    return *end ? NULL : text + length;
}

// Hours, minutes, seconds in this order, none twice; a number without a unit is seconds.
static bool parse_duration(const char *text, double *out)
{
    static const char units[] = "hms";
    static const double seconds[] = {3600, 60, 1};
    size_t next = 0;
    *out = 0;
    for (const char *c = text; *c;) {
        double value;
        c = read_decimal(c, &value);
        if (!c) return false;
        const char *const unit = *c ? strchr(units + next, *c) : &units[2];
        if (!unit || (!*c && next > 0)) return false; // "1h30": of what?
        *out += value * seconds[unit - units];
        next = (size_t)(unit - units) + 1;
        if (*c) ++c;
    }
    return *text && *out > 0;
}

static int store_duration(const cli_command *command, const cli_option *option, const char *text)
{
    double seconds;
    if (!parse_duration(text, &seconds))
        return cli_usage_error(command, "--%s: '%s' is no duration: 90, 90s, 5m and 1h30m are", option->name, text);
    const int status = check_range(command, option, seconds, text);
    if (status == CLI_GO_ON) *(double *)option->target = seconds;
    return status;
}

static bool parse_size(const char *text, double *out)
{
    static const char units[] = "kmgt";
    const char *unit = read_decimal(text, out);
    if (!unit) return false;
    if (*unit && strcmp(unit, "B") != 0) {
        const char *const found = strchr(units, tolower((unsigned char)*unit));
        if (!found) return false;
        for (const char *u = units; u <= found; ++u) *out *= 1024;
        ++unit;
        if (*unit && strcmp(unit, "B") != 0 && strcmp(unit, "iB") != 0) return false;
    }
    return *out >= 1;
}

static int store_size(const cli_command *command, const cli_option *option, const char *text)
{
    double bytes;
    if (!parse_size(text, &bytes))
        return cli_usage_error(command, "--%s: '%s' is no size: 2G, 1500M and a number of bytes are", option->name, text);
    if (bytes >= 0x1p63) return cli_usage_error(command, "--%s: %s is too large", option->name, text);
    *(uint64_t *)option->target = (uint64_t)bytes;
    return CLI_GO_ON;
}

static int store_choices(const cli_command *command, const cli_option *option, const char *text)
{
    uint32_t bits = 0;
    for (const char *word = text;;) {
        const size_t length = strcspn(word, ",");
        const int index = find_word(option->argument, ',', word, length);
        if (index < 0)
            return cli_usage_error(command, "--%s: '%.*s' is none of %s", option->name, (int)length, word, option->argument);
        bits |= 1u << index;
        if (!word[length]) break;
        word += length + 1;
    }
    *(uint32_t *)option->target = bits;
    return CLI_GO_ON;
}

static int store(const cli_command *command, const cli_option *option, const char *text)
{
    switch (option->kind) {
    case CLI_HEADING: break;
    case CLI_FLAG: *(bool *)option->target = true; break;
    case CLI_TEXT: *(const char **)option->target = text; break;
    case CLI_TEXTS: {
        cli_texts *const texts = option->target;
        if (texts->count == CLI_COUNT(texts->items))
            return cli_usage_error(command, "--%s is given more than %zu times", option->name, texts->count);
        texts->items[texts->count++] = text;
        break;
    }
    case CLI_UINT_OR_INF:
        if (strcmp(text, "inf") == 0) {
            *(uint32_t *)option->target = UINT32_MAX;
            break;
        }
        return store_uint(command, option, text);
    case CLI_UINT: return store_uint(command, option, text);
    case CLI_FLOAT: return store_float(command, option, text);
    case CLI_DURATION: return store_duration(command, option, text);
    case CLI_SIZE: return store_size(command, option, text);
    case CLI_CHOICE: {
        const int index = find_word(option->argument, '|', text, strlen(text));
        if (index < 0)
            return cli_usage_error(command, "--%s: '%s' is none of %s", option->name, text, option->argument);
        *(int *)option->target = index;
        break;
    }
    case CLI_CHOICES: return store_choices(command, option, text);
    }
    return CLI_GO_ON;
}

// --- Parsing ----------------------------------------------------------------------------------------------------------

static const cli_option *find_option(const cli_option *options, size_t count, const char *name, size_t length)
{
    for (size_t i = 0; i < count; ++i)
        if (options[i].kind != CLI_HEADING && strlen(options[i].name) == length && memcmp(options[i].name, name, length) == 0)
            return &options[i];
    return NULL;
}

static const cli_option *find_letter(const cli_option *options, size_t count, char letter)
{
    for (size_t i = 0; i < count; ++i)
        if (options[i].kind != CLI_HEADING && options[i].letter == letter) return &options[i];
    return NULL;
}

static int unknown_option(const cli_command *command, const cli_option *options, size_t count, const char *given,
                          size_t length)
{
    const char *words[128] = {"help"};
    size_t word_count = 1;
    for (size_t i = 0; i < count && word_count < CLI_COUNT(words); ++i)
        if (options[i].kind != CLI_HEADING) words[word_count++] = options[i].name;
    char name[longest_word + 1] = "";
    if (length > 2 && length - 2 <= longest_word) memcpy(name, given + 2, length - 2);
    const char *const nearest = cli_nearest(name, words, word_count);
    if (nearest)
        return cli_usage_error(command, "unknown option '%.*s'; did you mean '--%s'?", (int)length, given, nearest);
    return cli_usage_error(command, "unknown option '%.*s' (luxel %s --help lists them)", (int)length, given,
                           command->name);
}

int cli_parse(const cli_command *command, const cli_option *options, size_t option_count, int argc, char **argv,
              const char **positionals, size_t min_positionals, size_t max_positionals)
{
    // Help wins over anything else that may be wrong on the line.
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; ++i)
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0) {
            print_help(command, options, option_count);
            return CLI_DONE;
        }
    size_t positional_count = 0;
    bool options_over = false;
    for (int i = 1; i < argc; ++i) {
        const char *const argument = argv[i];
        if (options_over || argument[0] != '-' || argument[1] == '\0') {
            if (positional_count == max_positionals)
                return cli_usage_error(command, "unexpected argument '%s' (usage: luxel %s %s)", argument, command->name,
                                       command->usage);
            positionals[positional_count++] = argument;
            continue;
        }
        if (strcmp(argument, "--") == 0) {
            options_over = true;
            continue;
        }
        const bool is_long = argument[1] == '-';
        const size_t length = strcspn(argument, "=");
        const char *value = argument[length] == '=' ? argument + length + 1 : NULL;
        const cli_option *const option = is_long       ? find_option(options, option_count, argument + 2, length - 2)
                                         : length == 2 ? find_letter(options, option_count, argument[1])
                                                       : NULL;
        if (!option) return unknown_option(command, options, option_count, argument, length);
        if (option->kind == CLI_FLAG) {
            if (value) return cli_usage_error(command, "option '%.*s' takes no value", (int)length, argument);
        } else if (!value) {
            if (i + 1 == argc)
                return cli_usage_error(command, "option '%s' needs a value: %s", argument, option->argument);
            value = argv[++i];
        }
        const int status = store(command, option, value);
        if (status != CLI_GO_ON) return status;
    }
    if (positional_count < min_positionals)
        return cli_usage_error(command, "an argument is missing (usage: luxel %s %s)", command->name, command->usage);
    return CLI_GO_ON;
}
