#define _GNU_SOURCE // renameat2
#include "base/file.h"

#include "base/error.h"
#include "base/memory.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

void lx_bytes_release(lx_bytes *bytes)
{
    lx_free(bytes->data);
    *bytes = (lx_bytes){0};
}

// A missing or unreadable input is the input's fault, the rest is the machine's.
static lx_result fail_errno(lx_error *error, const char *what)
{
    const int code = errno;
    const bool input = code == ENOENT || code == ENOTDIR || code == EACCES || code == EISDIR || code == ELOOP ||
                       code == ENAMETOOLONG;
    return lx_fail(error, input ? LX_ERROR_FORMAT : LX_ERROR_IO, "%s: %s", what, strerror(code));
}

lx_result lx_file_read(const char *path, size_t limit, lx_bytes *out, lx_error *error)
{
    lx_result result = LX_OK;
    uint8_t *data = NULL;
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); // O_NONBLOCK: never hang on a pipe
    if (file < 0) return fail_errno(error, "cannot read");
    struct stat info;
    if (fstat(file, &info) != 0) {
        result = fail_errno(error, "cannot read");
        goto cleanup;
    }
    if (S_ISDIR(info.st_mode)) {
        result = lx_fail(error, LX_ERROR_FORMAT, "cannot read: is a folder");
        goto cleanup;
    }
    if (!S_ISREG(info.st_mode)) {
        result = lx_fail(error, LX_ERROR_FORMAT, "cannot read: not a regular file");
        goto cleanup;
    }
    if ((uint64_t)info.st_size > limit) {
        result = lx_fail(error, LX_ERROR_LIMIT, "file of %llu bytes is larger than the limit of %zu",
                         (unsigned long long)info.st_size, limit);
        goto cleanup;
    }
    const size_t size = (size_t)info.st_size;
    data = lx_malloc_array(size, 1);
    if (!data) {
        result = lx_fail_memory(error, "file");
        goto cleanup;
    }
    size_t done = 0;
    while (done < size) {
        const ssize_t count = read(file, data + done, size - done);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) {
            result = fail_errno(error, "cannot read");
            goto cleanup;
        }
        if (count == 0) break; // it shrank while we read
        done += (size_t)count;
    }
    *out = (lx_bytes){data, done};
    data = NULL;
cleanup:
    lx_free(data);
    close(file);
    return result;
}

lx_result lx_file_map_open(const char *path, lx_file_map *out, lx_error *error)
{
    lx_result result = LX_OK;
    struct stat info;
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (file < 0) return fail_errno(error, "cannot read");
    if (fstat(file, &info) != 0) {
        result = fail_errno(error, "cannot read");
    } else if (!S_ISREG(info.st_mode) || info.st_size == 0) {
        result = lx_fail(error, LX_ERROR_FORMAT, "cannot read: not a regular file, or empty");
    } else {
        void *data = mmap(NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, file, 0);
        if (data == MAP_FAILED)
            result = fail_errno(error, "cannot read");
        else
            *out = (lx_file_map){data, (size_t)info.st_size};
    }
    close(file);
    return result;
}

void lx_file_map_rest(const lx_file_map *map)
{
    if (map->data) madvise((void *)map->data, map->size, MADV_DONTNEED); // never written to: nothing is lost
}

void lx_file_map_release(lx_file_map *map)
{
    if (map->data) munmap((void *)map->data, map->size);
    *map = (lx_file_map){0};
}

static lx_result flush_folder_of(const char *path)
{
    char *folder = lx_path_folder(path);
    if (!folder) return LX_ERROR_OUT_OF_MEMORY;
    const int handle = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (handle >= 0) {
        fsync(handle);
        close(handle);
    }
    lx_free(folder);
    return LX_OK;
}

static bool write_all(int file, const char *data, size_t size)
{
    while (size > 0) {
        const ssize_t count = write(file, data, size);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return false;
        data += count;
        size -= (size_t)count;
    }
    return true;
}

