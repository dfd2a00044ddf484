/// Open Image Denoise, where its library is installed: the network for lightmaps ("RTLightmap"), on whole pages.
///
/// The library (1.1 or later, or 2.x) is loaded at run time; building Luxel does not need it. Pages are denoised one after the other, since the library uses all
/// cores by itself. The same input need not give the same bits on another version or machine.
///
/// Use:
///     lx_oidn_open(NULL, threads, &oidn, error);                           // early: says at once if it is not there
///     lx_oidn_denoise(oidn, &map, lx_finished_entries(finished), luxels, error); // per layer, any thread; direct and indirect light together
#ifndef LX_POST_OIDN_H
#define LX_POST_OIDN_H

#include "luxel/base.h"
#include "post/luxel_map.h"

typedef struct lx_oidn lx_oidn;

/// `library`: name or path; NULL: what the environment variable LUXEL_OIDN_LIBRARY says, else the usual names. `thread_count` 0: all cores.
/// LX_ERROR_BACKEND if it cannot be loaded or does not work here.
lx_result lx_oidn_open(const char *library, uint32_t thread_count, lx_oidn **out_oidn, lx_error *error);
void lx_oidn_close(lx_oidn *oidn);

/// Denoises a layer's luxels in place, page by page. `shown` [page_count * page_size²]: the luxel whose colour each texel shows, above the map's count: none; so
/// the network sees charts with their padding, and no luxel that is not valid. Calls from several threads wait for each other.
lx_result lx_oidn_denoise(lx_oidn *oidn, const lx_luxel_map *map, const uint32_t *shown, lx_rgb *luxels, lx_error *error);

#endif
