/// The whole bake library.
#ifndef LUXEL_LUXEL_H
#define LUXEL_LUXEL_H

#include "luxel/bake.h"
#include "luxel/baked.h"
#include "luxel/picture.h"
#include "luxel/render.h"
#include "luxel/serve.h"

#endif
