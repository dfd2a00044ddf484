/// The command line: one table per command says what it takes, and the help is printed from the same table.
#ifndef LX_CLI_OPTIONS_H
#define LX_CLI_OPTIONS_H

#include <stddef.h>
#include <stdint.h>

/// Exit codes of every command.
enum {
    CLI_DONE = 0,
    CLI_INPUT_WRONG = 1,
    CLI_USAGE_WRONG = 2,
    CLI_MACHINE_FAILED = 3,
    CLI_STOPPED = 130,
};

typedef enum cli_kind {
    CLI_HEADING,     ///< No option: `help` is a heading of the help page.
    CLI_FLAG,        ///< bool, set to true.
    CLI_TEXT,        ///< const char *, borrowed from argv.
    CLI_TEXTS,       ///< cli_texts, may be given several times.
    CLI_UINT,        ///< uint32_t in [min, max].
    CLI_UINT_OR_INF, ///< The same; the word "inf" gives UINT32_MAX.
    CLI_FLOAT,       ///< float in [min, max], finite.
    CLI_DURATION,    ///< double, seconds: "90", "90s", "5m", "1h30m". More than 0.
    CLI_SIZE,        ///< uint64_t, bytes: "2G", "1.5GiB", "1500M", "64k", or a plain number. Powers of 1024. More than 0.
    CLI_CHOICE,      ///< int, the position of the word in `argument` ("draft|medium|high").
    CLI_CHOICES,     ///< uint32_t, bit i for word i; words are given with commas ("ktx2,exr").
} cli_kind;

typedef struct cli_texts {
    const char *items[256];
    size_t count;
} cli_texts;

typedef struct cli_option {
    const char *name;     ///< Without dashes.
    const char *argument; ///< As the help shows it; NULL for flags.
    const char *help;
    cli_kind kind;
    void *target;         ///< Keeps its value when the option is not given.
    double min, max;      ///< Numbers; max 0: no upper bound.
    char letter;          ///< 'o' for -o; 0: none.
} cli_option;

typedef struct cli_command {
    const char *name;
    const char *usage;    ///< What follows the name, e.g. "SCENE.glb -o OUT".
    const char *summary;  ///< One line for `luxel --help`.
    const char *about;    ///< Paragraphs for the command's own help; NULL: none.
    const char *examples; ///< Whole lines.
    int (*run)(const struct cli_command *command, int argc, char **argv); ///< argv[0] is the command's name.
} cli_command;

#define CLI_GO_ON (-1)

/// Fills the targets and up to `max_positionals` positional arguments (fewer than `min_positionals` is an error).
/// CLI_GO_ON, or the exit code with which to end: after --help, or after an error that was printed.
int cli_parse(const cli_command *command, const cli_option *options, size_t option_count, int argc, char **argv,
              const char **positionals, size_t min_positionals, size_t max_positionals);

/// Prints "luxel COMMAND: message" and returns CLI_USAGE_WRONG.
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
int cli_usage_error(const cli_command *command, const char *format, ...);

/// The word of `words` that was most likely meant by `given`; NULL if none is near.
const char *cli_nearest(const char *given, const char *const *words, size_t count);

/// Prints words wrapped to 80 columns, each line indented; the first line starts at column `column`.
void cli_print_wrapped(const char *text, int column, int indent);

#define CLI_COUNT(array) (sizeof(array) / sizeof *(array))

#endif
