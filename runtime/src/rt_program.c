// Programs: a layer's colour as a function of time alone. Formulas: docs/drivers.md.
//
// All is computed in double precision with + − × ÷, floor and polynomials, so that every machine gets the same bits.
#include "rt_drive.h"

#include <math.h>

lxrt_program lxrt_program_default(void)
{
    return (lxrt_program){
        .kind = LXRT_PROGRAM_CONSTANT,
        .color = {1, 1, 1},
        .intensity = 1,
        .period_s = 1,
        .duty = 0.5f,
        .high = 1,
        .interpolation = LXRT_LINEAR,
        .loop = 1,
    };
}

int lxrt_is_program(const lxrt_program *program)
{
    return (uint32_t)program->kind <= LXRT_PROGRAM_SCHEDULE && isfinite(program->color[0]) && isfinite(program->color[1]) &&
           isfinite(program->color[2]) && isfinite(program->intensity) && isfinite(program->period_s) && program->period_s > 0 &&
           isfinite(program->phase_s) && program->duty >= 0 && program->duty <= 1 && isfinite(program->low) && isfinite(program->high) &&
           isfinite(program->fade_s) && program->fade_s >= 0 && (uint32_t)program->interpolation <= LXRT_CUBIC;
}

static float key_number(const lxrt_keys *keys, uint32_t key, uint32_t number)
{
    const size_t at = (size_t)key * lxrt_key_stride(keys) + number;
    return keys->floats ? keys->floats[at] : lxrt_load_f32(keys->packed + 4 * at);
}

static float key_time(const lxrt_keys *keys, uint32_t key)
{
    return key_number(keys, key, 0);
}

float lxrt_last_key_time(const lxrt_keys *keys)
{
    return key_time(keys, keys->count - 1);
}

static double key_value(const lxrt_keys *keys, uint32_t key, uint32_t channel)
{
    return key_number(keys, key, 1 + (keys->cubic ? keys->width : 0) + channel);
}

int lxrt_are_keys(const lxrt_program *program, const lxrt_keys *keys)
{
    if (keys->count == 0 || !(keys->floats || keys->packed)) return 0;
    const uint32_t stride = lxrt_key_stride(keys);
    for (uint32_t key = 0; key < keys->count; ++key) {
        for (uint32_t number = 0; number < stride; ++number)
            if (!isfinite(key_number(keys, key, number))) return 0;
        if (key > 0 && key_time(keys, key) < key_time(keys, key - 1)) return 0;
    }
    return program->kind != LXRT_PROGRAM_SCHEDULE || (key_time(keys, 0) >= 0 && lxrt_last_key_time(keys) <= program->period_s);
}

// Time since the period began, in [0, period), and which period it is. Beyond 2^52 periods a double has no room for a phase: 0.
static double fold_time(double time_s, double period_s, double *out_period)
{
    double period = floor(time_s / period_s);
    *out_period = 0;
    if (!(fabs(period) < 0x1p52)) return 0;
    double local_s = time_s - period * period_s;
    if (local_s < 0) { // the quotient was rounded up to a whole number
        local_s += period_s;
        period -= 1;
    }
    if (local_s >= period_s) {
        local_s = 0;
        period += 1;
    }
    *out_period = period;
    return local_s;
}

// The last key that is not after a time; LXRT_NONE if all are.
static uint32_t find_key(const lxrt_keys *keys, double time_s)
{
    uint32_t low = 0, high = keys->count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (key_time(keys, middle) <= time_s)
            low = middle + 1;
        else
            high = middle;
    }
    return low == 0 ? LXRT_NONE : low - 1;
}

static void run_keys(const lxrt_program *program, const lxrt_keys *keys, double time_s, double out[3])
{
    const double end_s = lxrt_last_key_time(keys);
    double period;
    if (program->loop && end_s > 0) time_s = fold_time(time_s, end_s, &period);
    const uint32_t key = find_key(keys, time_s);
    if (key == LXRT_NONE || key + 1 == keys->count || program->interpolation == LXRT_STEP) {
        for (uint32_t i = 0; i < keys->width; ++i) out[i] = key_value(keys, key == LXRT_NONE ? 0 : key, i);
        return;
    }
    const double begin_s = key_time(keys, key), interval_s = key_time(keys, key + 1) - begin_s; // > 0: the next key is after time_s
    const double s = (time_s - begin_s) / interval_s;
    for (uint32_t i = 0; i < keys->width; ++i) {
        const double from = key_value(keys, key, i), to = key_value(keys, key + 1, i);
        if (!keys->cubic) {
            out[i] = from + (to - from) * s;
            continue;
        }
        // glTF 2.0, appendix C: a Hermite spline whose tangents are per second
        const double leaving = interval_s * key_number(keys, key, 1 + 2 * keys->width + i);
        const double arriving = interval_s * key_number(keys, key + 1, 1 + i);
        const double s2 = s * s, s3 = s2 * s;
        out[i] = (2 * s3 - 3 * s2 + 1) * from + (s3 - 2 * s2 + s) * leaving + (3 * s2 - 2 * s3) * to + (s3 - s2) * arriving;
    }
}

