#define _GNU_SOURCE // POSIX_SPAWN_SETSID
#include "luxel/host.h"

#include "base/clock.h"
#include "base/error.h"
#include "base/file.h"
#include "base/memory.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char **environ;

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

void lx_host_sleep(double seconds)
{
    const struct timespec time = {(time_t)seconds, (long)(fmod(seconds, 1.0) * 1e9)};
    nanosleep(&time, NULL);
}

// ---- the viewer

static bool holds_index(const char *folder)
{
    char *path = lx_path_join(folder, "index.html");
    const bool found = path && lx_file_bytes(path) > 0;
    lx_free(path);
    return found;
}

static lx_result put_path(const char *path, char *out, size_t size, lx_error *error)
{
    if (strlen(path) >= size) return lx_fail(error, LX_ERROR_LIMIT, "%s: the path is too long", path);
    strcpy(out, path);
    return LX_OK;
}

lx_result lx_host_find_viewer(char *out, size_t size, lx_error *error)
{
    static const char *const places[] = {"viewer", "../share/luxel/viewer"};
    const char *chosen = getenv("LUXEL_VIEWER");
    if (chosen && *chosen) {
        if (holds_index(chosen)) return put_path(chosen, out, size, error);
        return lx_fail(error, LX_ERROR_FORMAT, "LUXEL_VIEWER: %s holds no index.html", chosen);
    }
    char program[4096];
    const ssize_t length = readlink("/proc/self/exe", program, sizeof program - 1);
    if (length < 0) return lx_fail(error, LX_ERROR_IO, "cannot tell where this program lies: %s", strerror(errno));
    program[length] = '\0';
    lx_result result = LX_ERROR_FORMAT;
    char *folder = lx_path_folder(program);
    for (size_t i = 0; folder && result == LX_ERROR_FORMAT && i < sizeof places / sizeof *places; ++i) {
        char *path = lx_path_join(folder, places[i]);
        if (path && holds_index(path)) result = put_path(path, out, size, error);
        lx_free(path);
    }
    if (result == LX_ERROR_FORMAT)
        lx_fail(error, result, "the viewer is not there: no index.html in %s/viewer; script/build makes it where Node.js is installed, and "
                "LUXEL_VIEWER names one elsewhere", folder ? folder : "");
    lx_free(folder);
    return result;
}

// ---- the browser

static bool is_set(const char *variable)
{
    const char *value = getenv(variable);
    return value && *value;
}

bool lx_host_has_display(void)
{
    return is_set("DISPLAY") || is_set("WAYLAND_DISPLAY");
}

// In a session of its own, so that Ctrl-C here does not reach it, and silent: browsers print much. A shell that ends at once starts it, so that
// nobody has to wait for it.
bool lx_host_open_browser(const char *url)
{
    char *arguments[] = {"sh", "-c", "command -v xdg-open && { xdg-open \"$0\" & }", (char *)url, NULL};
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    if (posix_spawn_file_actions_init(&files) != 0) return false;
    if (posix_spawnattr_init(&attributes) != 0) {
        posix_spawn_file_actions_destroy(&files);
        return false;
    }
    sigset_t caught;
    sigemptyset(&caught);
    sigaddset(&caught, SIGINT);
    sigaddset(&caught, SIGTERM);
    pid_t child;
    const bool started = posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0) == 0 &&
                         posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0) == 0 &&
                         posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0) == 0 &&
                         posix_spawnattr_setsigdefault(&attributes, &caught) == 0 &&
                         posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF) == 0 &&
                         posix_spawnp(&child, arguments[0], &files, &attributes, arguments, environ) == 0;
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    int status = 0;
    while (started && waitpid(child, &status, 0) < 0)
        if (errno != EINTR) return false;
    return started && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}
