/// `luxel_animate`: what changes a light over time, as a person types it.
///
///     blink period=2 duty=0.3          flicker 0.15 low=0.6        pulse 4
///     wheel 20 color=#ff3020           schedule 24h fade=30min 0=off 7h=#ffd9a0*0.5 19:30=1,1,1*2
///
/// PROGRAM [PERIOD] [NAME=VALUE]…, separated by spaces. Times are seconds, or end in ms, s, min or h; 19:30 is a time of day.
#ifndef LX_SCENE_PROGRAM_H
#define LX_SCENE_PROGRAM_H

#include "base/memory.h"
#include "luxel/base.h"
#include "math/vec.h"

/// As lxrt_program_kind.
typedef enum lx_program_kind {
    LX_PROGRAM_CONSTANT,
    LX_PROGRAM_KEYS, ///< Not typed: of glTF animations.
    LX_PROGRAM_BLINK,
    LX_PROGRAM_FLICKER,
    LX_PROGRAM_PULSE,
    LX_PROGRAM_WHEEL,
    LX_PROGRAM_SCHEDULE,
} lx_program_kind;

/// A time of a schedule: TIME=COLOUR[*INTENSITY].
typedef struct lx_program_key {
    float time_s;
    lx_rgb color;
    float intensity; ///< Negative: the authored one.
} lx_program_key;

typedef struct lx_program {
    lx_program_kind kind;
    float period_s, phase_s;
    float duty, low, high, fade_s;
    uint32_t seed;
    bool has_seed;
    bool has_color;
    lx_rgb color;    ///< In place of the authored one.
    float intensity; ///< Likewise, in the unit the file gives the intensity in; negative: not given.
    const lx_program_key *keys; ///< SCHEDULE: ascending from 0 to the period. In the arena.
    uint32_t key_count;
} lx_program;

/// Name of a program as it is typed.
const char *lx_program_name(lx_program_kind kind);

/// Reads `text`. LX_ERROR_FORMAT with a message that says what cannot be read.
lx_result lx_program_parse(const char *text, lx_arena *arena, lx_program *out, lx_error *error);

/// A number from the front of *text, which moves behind it: decimal, zero or more, finite; no sign, no "inf", no
/// hexadecimal, no spaces before it.
bool lx_take_number(const char **text, float *out);
/// COLOUR from the front of *text, which moves behind it: #rrggbb (sRGB), r,g,b (linear, zero or more) or off.
bool lx_take_color(const char **text, lx_rgb *out);

#endif
