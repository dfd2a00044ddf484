// Programs as text: parsing alone. What they do is said in runtime/include/luxel_rt.h at lxrt_program_kind.
#include "scene/program.h"

#include "base/error.h"
#include "math/color.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

enum { most_keys = 4096 };
static const float longest_s = 1e9f;

static const char *const names[] = {
    [LX_PROGRAM_CONSTANT] = "constant", [LX_PROGRAM_KEYS] = "keys",   [LX_PROGRAM_BLINK] = "blink",       [LX_PROGRAM_FLICKER] = "flicker",
    [LX_PROGRAM_PULSE] = "pulse",       [LX_PROGRAM_WHEEL] = "wheel", [LX_PROGRAM_SCHEDULE] = "schedule",
};

const char *lx_program_name(lx_program_kind kind)
{
    return names[kind];
}

bool lx_take_number(const char **text, float *out)
{
    const char *at = *text;
    if (!isdigit((unsigned char)*at) && *at != '.') return false;
    if (at[0] == '0' && (at[1] == 'x' || at[1] == 'X')) return false;
    char *end;
    *out = strtof(at, &end);
    if (end == at || !(*out < INFINITY)) return false;
    *text = end;
    return true;
}

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

bool lx_take_color(const char **text, lx_rgb *out)
{
    float v[3];
    const char *at = *text;
    if (strncmp(at, "off", 3) == 0) {
        *out = (lx_rgb){0, 0, 0};
        *text = at + 3;
        return true;
    }
    if (*at == '#') {
        for (int i = 0; i < 3; ++i) {
            const int high = hex_digit(at[1 + 2 * i]), low = high < 0 ? -1 : hex_digit(at[2 + 2 * i]);
            if (low < 0) return false;
            v[i] = lx_srgb_byte_to_linear[16 * high + low];
        }
        at += 7;
    } else {
        for (int i = 0; i < 3; ++i) {
            if (i > 0 && *at++ != ',') return false;
            if (!lx_take_number(&at, &v[i])) return false;
        }
    }
    *out = lx_rgb_of(v[0], v[1], v[2]);
    *text = at;
    return true;
}

// A time from the front of *text: 90, 90s, 250ms, 1.5min, 24h, 19:30.
static bool take_time(const char **text, float *out)
{
    static const struct {
        const char *unit;
        float seconds;
    } units[] = {{"ms", 1e-3f}, {"min", 60}, {"h", 3600}, {"s", 1}};
    float number, minutes;
    if (!lx_take_number(text, &number)) return false;
    if (**text == ':') {
        ++*text;
        if (!lx_take_number(text, &minutes) || !(minutes < 60)) return false;
        *out = number * 3600 + minutes * 60;
        return *out <= longest_s;
    }
    *out = number;
    for (size_t i = 0; i < sizeof units / sizeof *units; ++i)
        if (strncmp(*text, units[i].unit, strlen(units[i].unit)) == 0) {
            *out = number * units[i].seconds;
            *text += strlen(units[i].unit);
            break;
        }
    return *out <= longest_s;
}

typedef enum value_kind { value_time, value_number, value_share, value_seed, value_color } value_kind;

static bool read_value(const char *text, value_kind kind, void *out)
{
    float number;
    switch (kind) {
    case value_time:
        if (!take_time(&text, out)) return false;
        break;
    case value_color:
        if (!lx_take_color(&text, out)) return false;
        break;
    case value_seed:
        if (!lx_take_number(&text, &number) || number > 1e9f) return false;
        *(uint32_t *)out = (uint32_t)number;
        break;
    default:
        if (!lx_take_number(&text, out) || (kind == value_share && *(float *)out > 1)) return false;
    }
    return *text == '\0';
}

enum { of_constant = 1 << LX_PROGRAM_CONSTANT, of_blink = 1 << LX_PROGRAM_BLINK, of_flicker = 1 << LX_PROGRAM_FLICKER,
       of_pulse = 1 << LX_PROGRAM_PULSE, of_wheel = 1 << LX_PROGRAM_WHEEL, of_schedule = 1 << LX_PROGRAM_SCHEDULE,
       of_waves = of_blink | of_flicker | of_pulse, of_moving = of_waves | of_wheel | of_schedule,
       of_tinted = of_waves | of_wheel | of_constant };

// NAME=VALUE.
static lx_result read_parameter(const char *word, const char *value, lx_program *out, lx_error *error)
{
    const struct {
        const char *name;
        value_kind kind;
        int programs;
        void *target;
        bool *given;
    } parameters[] = {
        {"period", value_time, of_moving, &out->period_s, NULL},     {"phase", value_time, of_moving, &out->phase_s, NULL},
        {"duty", value_share, of_blink, &out->duty, NULL},           {"low", value_number, of_waves, &out->low, NULL},
        {"high", value_number, of_waves, &out->high, NULL},          {"fade", value_time, of_schedule, &out->fade_s, NULL},
        {"seed", value_seed, of_flicker, &out->seed, &out->has_seed}, {"color", value_color, of_tinted, &out->color, &out->has_color},
        {"intensity", value_number, of_tinted, &out->intensity, NULL},
    };
    const size_t length = (size_t)(value - word) - 1;
    for (size_t i = 0; i < sizeof parameters / sizeof *parameters; ++i) {
        if (strlen(parameters[i].name) != length || strncmp(word, parameters[i].name, length) != 0) continue;
        if (!(parameters[i].programs & 1 << out->kind))
            return lx_fail(error, LX_ERROR_FORMAT, "%s has no %s", names[out->kind], parameters[i].name);
        if (!read_value(value, parameters[i].kind, parameters[i].target))
            return lx_fail(error, LX_ERROR_FORMAT, "'%.40s' is no %s", value, parameters[i].name);
        if (parameters[i].given) *parameters[i].given = true;
        return LX_OK;
    }
    return lx_fail(error, LX_ERROR_FORMAT,
                   "'%.*s' is unknown (there are period, phase, duty, low, high, seed, fade, color, intensity)", (int)(length < 40 ? length : 40),
                   word);
}

