/// What drives the colours of layers over time: `luxel_animate` and the file's animations of light.
#ifndef LX_BAKE_ANIMATIONS_H
#define LX_BAKE_ANIMATIONS_H

#include "bake/bake.h"
#include "store/pack.h"

/// As the pack takes them: programs first, then tracks in the file's order. Names are borrowed from the scene; keys are owned.
struct lx_bake_animations {
    lx_pack_animation *items;
    size_t count, capacity;
    lx_arena keys;
};

/// From a bake's layers and its scene; warns of what cannot be played. A combined bake has none.
lx_result lx_animations_build(lx_bake *bake, lx_error *error);
void lx_animations_release(lx_bake *bake);

#endif
