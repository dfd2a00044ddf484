// Monitors: the mean colour of each cell of a picture becomes the colour of that cell's layer.
#include "rt_monitor.h"

#include "rt_drive.h"

#include <math.h>

void lxrt_begin_monitors(lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->monitors.count; ++i) {
        lxrt_monitor_state *state = &pack->monitor_states[i];
        *state = (lxrt_monitor_state){.smoothing = 0};
        for (int k = 0; k < 3; ++k) state->strength[k] = lxrt_load_f32(lxrt_element(&pack->monitors, i) + 28 + 4 * k);
    }
}

lxrt_result lxrt_get_monitor(const lxrt_pack *pack, uint32_t index, lxrt_monitor *out)
{
    if (!pack || !out) return LXRT_ERROR_INVALID_ARGUMENT;
    if (index >= pack->monitors.count) return LXRT_ERROR_NOT_FOUND;
    const unsigned char *data = lxrt_element(&pack->monitors, index);
    *out = (lxrt_monitor){
        .name = lxrt_name(pack, data),
        .node = lxrt_load_u32(data + 8),
        .material = (int32_t)lxrt_load_u32(data + 12),
        .columns = lxrt_load_u32(data + 16),
        .rows = lxrt_load_u32(data + 20),
        .first_layer = lxrt_load_u32(data + 24),
    };
    memcpy(out->strength, pack->monitor_states[index].strength, sizeof out->strength);
    return LXRT_OK;
}

lxrt_result lxrt_monitor_configure(lxrt_pack *pack, uint32_t monitor, const float strength[3], float smoothing)
{
    if (!pack) return LXRT_ERROR_INVALID_ARGUMENT;
    if (monitor >= pack->monitors.count) return LXRT_ERROR_NOT_FOUND;
    if (!(smoothing >= 0 && smoothing < 1)) return LXRT_ERROR_INVALID_ARGUMENT;
    lxrt_monitor_state *state = &pack->monitor_states[monitor];
    if (strength) {
        for (int i = 0; i < 3; ++i)
            if (!(strength[i] >= 0 && strength[i] <= LXRT_MAX_FACTOR)) return LXRT_ERROR_INVALID_ARGUMENT;
        memcpy(state->strength, strength, sizeof state->strength);
    }
    state->smoothing = smoothing;
    return LXRT_OK;
}