lx_result lx_file_write(const char *path, const void *data, size_t size, lx_error *error)
{
    lx_result result = LX_OK;
    int file = -1;
    bool created = false;
    char *temporary = lx_format("%s.tmp%ld", path, (long)getpid());
    if (!temporary) return lx_fail_memory(error, "path");
    file = open(temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (file < 0) {
        result = lx_fail(error, LX_ERROR_IO, "cannot write: %s", strerror(errno));
        goto cleanup;
    }
    created = true;
    if (!write_all(file, data, size)) {
        result = lx_fail(error, LX_ERROR_IO, "cannot write: %s", strerror(errno));
        goto cleanup;
    }
    const bool flushed = fsync(file) == 0;
    const int flush_errno = errno;
    const bool closed = close(file) == 0;
    file = -1;
    if (!flushed || !closed || rename(temporary, path) != 0) {
        result = lx_fail(error, LX_ERROR_IO, "cannot write: %s", strerror(flushed ? errno : flush_errno));
        goto cleanup;
    }
    created = false;
    flush_folder_of(path);
cleanup:
    if (file >= 0) close(file);
    if (created) unlink(temporary);
    lx_free(temporary);
    return result;
}

// ---- files below a folder

void lx_open_file_close(lx_open_file *file)
{
    if (file->handle >= 0) close(file->handle);
    file->handle = -1;
}

// Opens name after name, so that no link on the way is followed.
static int open_below(int folder, const char *path)
{
    int parent = folder;
    for (const char *name = path;;) {
        char part[NAME_MAX + 1];
        const size_t length = strcspn(name, "/");
        if (length == 0 || length > NAME_MAX || strspn(name, ".") >= length) { // all dots: no file of anyone's is called so
            errno = length > NAME_MAX ? ENAMETOOLONG : ENOENT;
            break;
        }
        memcpy(part, name, length);
        part[length] = '\0';
        const bool last = name[length] == '\0';
        const int handle = openat(parent, part, O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK | (last ? 0 : O_DIRECTORY));
        const int code = errno;
        if (parent != folder) close(parent);
        errno = code;
        if (last || handle < 0) return handle;
        parent = handle;
        name += length + 1;
    }
    const int code = errno;
    if (parent != folder) close(parent);
    errno = code;
    return -1;
}

lx_result lx_file_open_below(const char *folder, const char *path, lx_open_file *out, lx_error *error)
{
    const int root = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (root < 0) return fail_errno(error, "cannot read");
    const int handle = open_below(root, path);
    const int code = errno;
    close(root);
    errno = code;
    if (handle < 0) return errno == ELOOP ? lx_fail(error, LX_ERROR_FORMAT, "is a symbolic link") : fail_errno(error, "cannot read");
    struct stat info;
    const bool known = fstat(handle, &info) == 0;
    if (!known || !S_ISREG(info.st_mode)) {
        const lx_result result = known ? lx_fail(error, LX_ERROR_FORMAT, "cannot read: not a regular file") : fail_errno(error, "cannot read");
        close(handle);
        return result;
    }
    *out = (lx_open_file){
        .handle = handle,
        .size = (uint64_t)info.st_size,
        .number = (uint64_t)info.st_ino,
        .modified_ns = (int64_t)info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec,
    };
    return LX_OK;
}

lx_result lx_open_file_copy(const lx_open_file *file, const char *path, lx_error *error)
{
    enum { chunk_bytes = 1 << 20 };
    lx_result result = LX_OK;
    int out = -1;
    char *chunk = lx_malloc_array(chunk_bytes, 1);
    if (!chunk) return lx_fail_memory(error, "copy");
    out = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666);
    bool ok = out >= 0;
    for (ssize_t count = 1; ok && count != 0;) {
        count = read(file->handle, chunk, chunk_bytes);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) {
            result = fail_errno(error, "cannot read");
            goto cleanup;
        }
        ok = write_all(out, chunk, (size_t)count);
    }
    ok = ok && fsync(out) == 0;
    if (!ok) result = lx_fail(error, LX_ERROR_IO, "cannot write: %s", strerror(errno));
