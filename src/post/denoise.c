// The denoiser's filter: see denoise.h.
#include "post/denoise_graph.h"

#include "base/memory.h"

#include <string.h>

enum {
    direction_count = lx_denoise_direction_count,
    level_count = lx_denoise_level_count,
    candidate_count = level_count + 1, // the input, then what each level made of it
};

// Differences of so many standard deviations beyond the noise lower a weight to a quarter.
static const float tolerances[] = {[lx_light_direct] = 1.5f, [lx_light_indirect] = 3.0f};
// Below the first relative standard error a luxel counts as clean and stays, above the second nothing holds the filter back.
static const float clean_error = 0.003f, noisy_error = 0.008f;
// Variances come from samples that are spread better than chance within each half; what they say of the whole is on the high side. So much
// of it counts where the filter is compared with the input.
static const float trusted_variance = 0.85f;

// By how much the variance beside a bright spot may exceed what the value suggests; and the share of a luxel's own variance that counts at least.
static const float contrast = 6, own_share = 0.25f;
static const float unsure = 0.05f; // relative variance at which a luxel's own value and its neighbourhood's count alike
static const float most_error = 16; // in variances: one luxel must not decide for its neighbourhood

// Estimated squared errors of the candidates, in units of the input's variance.
typedef struct errors {
    float of[candidate_count];
} errors;

// What the first level compares: a luxel and its neighbours in one, which single outliers do not rule.
typedef struct pilot {
    float value, variance;
} pilot;

typedef struct work {
    const lx_denoise_graph *graph;
    float tolerance;
    lx_estimate *levels[candidate_count]; // [luxel] the input with smooth variances, then one level's output each
    errors *errors, *other_errors;        // [luxel]
    pilot *pilots;                        // [luxel]
} work;

static float mean_of(lx_rgb c) { return (c.r + c.g + c.b) * (1.0f / 3); }

static const uint32_t *links_at(const lx_denoise_graph *graph, int level)
{
    return graph->links + (size_t)level * graph->luxel_count * direction_count;
}

// The kernel [1 2 1; 2 4 2; 1 2 1] / 16 in the links' order, over 15 for their weights.
static const float kernel_center = 0.25f;
static const float kernel[direction_count] = {0.125f / 15, 0.0625f / 15, 0.125f / 15, 0.0625f / 15,
                                              0.125f / 15, 0.0625f / 15, 0.125f / 15, 0.0625f / 15};

size_t lx_denoise_scratch_bytes(const lx_denoise_graph *graph)
{
    return (size_t)graph->luxel_count * (candidate_count * sizeof(lx_estimate) + 2 * sizeof(errors) + sizeof(pilot));
}

static work lay_out(const lx_denoise_graph *graph, lx_light_part part, void *scratch)
{
    work w = {.graph = graph, .tolerance = tolerances[part]};
    lx_estimate *next = scratch;
    for (int k = 0; k < candidate_count; ++k, next += graph->luxel_count) w.levels[k] = next;
    w.errors = (errors *)(void *)next;
    w.other_errors = w.errors + graph->luxel_count;
    w.pilots = (pilot *)(void *)(w.other_errors + graph->luxel_count);
    return w;
}

// Variances of single luxels, from a few half buffers each, are mostly noise themselves. Means over the neighbourhood: of the variance, of its share of
// the squared value, and of the value. Beside a bright spot the first is far too high for the dark, beside a dark spot the second for the
// bright; the lower of what they say is not far from the truth in both.
typedef struct spread {
    float absolute, relative, value;
} spread;

static void smooth_spread(const lx_denoise_graph *graph, int level, const spread *in, spread *out)
{
    const uint32_t *link = links_at(graph, level);
    for (uint32_t i = 0; i < graph->luxel_count; ++i, link += direction_count) {
        spread sum = {kernel_center * in[i].absolute, kernel_center * in[i].relative, kernel_center * in[i].value};
        float total = kernel_center;
        for (int d = 0; d < direction_count; ++d) {
            const float weight = kernel[d] * (float)(link[d] & lx_denoise_most_weight);
            const spread other = in[link[d] >> lx_denoise_weight_bits];
            sum.absolute += weight * other.absolute;
            sum.relative += weight * other.relative;
            sum.value += weight * other.value;
            total += weight;
        }
        const float scale = 1 / total;
        out[i] = (spread){sum.absolute * scale, sum.relative * scale, sum.value * scale};
    }
}