// TIME=COLOUR[*INTENSITY].
static lx_result read_key(const char *word, lx_program_key *out, lx_error *error)
{
    const char *at = word;
    *out = (lx_program_key){.intensity = -1};
    bool good = take_time(&at, &out->time_s) && *at++ == '=' && lx_take_color(&at, &out->color);
    if (good && *at == '*') {
        ++at;
        good = lx_take_number(&at, &out->intensity);
    }
    if (!good || *at)
        return lx_fail(error, LX_ERROR_FORMAT, "'%.40s' is not TIME=COLOUR*INTENSITY (#rrggbb, r,g,b or off)", word);
    return LX_OK;
}

// The next word of *text, cut off where it ends; NULL: there is none.
static char *take_word(char **text)
{
    static const char blanks[] = " \t\r\n";
    char *word = *text + strspn(*text, blanks);
    if (!*word) return NULL;
    char *end = word + strcspn(word, blanks);
    *text = *end ? end + 1 : end;
    *end = '\0';
    return word;
}

static lx_result read_words(char *text, lx_program *out, lx_program_key *keys, lx_error *error)
{
    lx_result result = LX_OK;
    bool first = true;
    for (char *word; (word = take_word(&text));) {
        const char *equals = strchr(word, '=');
        const bool number = isdigit((unsigned char)*word) || *word == '.';
        if (first) {
            bool known = false;
            for (int kind = 0; kind <= LX_PROGRAM_SCHEDULE && !known; ++kind)
                if (kind != LX_PROGRAM_KEYS && strcmp(word, names[kind]) == 0) {
                    out->kind = (lx_program_kind)kind;
                    known = true;
                }
            if (!known)
                return lx_fail(error, LX_ERROR_FORMAT, "'%.40s' is no program (blink, flicker, pulse, wheel, schedule, constant)", word);
            first = false;
        } else if (number && !equals) {
            if (out->kind == LX_PROGRAM_CONSTANT || !read_value(word, value_time, &out->period_s))
                return lx_fail(error, LX_ERROR_FORMAT, "'%.40s' is no period", word);
        } else if (number && out->kind == LX_PROGRAM_SCHEDULE) {
            if (out->key_count == most_keys) return lx_fail(error, LX_ERROR_LIMIT, "more than %d times", most_keys);
            LX_TRY(read_key(word, &keys[out->key_count], error));
            ++out->key_count;
        } else if (equals) {
            LX_TRY(read_parameter(word, equals + 1, out, error));
        } else {
            return lx_fail(error, LX_ERROR_FORMAT, "'%.40s' is not NAME=VALUE", word);
        }
    }
    if (first) return lx_fail(error, LX_ERROR_FORMAT, "no program (blink, flicker, pulse, wheel, schedule, constant)");
cleanup:
    return result;
}

static lx_result check(const lx_program *p, const lx_program_key *keys, lx_error *error)
{
    if (!(p->period_s > 0)) return lx_fail(error, LX_ERROR_FORMAT, "a period must be above 0");
    if (p->kind != LX_PROGRAM_SCHEDULE) return LX_OK;
    if (p->key_count == 0) return lx_fail(error, LX_ERROR_FORMAT, "a schedule needs TIME=COLOUR*INTENSITY");
    for (uint32_t i = 0; i < p->key_count; ++i) {
        if (keys[i].time_s > p->period_s)
            return lx_fail(error, LX_ERROR_FORMAT, "%g s lies behind the period of %g s", (double)keys[i].time_s, (double)p->period_s);
        if (i > 0 && keys[i].time_s < keys[i - 1].time_s)
            return lx_fail(error, LX_ERROR_FORMAT, "times must ascend, but %g s follows %g s", (double)keys[i].time_s,
                           (double)keys[i - 1].time_s);
    }
    return LX_OK;
}

lx_result lx_program_parse(const char *text, lx_arena *arena, lx_program *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_program program = {.period_s = 1, .duty = 0.5f, .high = 1, .intensity = -1};
    char *copy = lx_strdup(text);
    lx_program_key *keys = lx_malloc_array(strlen(text) / 2 + 1, sizeof *keys); // a key takes five letters and more
    if (!copy || !keys) {
        result = lx_fail_memory(error, "program");
        goto cleanup;
    }
    LX_TRY(read_words(copy, &program, keys, error));
    LX_TRY(check(&program, keys, error));
    if (program.key_count > 0) {
        lx_program_key *kept = lx_arena_alloc(arena, program.key_count, sizeof *kept);
        if (!kept) {
            result = lx_fail_memory(error, "program");
            goto cleanup;
        }
        memcpy(kept, keys, program.key_count * sizeof *kept);
        program.keys = kept;
    }
    *out = program;
cleanup:
    lx_free(copy);
    lx_free(keys);
    return result;
}
