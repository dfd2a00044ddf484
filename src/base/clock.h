/// Time and memory of this process.
#ifndef LX_BASE_CLOCK_H
#define LX_BASE_CLOCK_H

#include <stdint.h>

/// Monotonic seconds since some fixed moment.
double lx_seconds(void);

/// Largest resident size of this process so far, in bytes; 0 if the system does not tell.
uint64_t lx_peak_memory(void);
/// Resident size now, likewise.
uint64_t lx_resident_memory(void);

#endif
