// What a pack costs in memory.
#include "rt_accumulator.h"

void lxrt_get_budget(const lxrt_pack *pack, lxrt_budget *out)
{
    uint64_t texels = 0; // of a page with its mips; 2^28 + 2^26 + … at most
    for (uint32_t level = 0; level < pack->level_count; ++level)
        texels += (uint64_t)lxrt_level_size(pack, level) * lxrt_level_size(pack, level);
    const uint64_t images = (uint64_t)pack->page_count * pack->layer_count;
    *out = (lxrt_budget){
        .pack_bytes = pack->file_bytes,
        .handle_bytes = pack->handle_bytes,
        .accumulator_bytes = pack->page_count * lxrt_accumulator_bytes64(pack),
        .gpu_composed_bytes = pack->page_count * texels * 4,
        .gpu_layers_bytes = images * texels * 4, // 2^36 × 2^29 × 4 would not fit, but then neither would the block index
        .dense_bytes = images * pack->level_first[pack->level_count] * lxrt_block_bytes,
    };
}
