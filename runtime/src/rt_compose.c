// The composer: E = Σ c_i T_i for a rectangle of texels.
#include "rt_sum.h"

size_t lxrt_format_bytes(lxrt_format format)
{
    return format == LXRT_FORMAT_RGB32F ? 12 : format == LXRT_FORMAT_RGBA16F ? 8 : 4;
}

lxrt_result lxrt_compose(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target)
{
    const lxrt_result result = lxrt_check_region(pack, region, target);
    if (result != LXRT_OK) return result;
    const lxrt_factors factors = {pack->colors ? pack->colors->factor : NULL, sizeof *pack->colors / sizeof(float)};
    lxrt_sum_region(pack, region, target, factors, NULL);
    return LXRT_OK;
}
