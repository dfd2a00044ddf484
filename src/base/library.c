#include "base/library.h"

#include "base/error.h"
#include "base/memory.h"

#include <dlfcn.h>
#include <string.h>

struct lx_library {
    void *handle;
};

lx_result lx_library_open(const char *name, lx_library **out_library, lx_error *error)
{
    lx_library *library = lx_malloc_array(1, sizeof *library);
    if (!library) return lx_fail_memory(error, name);
    library->handle = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (!library->handle) {
        const char *reason = dlerror();
        lx_free(library);
        return lx_fail(error, LX_ERROR_BACKEND, "%s", reason ? reason : "cannot load");
    }
    *out_library = library;
    return LX_OK;
}

void lx_library_close(lx_library *library)
{
    if (!library) return;
    dlclose(library->handle);
    lx_free(library);
}

lx_library_function lx_library_find(const lx_library *library, const char *name)
{
    // C has no cast from object to function pointers; POSIX says that they have the same representation.
    void *const symbol = dlsym(library->handle, name);
    lx_library_function function;
    memcpy(&function, &symbol, sizeof function);
    return function;
}