cleanup:
    if (out >= 0) close(out);
    lx_free(chunk);
    return result;
}

uint64_t lx_file_bytes(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && S_ISREG(info.st_mode) ? (uint64_t)info.st_size : 0;
}

bool lx_path_exists(const char *path)
{
    struct stat info;
    return lstat(path, &info) == 0;
}

bool lx_path_is_folder(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

bool lx_path_is_link(const char *path)
{
    struct stat info;
    return lstat(path, &info) == 0 && S_ISLNK(info.st_mode);
}

char *lx_path_join(const char *folder, const char *name)
{
    const size_t length = strlen(folder);
    return lx_format("%s%s%s", folder, length && folder[length - 1] == '/' ? "" : "/", name);
}

char *lx_path_folder(const char *path)
{
    size_t length = strlen(path);
    while (length > 1 && path[length - 1] == '/') --length;
    while (length > 0 && path[length - 1] != '/') --length;
    while (length > 1 && path[length - 1] == '/') --length;
    return length == 0 ? lx_strdup(".") : lx_strndup(path, length);
}

const char *lx_path_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

void lx_path_extension(const char *path, char out[8])
{
    const char *dot = strrchr(lx_path_name(path), '.');
    size_t length = 0;
    if (dot)
        for (++dot; dot[length] && length < 7; ++length) out[length] = (char)tolower((unsigned char)dot[length]);
    out[length] = '\0';
    if (dot && dot[length]) out[0] = '\0'; // longer than any we know
}

bool lx_path_is_inside(const char *path, const char *folder)
{
    char *real = realpath(path, NULL);
    char *base = realpath(folder, NULL);
    bool inside = false;
    if (real && base) {
        const size_t length = strlen(base);
        inside = strncmp(real, base, length) == 0 && (real[length] == '/' || (length == 1 && base[0] == '/'));
    }
    free(real);
    free(base);
    return inside;
}

lx_result lx_folder_create(const char *path, lx_error *error)
{
    if (mkdir(path, 0777) == 0) return LX_OK;
    if (errno == EEXIST && lx_path_is_folder(path)) return LX_OK;
    return lx_fail(error, LX_ERROR_IO, "cannot create folder %s: %s", path, strerror(errno));
}

static int remove_below(int parent, const char *name, int depth)
{
    if (depth > 64) {
        errno = ELOOP;
        return -1;
    }
    const int handle = openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (handle < 0) return unlinkat(parent, name, 0);
    DIR *folder = fdopendir(handle);
    if (!folder) {
        close(handle);
        return -1;
    }
    int status = 0;
    for (struct dirent *entry; status == 0 && (entry = readdir(folder)) != NULL;) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) continue;
        status = remove_below(handle, entry->d_name, depth + 1);
    }
    closedir(folder);
    return status == 0 ? unlinkat(parent, name, AT_REMOVEDIR) : status;
}

lx_result lx_folder_remove(const char *path, lx_error *error)
{
    if (remove_below(AT_FDCWD, path, 0) == 0 || errno == ENOENT) return LX_OK;
    return lx_fail(error, LX_ERROR_IO, "cannot remove %s: %s", path, strerror(errno));
}

