/// Advice on what is legal but probably not meant.
#ifndef LX_SCENE_CHECKS_H
#define LX_SCENE_CHECKS_H

#include "scene/scene.h"

/// Warns about a scene without lights, faint emitters, strange sizes, and export boxes that were not ticked.
/// `file_has_lights`: the file defines lights, used or not. `has_extras`: anything in it has extras.
void lx_scene_advise(const lx_scene *scene, lx_light_units units, bool file_has_lights, bool has_extras);

#endif
