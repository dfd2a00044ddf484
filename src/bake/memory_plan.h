/// How much memory a bake by gathering will take, told before its first ray, and how many layers fit at once.
#ifndef LX_BAKE_MEMORY_PLAN_H
#define LX_BAKE_MEMORY_PLAN_H

#include "bake/finish.h"

typedef struct lx_memory_plan {
    uint64_t resident_bytes; ///< What the process has when the plan is made: scene, tracer, luxels, neighbours and seams.
    uint64_t group_bytes;    ///< What baking the largest group adds, at most.
    uint64_t save_bytes;     ///< The whole process while it saves. Lightmap files of all layers of a page in one (KTX2) come on top.
    uint64_t peak_bytes;     ///< The whole process, at most.
    uint32_t group_layers;   ///< Layers of a group at most, but see lx_memory_group.
} lx_memory_plan;

/// Once luxels are placed and `finish` is open. Without a limit (lx_bake_desc.memory_bytes) one group has all layers. LX_ERROR_LIMIT if nothing fits, with what would.
lx_result lx_memory_plan_make(const lx_bake_job *job, const lx_finish *finish, lx_memory_plan *out, lx_error *error);

/// Layers of the group that begins with layer `first`: as many as fit, at least one. The cells of a monitor are never torn apart: one
/// shadow ray tells of all of them.
uint32_t lx_memory_group(const lx_bake *bake, const lx_memory_plan *plan, uint32_t first);

#endif