lx_result lx_folder_swap(const char *fresh, const char *path, lx_error *error)
{
    lx_result result = LX_OK;
    char *old = NULL;
    if (!lx_path_exists(path)) {
        if (rename(fresh, path) != 0)
            return lx_fail(error, LX_ERROR_IO, "cannot rename %s: %s", fresh, strerror(errno));
        return flush_folder_of(path);
    }
    if (renameat2(AT_FDCWD, fresh, AT_FDCWD, path, RENAME_EXCHANGE) == 0) {
        flush_folder_of(path);
        return lx_folder_remove(fresh, error); // which now holds the old content
    }
    old = lx_format("%s.old%ld", path, (long)getpid());
    if (!old) return lx_fail_memory(error, "path");
    if (rename(path, old) != 0) {
        result = lx_fail(error, LX_ERROR_IO, "cannot rename %s: %s", path, strerror(errno));
    } else if (rename(fresh, path) != 0) {
        result = lx_fail(error, LX_ERROR_IO, "cannot rename %s: %s", fresh, strerror(errno));
        if (rename(old, path) != 0)
            result = lx_fail(error, LX_ERROR_IO, "the earlier result now lies in %s: %s", old, strerror(errno));
    } else {
        flush_folder_of(path);
        result = lx_folder_remove(old, error);
    }
    lx_free(old);
    return result;
}

static int compare_names(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

lx_result lx_folder_list(const char *path, void (*func)(void *user, const char *name), void *user, lx_error *error)
{
    DIR *folder = opendir(path);
    if (!folder) return fail_errno(error, "cannot read folder");
    lx_result result = LX_OK;
    char **names = NULL;
    size_t count = 0, capacity = 0;
    for (struct dirent *entry; (entry = readdir(folder)) != NULL;) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) continue;
        char *copy = lx_strdup(entry->d_name);
        if (!copy || !lx_array_reserve(&names, &capacity, count + 1, sizeof *names)) {
            lx_free(copy);
            result = lx_fail_memory(error, "folder listing");
            break;
        }
        names[count++] = copy;
    }
    closedir(folder);
    if (count) qsort(names, count, sizeof *names, compare_names);
    for (size_t i = 0; i < count; ++i) {
        if (result == LX_OK) func(user, names[i]);
        lx_free(names[i]);
    }
    lx_free(names);
    return result;
}

typedef struct folder_walk {
    const char *folder;
    lx_folder_visit func;
    void *user;
    const char *below; // "" at first; else with a slash at its end
    int depth;
    lx_result result;
    lx_error *error;
} folder_walk;

static void walk_entry(void *user, const char *name)
{
    folder_walk *walk = user;
    char *relative = NULL, *path = NULL;
    if (walk->result != LX_OK) return;
    relative = lx_format("%s%s", walk->below, name);
    path = relative ? lx_path_join(walk->folder, relative) : NULL;
    if (!path) {
        walk->result = lx_fail_memory(walk->error, "folder listing");
    } else {
        const bool is_folder = lx_path_is_folder(path) && !lx_path_is_link(path);
        walk->result = walk->func(walk->user, relative, is_folder, walk->error);
        if (walk->result == LX_OK && is_folder) {
            char *below = lx_format("%s/", relative);
            folder_walk inner = *walk;
            inner.below = below;
            inner.depth = walk->depth + 1;
            if (!below)
                walk->result = lx_fail_memory(walk->error, "folder listing");
            else if (inner.depth > 64)
                walk->result = lx_fail(walk->error, LX_ERROR_LIMIT, "%s: folders in folders, more than 64 deep", path);
            else
                walk->result = lx_folder_list(path, walk_entry, &inner, walk->error);
            if (walk->result == LX_OK) walk->result = inner.result;
            lx_free(below);
        }
    }
    lx_free(relative);
    lx_free(path);
}

lx_result lx_folder_walk(const char *folder, lx_folder_visit func, void *user, lx_error *error)
{
    folder_walk walk = {.folder = folder, .func = func, .user = user, .below = "", .error = error};
    const lx_result result = lx_folder_list(folder, walk_entry, &walk, error);
    return result == LX_OK ? walk.result : result;
}

bool lx_is_terminal(FILE *stream)
{
    return isatty(fileno(stream)) == 1;
}

int lx_terminal_columns(void)
{
    struct winsize size;
    if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
    return 80;
}
