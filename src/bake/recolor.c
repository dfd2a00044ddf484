// `LAYER=COLOUR[*INTENSITY]`: what a person types to change a baked scene's light.
#include "bake/baked.h"

#include "base/error.h"
#include "scene/program.h"

#include <ctype.h>
#include <string.h>

bool lx_glob_matches(const char *pattern, const char *text)
{
    const char *star = NULL, *retry = NULL; // the last *, and where its match ends so far
    while (*text) {
        if (*pattern == '*') {
            star = pattern++;
            retry = text;
        } else if (*pattern == '?' || *pattern == *text) {
            ++pattern;
            ++text;
        } else if (star) {
            pattern = star + 1;
            text = ++retry;
        } else {
            return false;
        }
    }
    while (*pattern == '*') ++pattern;
    return *pattern == '\0';
}

uint32_t lx_edit_distance(const char *a, const char *b)
{
    enum { longest = 63 };
    uint32_t row[longest + 1];
    const size_t length_a = strlen(a) < longest ? strlen(a) : longest, length_b = strlen(b) < longest ? strlen(b) : longest;
    for (size_t k = 0; k <= length_b; ++k) row[k] = (uint32_t)k;
    for (size_t i = 1; i <= length_a; ++i) {
        uint32_t diagonal = row[0];
        row[0] = (uint32_t)i;
        for (size_t k = 1; k <= length_b; ++k) {
            const uint32_t exchange = diagonal + (tolower((unsigned char)a[i - 1]) != tolower((unsigned char)b[k - 1]));
            const uint32_t change = (row[k] < row[k - 1] ? row[k] : row[k - 1]) + 1;
            diagonal = row[k];
            row[k] = exchange < change ? exchange : change;
        }
    }
    return row[length_b];
}

// "; nearest: 'a', 'b', 'c'" for a name that fits no layer.
static void list_nearest(const lx_baked *baked, const char *name, char *out, size_t out_bytes)
{
    enum { shown = 3 };
    uint32_t best[shown], count = 0;
    uint32_t distances[shown];
    for (uint32_t layer = 0; layer < lx_baked_layer_count(baked); ++layer) {
        const uint32_t distance = lx_edit_distance(name, lx_baked_layer_name(baked, layer));
        uint32_t place = count;
        while (place > 0 && distance < distances[place - 1]) --place;
        if (place == shown) continue;
        if (count < shown) ++count;
        for (uint32_t i = count - 1; i > place; --i) {
            best[i] = best[i - 1];
            distances[i] = distances[i - 1];
        }
        best[place] = layer;
        distances[place] = distance;
    }
    size_t used = 0;
    out[0] = '\0';
    for (uint32_t i = 0; i < count && used < out_bytes; ++i) {
        const int written = snprintf(out + used, out_bytes - used, "%s'%.80s'", i ? ", " : count > 1 ? "; nearest: " : "; there is ",
                                     lx_baked_layer_name(baked, best[i]));
        if (written > 0) used += (size_t)written;
    }
}

// COLOUR[*INTENSITY]; *has_intensity tells whether the second part is there.
static bool parse_value(const char *text, float color[3], bool *has_intensity, float *intensity)
{
    lx_rgb rgb;
    if (!lx_take_color(&text, &rgb)) return false;
    color[0] = rgb.r;
    color[1] = rgb.g;
    color[2] = rgb.b;
    *has_intensity = *text == '*';
    if (*has_intensity) {
        ++text;
        if (!lx_take_number(&text, intensity)) return false;
    }
    return *text == '\0';
}

static lx_result set_one(lx_baked *baked, uint32_t layer, const float color[3], float intensity, lx_error *error)
{
    const lxrt_result rt = lxrt_set_layer(baked->pack, layer, color, intensity);
    return rt == LXRT_OK ? LX_OK
                         : lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "layer '%s': that is far too bright",
                                   lx_baked_layer_name(baked, layer));
}

lx_result lx_baked_set(lx_baked *baked, const char *assignment, lx_error *error)
{
    lx_result result = LX_OK;
    const char *equals = strrchr(assignment, '=');
    char *name = equals ? lx_strndup(assignment, (size_t)(equals - assignment)) : NULL;
    float color[3], given = 0;
    bool has_intensity = false, found = false, exact = false;
    if (!equals || !*assignment || equals == assignment)
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "'%s': must be LAYER=COLOUR or LAYER=COLOUR*INTENSITY", assignment);
    else if (!name)
        result = lx_fail_memory(error, "name");
    else if (!parse_value(equals + 1, color, &has_intensity, &given))
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT,
                         "'%s': '%s' is no colour; use #rrggbb (sRGB), r,g,b (linear) or off, and *INTENSITY behind it", assignment,
                         equals + 1);
    if (result != LX_OK) goto cleanup;

    const uint32_t layer_count = lx_baked_layer_count(baked);
    for (uint32_t i = 0; i < layer_count; ++i) exact |= strcmp(name, lx_baked_layer_name(baked, i)) == 0;
    for (uint32_t i = 0; i < layer_count; ++i) {
        const char *layer_name = lx_baked_layer_name(baked, i);
        if (exact ? strcmp(name, layer_name) != 0 : !lx_glob_matches(name, layer_name)) continue;
        found = true;
        LX_TRY(set_one(baked, i, color, has_intensity ? given : baked->manifest.layers[i].intensity, error));
    }
    if (!found) {
        char nearest[320];
        list_nearest(baked, name, nearest, sizeof nearest);
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "there is no layer '%s'%s", name,
                         layer_count ? nearest : "; there are no layers");
    }
cleanup:
    lx_free(name);
    return result;
}
