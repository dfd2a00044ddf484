#include "scene/atlas.h"
