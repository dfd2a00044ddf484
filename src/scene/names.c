// Names that are unique among themselves.
#include "scene/names.h"

#include "math/hash.h"

#include <string.h>

static size_t find_slot(const lx_name_set *set, const char *name)
{
    size_t slot = (size_t)lx_hash64(lx_hash_bytes(0xcbf29ce484222325u, name, strlen(name))) & (set->capacity - 1);
    while (set->names[slot] && strcmp(set->names[slot], name) != 0) slot = (slot + 1) & (set->capacity - 1);
    return slot;
}

static bool grow(lx_name_set *set)
{
    lx_name_set bigger = {.capacity = set->capacity ? 2 * set->capacity : 64, .count = set->count};
    bigger.names = lx_calloc_array(bigger.capacity, sizeof *bigger.names);
    bigger.repeats = lx_calloc_array(bigger.capacity, sizeof *bigger.repeats);
    if (!bigger.names || !bigger.repeats) {
        lx_name_set_release(&bigger);
        return false;
    }
    for (size_t i = 0; i < set->capacity; ++i) {
        if (!set->names[i]) continue;
        const size_t slot = find_slot(&bigger, set->names[i]);
        bigger.names[slot] = set->names[i];
        bigger.repeats[slot] = set->repeats[i];
    }
    lx_name_set_release(set);
    *set = bigger;
    return true;
}

static const char *insert(lx_name_set *set, lx_arena *arena, size_t slot, const char *name)
{
    set->names[slot] = lx_arena_strdup(arena, name);
    set->repeats[slot] = 1;
    set->count += set->names[slot] != NULL;
    return set->names[slot];
}

const char *lx_name_set_add(lx_name_set *set, lx_arena *arena, const char *name)
{
    if (2 * (set->count + 1) > set->capacity && !grow(set)) return NULL;
    const size_t slot = find_slot(set, name);
    if (!set->names[slot]) return insert(set, arena, slot, name);
    for (;;) {
        char *numbered = lx_format("%s#%u", name, ++set->repeats[slot]);
        if (!numbered) return NULL;
        const size_t other = find_slot(set, numbered);
        const char *added = set->names[other] ? NULL : insert(set, arena, other, numbered);
        const bool taken = set->names[other] && !added;
        lx_free(numbered);
        if (!taken) return added;
    }
}

void lx_name_set_release(lx_name_set *set)
{
    lx_free(set->names);
    lx_free(set->repeats);
    *set = (lx_name_set){0};
}
