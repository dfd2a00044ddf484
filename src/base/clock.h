/// Time and memory of this process.
#ifndef LX_BASE_CLOCK_H
#define LX_BASE_CLOCK_H

#include <stdint.h>

/// Monotonic seconds since some fixed moment.
double lx_seconds(void);

/// Seconds since *start, which becomes now: for stages that follow one another.
static inline double lx_lap(double *start)
{
    const double now = lx_seconds(), seconds = now - *start;
    *start = now;
    return seconds;
}

/// Largest resident size of this process so far, in bytes; 0 if the system does not tell.
uint64_t lx_peak_memory(void);
/// Resident size now, likewise.
uint64_t lx_resident_memory(void);

#endif
