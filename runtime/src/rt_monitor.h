// Monitors at run time, as the files of this folder share them.
#ifndef LXRT_RT_MONITOR_H
#define LXRT_RT_MONITOR_H

#include "rt_pack.h"

typedef struct lxrt_monitor_state {
    float strength[3];
    float smoothing;
} lxrt_monitor_state;

// After lxrt_open: authored strengths, no smoothing.
void lxrt_begin_monitors(lxrt_pack *pack);

#endif
