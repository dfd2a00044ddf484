#include "luxel/host.h"

#include "base/clock.h"
#include "base/error.h"
#include "base/file.h"
#include "base/memory.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

bool lx_host_stderr_is_terminal(void)
{
    return lx_is_terminal(stderr);
}

int lx_host_columns(void)
{
    return lx_terminal_columns();
}

double lx_host_seconds(void)
{
    return lx_seconds();
}

uint64_t lx_host_peak_memory(void)
{
    return lx_peak_memory();
}

lx_result lx_host_check_input(const char *path, lx_error *error)
{
    struct stat info;
    if (stat(path, &info) != 0) return lx_fail(error, LX_ERROR_FORMAT, "%s: cannot read: %s", path, strerror(errno));
    if (S_ISDIR(info.st_mode)) return lx_fail(error, LX_ERROR_FORMAT, "%s: cannot read: is a folder", path);
    if (!S_ISREG(info.st_mode)) return lx_fail(error, LX_ERROR_FORMAT, "%s: cannot read: not a regular file", path);
    if (access(path, R_OK) != 0) return lx_fail(error, LX_ERROR_FORMAT, "%s: cannot read: %s", path, strerror(errno));
    return LX_OK;
}

lx_result lx_host_check_output(const char *path, lx_error *error)
{
    if (!*path) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "the output file has an empty name");
    if (lx_path_is_folder(path)) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: cannot write: is a folder", path);
    lx_result result = LX_OK;
    char *folder = lx_path_folder(path);
    if (!folder) return lx_fail_memory(error, "path");
    if (!lx_path_is_folder(folder))
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: cannot write: there is no folder %s", path, folder);
    else if (access(folder, W_OK | X_OK) != 0)
        result = lx_fail(error, LX_ERROR_IO, "%s: cannot write: folder %s: %s", path, folder, strerror(errno));
    lx_free(folder);
    return result;
}