static void smooth_variances(const work *w, const lx_estimate *in)
{
    spread *a = (spread *)(void *)w->levels[1], *b = (spread *)(void *)w->levels[2];
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i) {
        const float value = mean_of(in[i].mean);
        a[i] = (spread){in[i].variance, in[i].variance > 0 ? lx_min(1, in[i].variance / (value * value)) : 0, value};
    }
    smooth_spread(w->graph, 0, a, b);
    smooth_spread(w->graph, 1, b, a);
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i) {
        // Where the noise is strong a single value says little about the light; the neighbourhood's does.
        const float shared = a[i].relative * a[i].relative / (a[i].relative * a[i].relative + unsure * unsure);
        const float value = (1 - shared) * mean_of(in[i].mean) + shared * a[i].value;
        const float smooth = lx_min(a[i].absolute, contrast * a[i].relative * value * value);
        w->levels[0][i] = (lx_estimate){in[i].mean, lx_max(smooth, own_share * in[i].variance)}; // an outlier knows that it is one
    }
}

static void make_pilots(const work *w)
{
    const lx_estimate *in = w->levels[0];
    const uint32_t *link = links_at(w->graph, 0);
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i, link += direction_count) {
        float value = kernel_center * mean_of(in[i].mean), variance = kernel_center * kernel_center * in[i].variance, total = kernel_center;
        for (int d = 0; d < direction_count; ++d) {
            const float weight = kernel[d] * (float)(link[d] & lx_denoise_most_weight);
            const lx_estimate other = in[link[d] >> lx_denoise_weight_bits];
            value += weight * mean_of(other.mean);
            variance += weight * weight * other.variance;
            total += weight;
        }
        w->pilots[i] = (pilot){value / total, variance / (total * total)};
    }
}

// How far two values may be taken for one: 1 where their variances explain the difference, towards 0 beyond. [Rousselle2012], for a patch of
// one: what noise alone explains counts as no difference. Instead of exp(-x): 1 / (1 + x)².
static float likeness(pilot a, pilot b, float tolerance)
{
    const float difference = a.value - b.value, noise = a.variance + b.variance;
    const float excess = lx_max(0, difference * difference - noise), tolerated = tolerance * tolerance * noise;
    const float share = tolerated / (tolerated + excess + 1e-30f);
    return share * share;
}

// One level of the wavelet: [Schied2017] with the function above; variances go with the squares of the weights.
static void filter_level(const work *w, int level)
{
    const lx_estimate *in = w->levels[level];
    lx_estimate *out = w->levels[level + 1];
    const uint32_t *link = links_at(w->graph, level);
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i, link += direction_count) {
        const lx_estimate center = in[i];
        const pilot own = level == 0 ? w->pilots[i] : (pilot){mean_of(center.mean), center.variance};
        lx_rgb sum = lx_rgb_scale(center.mean, kernel_center);
        float variance = kernel_center * kernel_center * center.variance, total = kernel_center;
        for (int d = 0; d < direction_count; ++d) {
            const uint32_t other_luxel = link[d] >> lx_denoise_weight_bits;
            const lx_estimate other = in[other_luxel];
            const pilot others = level == 0 ? w->pilots[other_luxel] : (pilot){mean_of(other.mean), other.variance};
            const float weight = kernel[d] * (float)(link[d] & lx_denoise_most_weight) * likeness(own, others, w->tolerance);
            sum = lx_rgb_add(sum, lx_rgb_scale(other.mean, weight));
            variance += weight * weight * other.variance;
            total += weight;
        }
        const float scale = 1 / total;
        out[i].mean = lx_rgb_scale(sum, scale);
        out[i].variance = variance * scale * scale;
    }
}

