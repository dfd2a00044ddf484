/// Libraries that are loaded at run time, because they may not be there.
#ifndef LX_BASE_LIBRARY_H
#define LX_BASE_LIBRARY_H

#include "luxel/base.h"

typedef struct lx_library lx_library;
typedef void (*lx_library_function)(void); ///< To be cast to what it is.

/// `name`: a file name that the system looks for in its places, or a path. The message is the system's reason.
lx_result lx_library_open(const char *name, lx_library **out_library, lx_error *error);
void lx_library_close(lx_library *library);

/// NULL: the library has no such function.
lx_library_function lx_library_find(const lx_library *library, const char *name);

#endif
