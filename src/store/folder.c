// The baked folder appears whole or not at all: written to OUT.partial, then exchanged with OUT.
//
// Two folders are ever removed, the old OUT and a stale OUT.partial, and both only if they are ours: OUT holds a luxel.json (or another
// mark, for folders of another kind), OUT.partial one that is put there first of all.
#include "store/folder.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

static const char partial_mark[] = ".luxel-partial";

static bool holds(const char *folder, const char *name)
{
    char *path = lx_path_join(folder, name);
    const bool found = path && lx_path_exists(path);
    lx_free(path);
    return found;
}

bool lx_folder_is_baked(const char *path)
{
    return lx_path_is_folder(path) && holds(path, LX_MANIFEST_NAME);
}

static void count_name(void *user, const char *name)
{
    (void)name;
    ++*(size_t *)user;
}

static lx_result is_empty(const char *folder, bool *out, lx_error *error)
{
    size_t count = 0;
    const lx_result result = lx_folder_list(folder, count_name, &count, error);
    if (result != LX_OK) lx_error_prefix(error, "%s", folder);
    *out = count == 0;
    return result;
}

static char *without_slashes(const char *path)
{
    size_t length = strlen(path);
    while (length > 1 && path[length - 1] == '/') --length;
    return lx_strndup(path, length);
}

// `path` has no slash at its end.
static lx_result check_place(const char *path, const char *mark, lx_error *error)
{
    const char *name = lx_path_name(path);
    if (!*name || strcmp(name, ".") == 0 || strcmp(name, "..") == 0)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: the output folder needs a name of its own", *path ? path : "''");
    char *parent = lx_path_folder(path);
    if (!parent) return lx_fail_memory(error, "path");
    const bool has_parent = lx_path_is_folder(parent);
    if (!has_parent) lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: the folder %s does not exist", path, parent);
    lx_free(parent);
    if (!has_parent) return LX_ERROR_INVALID_ARGUMENT;

    if (!lx_path_exists(path)) return LX_OK;
    if (lx_path_is_link(path))
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: is a symbolic link; name the folder it points to", path);
    if (!lx_path_is_folder(path)) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: exists and is no folder", path);
    if (holds(path, mark)) return LX_OK;
    bool empty;
    const lx_result result = is_empty(path, &empty, error);
    if (result != LX_OK || empty) return result;
    return lx_fail(error, LX_ERROR_INVALID_ARGUMENT,
                   "%s: is not empty and holds no %s, so it is not replaced; choose another name", path, mark);
}

lx_result lx_folder_check_marked(const char *folder, const char *mark, lx_error *error)
{
    char *path = without_slashes(folder);
    if (!path) return lx_fail_memory(error, "path");
    const lx_result result = check_place(path, mark, error);
    lx_free(path);
    return result;
}

lx_result lx_folder_check(const char *folder, lx_error *error)
{
    return lx_folder_check_marked(folder, LX_MANIFEST_NAME, error);
}

// Removes what a killed run left behind.
static lx_result clear_partial(const char *partial, const char *mark, lx_error *error)
{
    if (!lx_path_exists(partial)) return LX_OK;
    bool ours = false;
    if (!lx_path_is_link(partial) && lx_path_is_folder(partial)) {
        const lx_result result = is_empty(partial, &ours, error);
        if (result != LX_OK) return result;
        ours |= holds(partial, partial_mark) || holds(partial, mark);
    }
    if (!ours)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: is in the way, and was not left by an earlier run; remove or rename it",
                       partial);
    return lx_folder_remove(partial, error);
}

lx_result lx_new_folder_begin(const char *folder, lx_new_folder *out, lx_error *error)
{
    return lx_new_folder_begin_marked(folder, LX_MANIFEST_NAME, out, error);
}

lx_result lx_new_folder_begin_marked(const char *folder, const char *mark, lx_new_folder *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_new_folder fresh = {.mark = mark, .path = without_slashes(folder)};
    char *partial = fresh.path ? lx_format("%s.partial", fresh.path) : NULL;
    if (!partial) {
        result = lx_fail_memory(error, "path");
        goto cleanup;
    }
    LX_TRY(check_place(fresh.path, mark, error));
    LX_TRY(clear_partial(partial, mark, error));
    LX_TRY(lx_folder_create(partial, error));
    fresh.partial = partial;
    partial = NULL;
    LX_TRY(lx_new_folder_write(&fresh, partial_mark, "", 0, error));
    *out = fresh;
    fresh = (lx_new_folder){0};
cleanup:
    lx_new_folder_abort(&fresh);
    lx_free(partial);
    return result;
}

lx_result lx_new_folder_write(const lx_new_folder *folder, const char *name, const void *data, size_t size, lx_error *error)
{
    char *path = lx_path_join(folder->partial, name);
    if (!path) return lx_fail_memory(error, "path");
    const lx_result result = lx_file_write(path, data, size, error);
    if (result != LX_OK) lx_error_prefix(error, "%s", path);
    lx_free(path);
    return result;
}

lx_result lx_new_folder_commit(lx_new_folder *folder, lx_error *error)
{
    lx_result result = LX_OK;
    char *mark = lx_path_join(folder->partial, partial_mark);
    if (!mark) return lx_fail_memory(error, "path");
    LX_TRY(check_place(folder->path, folder->mark, error)); // a long bake has passed since it was checked
    if (!holds(folder->partial, folder->mark)) {
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: holds no %s", folder->partial, folder->mark);
        goto cleanup;
    }
    LX_TRY(lx_folder_remove(mark, error)); // from here on its own mark tells whose it is
    LX_TRY(lx_folder_swap(folder->partial, folder->path, error));
    lx_free(folder->path);
    lx_free(folder->partial);
    *folder = (lx_new_folder){0};
cleanup:
    lx_free(mark);
    return result;
}

void lx_new_folder_abort(lx_new_folder *folder)
{
    if (folder->partial) lx_folder_remove(folder->partial, NULL);
    lx_free(folder->path);
    lx_free(folder->partial);
    *folder = (lx_new_folder){0};
}