// Stein's estimate of a candidate's squared error, [Li2012]: (F - x)² - v + 2 v dF/dx. The derivative is the weight of the luxel itself in its
// result; a kernel near a Gaussian gives twice the sum of its squared weights, which the variances tell, and one that is all there is gives 1.
static void estimate_errors(const work *w)
{
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i) {
        const float variance = w->levels[0][i].variance, value = mean_of(w->levels[0][i].mean);
        w->errors[i].of[0] = trusted_variance;
        for (int k = 1; k < candidate_count; ++k) {
            const float difference = mean_of(w->levels[k][i].mean) - value;
            const float left = variance > 0 ? w->levels[k][i].variance / variance : 1;
            const float squared = variance > 0 ? difference * difference / variance : 0;
            w->errors[i].of[k] = lx_min(most_error, squared) + trusted_variance * (2 * lx_min(1, 1.8f * left) - 1);
        }
    }
}

// Single estimates are noise: only their mean over a neighbourhood tells one candidate from another.
static void smooth_errors(const lx_denoise_graph *graph, int level, const errors *in, errors *out)
{
    const uint32_t *link = links_at(graph, level);
    for (uint32_t i = 0; i < graph->luxel_count; ++i, link += direction_count) {
        errors sum;
        float total = kernel_center;
        for (int k = 0; k < candidate_count; ++k) sum.of[k] = kernel_center * in[i].of[k];
        for (int d = 0; d < direction_count; ++d) {
            const float weight = kernel[d] * (float)(link[d] & lx_denoise_most_weight);
            const errors *other = &in[link[d] >> lx_denoise_weight_bits];
            for (int k = 0; k < candidate_count; ++k) sum.of[k] += weight * other->of[k];
            total += weight;
        }
        for (int k = 0; k < candidate_count; ++k) out[i].of[k] = sum.of[k] / total;
    }
}

// Candidates in inverse proportion to their squared errors: near the best one where it stands out, a mean where they are alike.
static lx_rgb mix(const work *w, uint32_t luxel, lx_rgb input)
{
    const float variance = w->levels[0][luxel].variance;
    if (!(variance > 0)) return input;
    lx_rgb sum = {0, 0, 0};
    float total = 0;
    for (int k = 0; k < candidate_count; ++k) {
        const lx_estimate *candidate = &w->levels[k][luxel];
        // No candidate's error is below the noise that is left in it.
        const float error = lx_max(w->errors[luxel].of[k], candidate->variance / variance);
        const float weight = 1 / (error * error + 1e-6f);
        sum = lx_rgb_add(sum, lx_rgb_scale(candidate->mean, weight));
        total += weight;
    }
    const float value = mean_of(input), relative = sqrtf(variance) / lx_max(value, 1e-30f);
    const float noisy = lx_clamp((relative - clean_error) / (noisy_error - clean_error), 0, 1);
    return lx_rgb_add(lx_rgb_scale(input, 1 - noisy), lx_rgb_scale(sum, noisy / total));
}

void lx_denoise_layer(const lx_denoise_graph *graph, lx_light_part part, const lx_estimate *in, void *scratch, lx_rgb *out)
{
    work w = lay_out(graph, part, scratch);
    bool is_exact = true;
    for (uint32_t i = 0; i < graph->luxel_count && is_exact; ++i) is_exact = !(in[i].variance > 0);
    if (is_exact) {
        for (uint32_t i = 0; i < graph->luxel_count; ++i) out[i] = in[i].mean;
        return;
    }
    smooth_variances(&w, in);
    make_pilots(&w);
    for (int level = 0; level < level_count; ++level) filter_level(&w, level);
    estimate_errors(&w);
    smooth_errors(graph, 0, w.errors, w.other_errors);
    smooth_errors(graph, 1, w.other_errors, w.errors);
    for (uint32_t i = 0; i < graph->luxel_count; ++i) out[i] = mix(&w, i, in[i].mean);
}
