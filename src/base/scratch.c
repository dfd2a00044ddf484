#define _GNU_SOURCE // O_TMPFILE
#include "base/scratch.h"

#include "base/error.h"
#include "base/memory.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct lx_scratch {
    int file;
    char *folder; // for messages; NULL: the file has a name, which callers know
};

// Not every file system knows files without a name: there the name is taken away at once.
static int open_nameless(const char *folder)
{
    const int file = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL && errno != ENOENT)) return file;
    char *path = lx_format("%s/luxel-XXXXXX", folder);
    if (!path) {
        errno = ENOMEM;
        return -1;
    }
    const int named = mkostemp(path, O_CLOEXEC);
    const int code = errno;
    if (named >= 0) unlink(path);
    lx_free(path);
    errno = code;
    return named;
}

lx_result lx_scratch_create(const char *folder, lx_scratch **out_scratch, lx_error *error)
{
    const char *chosen = getenv("TMPDIR");
    if (!folder) folder = chosen && *chosen ? chosen : "/var/tmp";
    lx_scratch *scratch = lx_malloc_array(1, sizeof *scratch);
    if (!scratch) return lx_fail_memory(error, "temporary file");
    *scratch = (lx_scratch){.file = -1, .folder = lx_strdup(folder)};
    if (!scratch->folder) {
        lx_scratch_destroy(scratch);
        return lx_fail_memory(error, "temporary file");
    }
    scratch->file = open_nameless(folder);
    if (scratch->file < 0) {
        const lx_result result = lx_fail(error, LX_ERROR_IO, "cannot create a temporary file in %s: %s", folder, strerror(errno));
        lx_scratch_destroy(scratch);
        return result;
    }
    *out_scratch = scratch;
    return LX_OK;
}

lx_result lx_scratch_create_file(const char *path, lx_scratch **out_scratch, lx_error *error)
{
    lx_scratch *scratch = lx_malloc_array(1, sizeof *scratch);
    if (!scratch) return lx_fail_memory(error, "file");
    *scratch = (lx_scratch){.file = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666)};
    if (scratch->file < 0) {
        const lx_result result = lx_fail(error, LX_ERROR_IO, "cannot write: %s", strerror(errno));
        lx_scratch_destroy(scratch);
        return result;
    }
    *out_scratch = scratch;
    return LX_OK;
}

static lx_result fail(const lx_scratch *scratch, const char *verb, const char *reason, lx_error *error)
{
    if (!scratch->folder) return lx_fail(error, LX_ERROR_IO, "cannot %s: %s", verb, reason);
    return lx_fail(error, LX_ERROR_IO, "cannot %s a temporary file in %s: %s", verb, scratch->folder, reason);
}

lx_result lx_scratch_flush(lx_scratch *scratch, lx_error *error)
{
    return fsync(scratch->file) == 0 ? LX_OK : fail(scratch, "write", strerror(errno), error);
}

void lx_scratch_destroy(lx_scratch *scratch)
{
    if (!scratch) return;
    if (scratch->file >= 0) close(scratch->file);
    lx_free(scratch->folder);
    lx_free(scratch);
}

lx_result lx_scratch_write(lx_scratch *scratch, uint64_t offset, const void *data, size_t size, lx_error *error)
{
    const char *from = data;
    while (size > 0) {
        const ssize_t count = pwrite(scratch->file, from, size, (off_t)offset);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return fail(scratch, "write", strerror(count < 0 ? errno : ENOSPC), error);
        from += count;
        offset += (uint64_t)count;
        size -= (size_t)count;
    }
    return LX_OK;
}

lx_result lx_scratch_read(const lx_scratch *scratch, uint64_t offset, void *data, size_t size, lx_error *error)
{
    char *to = data;
    while (size > 0) {
        const ssize_t count = pread(scratch->file, to, size, (off_t)offset);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return fail(scratch, "read", count < 0 ? strerror(errno) : "it ends too early", error);
        to += count;
        offset += (uint64_t)count;
        size -= (size_t)count;
    }
    return LX_OK;
}
