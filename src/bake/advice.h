/// Warnings about what is almost always a mistake, naming the object.
#ifndef LX_BAKE_ADVICE_H
#define LX_BAKE_ADVICE_H

#include "bake/bake.h"

/// Before tracing: surfaces inside a lamp's sphere, an unlit dome that hides the sky.
void lx_advise_on_scene(const lx_bake *bake);
/// After it: layers that light nothing.
lx_result lx_advise_on_layers(const lx_bake *bake, lx_error *error);

#endif
