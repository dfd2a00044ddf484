// Programs and what drives layers with them, as the files of this folder share it.
#ifndef LXRT_RT_DRIVE_H
#define LXRT_RT_DRIVE_H

#include "rt_pack.h"

// What an animation's numbers are (docs/pack-format.md).
enum { lxrt_channel_whole, lxrt_channel_color, lxrt_channel_intensity };

// Keys of a program: the caller's own floats, or little-endian ones at any address in the pack.
typedef struct lxrt_keys {
    const float *floats;         // NULL: packed
    const unsigned char *packed;
    uint32_t count;
    uint32_t width; // numbers of a value: a colour's three, or one
    int cubic;      // in-tangent, value, out-tangent instead of the value
} lxrt_keys;

static inline uint32_t lxrt_key_stride(const lxrt_keys *keys)
{
    return 1 + keys->width * (keys->cubic ? 3 : 1);
}

static inline int lxrt_has_keys(const lxrt_program *program)
{
    return program->kind == LXRT_PROGRAM_KEYS || program->kind == LXRT_PROGRAM_SCHEDULE;
}

static inline lxrt_keys lxrt_program_keys(const lxrt_program *program)
{
    const int cubic = program->kind == LXRT_PROGRAM_KEYS && program->interpolation == LXRT_CUBIC;
    return (lxrt_keys){.floats = program->keys, .count = program->key_count, .width = 3, .cubic = cubic};
}

// The nearest float within ±limit; NaN stays what it is.
static inline float lxrt_clamp(double value, float limit)
{
    return value > limit ? limit : value < -limit ? -limit : (float)value;
}

// Whether a program makes sense, its keys apart. All fields must, also those that its kind has no use for.
int lxrt_is_program(const lxrt_program *program);
// Whether keys make sense for a program that does: there is one at least, finite, ascending, within a schedule's period.
int lxrt_are_keys(const lxrt_program *program, const lxrt_keys *keys);
float lxrt_last_key_time(const lxrt_keys *keys);
// c at a time; of keys of width 1 the number in out[0]. Finite for what the functions above let pass.
void lxrt_run_program(const lxrt_program *program, const lxrt_keys *keys, double time_s, double out[3]);

// An element of ANIM. Keys are NULL where there are none.
lxrt_program lxrt_stored_program(const unsigned char *animation);
lxrt_keys lxrt_stored_keys(const lxrt_pack *pack, const unsigned char *animation);

typedef enum lxrt_driver_kind {
    lxrt_driver_none,
    lxrt_driver_animations, // the pack's own
    lxrt_driver_program,
    lxrt_driver_callback,
} lxrt_driver_kind;

typedef struct lxrt_driver {
    lxrt_driver_kind kind;
    uint32_t first_animation; // of the layer, in the file's order; LXRT_NONE: it has none
    union {
        lxrt_program program;
        struct {
            lxrt_read_light read;
            void *user;
        } callback;
    } by;
} lxrt_driver;

typedef struct lxrt_animation_state {
    uint32_t next; // animation of the same layer
    uint32_t playing;
} lxrt_animation_state;

// After lxrt_open: animations play, layers without any are left alone.
void lxrt_begin_drivers(lxrt_pack *pack);

// Sets c of a layer to the nearest colour that can be summed. One with a NaN changes nothing.
void lxrt_drive_layer(lxrt_pack *pack, uint32_t layer, const double rgb[3]);

#endif
