/// Names that are unique among themselves: repeats get #2, #3 …
#ifndef LX_SCENE_NAMES_H
#define LX_SCENE_NAMES_H

#include "base/memory.h"

#include <stdint.h>

typedef struct lx_name_set {
    const char **names; ///< Open addressing; NULL: free. Borrowed from the arena.
    uint32_t *repeats;  ///< Beside each name: the last number tried behind it.
    size_t capacity, count;
} lx_name_set;

/// Adds `name`, or the first of name#2, name#3 … that is not in the set, and returns the arena's copy. NULL: no memory.
const char *lx_name_set_add(lx_name_set *set, lx_arena *arena, const char *name);
void lx_name_set_release(lx_name_set *set);

#endif
