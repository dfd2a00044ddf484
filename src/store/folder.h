/// A folder that is written beside its place and swapped in when whole.
#ifndef LX_STORE_FOLDER_H
#define LX_STORE_FOLDER_H

#include "base/file.h"

#define LX_MANIFEST_NAME "luxel.json"

/// True if `path` is a folder with a luxel.json.
bool lx_folder_is_baked(const char *path);

/// May `folder` be (re)placed? Its parent exists, and it is missing, empty or a baked folder; it has a name and is no symbolic link.
/// Messages start with the path.
lx_result lx_folder_check(const char *folder, lx_error *error);

/// The same for folders that are known by another file than luxel.json.
lx_result lx_folder_check_marked(const char *folder, const char *mark, lx_error *error);

/// A folder in the making.
typedef struct lx_new_folder {
    const char *mark; ///< The file that makes a folder one of ours; borrowed.
    char *path;    ///< Where it goes, without slashes at its end.
    char *partial; ///< Where it is now: path.partial. NULL: none begun.
} lx_new_folder;

/// Checks `folder` and creates an empty folder.partial. What a killed run left there is removed; a folder.partial that is something else
/// is refused.
lx_result lx_new_folder_begin(const char *folder, lx_new_folder *out, lx_error *error);
/// The same for a folder that is known by `mark` (which must outlive it) and must hold that file when it is committed.
lx_result lx_new_folder_begin_marked(const char *folder, const char *mark, lx_new_folder *out, lx_error *error);
/// Writes a file into it.
lx_result lx_new_folder_write(const lx_new_folder *folder, const char *name, const void *data, size_t size, lx_error *error);
/// Puts it in place of what was there, which is removed. On failure the old content is still in place and `folder` can be aborted.
lx_result lx_new_folder_commit(lx_new_folder *folder, lx_error *error);
/// Removes it, unless it was committed. All zero is legal.
void lx_new_folder_abort(lx_new_folder *folder);

#endif