// A key fades in from the one before it. A fade never takes longer than its key lasts, so that each is reached.
static void run_schedule(const lxrt_program *program, const lxrt_keys *keys, double time_s, double out[3])
{
    double period;
    const double now_s = fold_time(time_s, program->period_s, &period);
    const uint32_t last = keys->count - 1, found = find_key(keys, now_s), key = found == LXRT_NONE ? last : found;
    const double next_s = key == last ? key_time(keys, 0) + (double)program->period_s : key_time(keys, key + 1);
    const double elapsed_s = now_s - key_time(keys, key) + (found == LXRT_NONE ? (double)program->period_s : 0);
    const double lasts_s = next_s - key_time(keys, key), fade_s = program->fade_s < lasts_s ? program->fade_s : lasts_s;
    for (uint32_t i = 0; i < keys->width; ++i) {
        const double from = key_value(keys, key == 0 ? last : key - 1, i), to = key_value(keys, key, i);
        out[i] = elapsed_s < fade_s ? from + (to - from) * (elapsed_s / fade_s) : to;
    }
}

// A number in [0, 1) for each whole number and seed (the finalizer of SplitMix64).
static double noise_at(double whole, uint32_t seed)
{
    uint64_t bits = (uint64_t)(int64_t)whole * 0x9e3779b97f4a7c15u + (uint64_t)seed * 0xd1b54a32d192ed03u;
    bits = (bits ^ bits >> 30) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ bits >> 27) * 0x94d049bb133111ebu;
    bits ^= bits >> 31;
    return (double)(int64_t)(bits >> 11) * 0x1p-53;
}

static double flicker(double period, double fraction, uint32_t seed)
{
    const double from = noise_at(period, seed), to = noise_at(period + 1, seed);
    return from + (to - from) * (fraction * fraction * (3 - 2 * fraction));
}

// (1 − cos 2πx) / 2 = sin² πx for x in [0, 1]: the Taylor series of sin πx up to x^17, below 10^-13 wrong where it is used.
static double raised_cosine(double x)
{
    const double y = x < 0.5 ? x : 1 - x, y2 = y * y;
    double sine = 7.952054001475508e-07;
    sine = sine * y2 - 2.1915353447830204e-05;
    sine = sine * y2 + 0.00046630280576761234;
    sine = sine * y2 - 0.007370430945714348;
    sine = sine * y2 + 0.08214588661112819;
    sine = sine * y2 - 0.5992645293207919;
    sine = sine * y2 + 2.550164039877345;
    sine = sine * y2 - 5.167712780049969;
    sine = sine * y2 + 3.141592653589793;
    return sine * sine * y2;
}

static double least(double a, double b)
{
    return a < b ? a : b;
}

static double most(double a, double b)
{
    return a > b ? a : b;
}

// HSV with the hue, which the colour brings, turned by a share of the circle; in linear numbers. Greys have no hue and stay.
static void turn_hue(const float color[3], double turn, double out[3])
{
    const double r = color[0], g = color[1], b = color[2];
    const double value = most(r, most(g, b)), range = value - least(r, least(g, b));
    double hue = 0; // sixths of the circle: red 0, green 2, blue 4
    if (range > 0) hue = value == r ? (g - b) / range : value == g ? 2 + (b - r) / range : 4 + (r - g) / range;
    for (int i = 0; i < 3; ++i) {
        double k = 5 - 2 * i + hue + 6 * turn; // (4, 16)
        while (k >= 6) k -= 6;
        out[i] = value - range * most(0, least(1, least(k, 4 - k)));
    }
}

void lxrt_run_program(const lxrt_program *program, const lxrt_keys *keys, double time_s, double out[3])
{
    const double shifted_s = time_s + program->phase_s;
    if (program->kind == LXRT_PROGRAM_KEYS) {
        run_keys(program, keys, shifted_s, out);
        return;
    }
    if (program->kind == LXRT_PROGRAM_SCHEDULE) {
        run_schedule(program, keys, shifted_s, out);
        return;
    }
    double period, factor = 1, share;
    const double fraction = fold_time(shifted_s, program->period_s, &period) / program->period_s;
    for (int i = 0; i < 3; ++i) out[i] = program->color[i];
    switch (program->kind) {
    case LXRT_PROGRAM_BLINK: factor = fraction < program->duty ? program->high : program->low; break;
    case LXRT_PROGRAM_FLICKER:
    case LXRT_PROGRAM_PULSE:
        share = program->kind == LXRT_PROGRAM_PULSE ? raised_cosine(fraction) : flicker(period, fraction, program->seed);
        factor = program->low + ((double)program->high - program->low) * share;
        break;
    case LXRT_PROGRAM_WHEEL: turn_hue(program->color, fraction, out); break;
    default: break;
    }
    for (int i = 0; i < 3; ++i) out[i] *= program->intensity * factor;
}

lxrt_result lxrt_program_evaluate(const lxrt_program *program, double time_s, float out_rgb[3])
{
    if (!program || !out_rgb || !isfinite(time_s) || !lxrt_is_program(program)) return LXRT_ERROR_INVALID_ARGUMENT;
    const lxrt_keys keys = lxrt_program_keys(program);
    if (lxrt_has_keys(program) && !lxrt_are_keys(program, &keys)) return LXRT_ERROR_INVALID_ARGUMENT;
    double rgb[3];
    lxrt_run_program(program, &keys, time_s, rgb);
    for (int i = 0; i < 3; ++i) out_rgb[i] = lxrt_clamp(rgb[i], LXRT_MAX_FACTOR);
    return LXRT_OK;
}
