/// Files and folders: all the system calls that touch the disk.
#ifndef LX_BASE_FILE_H
#define LX_BASE_FILE_H

#include "luxel/base.h"

#include <stdio.h>

typedef struct lx_bytes {
    uint8_t *data; ///< Owned; NULL when empty.
    size_t size;
} lx_bytes;

void lx_bytes_release(lx_bytes *bytes);

/// Reads a whole regular file of at most `limit` bytes (LX_ERROR_LIMIT beyond). Messages are "cannot read: reason", without the path.
lx_result lx_file_read(const char *path, size_t limit, lx_bytes *out, lx_error *error);

/// A file's content in the address space: pages come from disk when they are read. Whoever cuts the file short meanwhile ends the
/// process, so this is for files of our own. All zero is legal to release.
typedef struct lx_file_map {
    const uint8_t *data;
    size_t size;
} lx_file_map;

lx_result lx_file_map_open(const char *path, lx_file_map *out, lx_error *error);
/// Takes what was read so far out of memory; it comes back when it is read again.
void lx_file_map_rest(const lx_file_map *map);
void lx_file_map_release(lx_file_map *map);

/// Writes to a temporary file beside `path`, flushes it to disk and renames it, so that `path` holds the old or the new content.
lx_result lx_file_write(const char *path, const void *data, size_t size, lx_error *error);

/// A file that was opened for reading.
typedef struct lx_open_file {
    int handle; ///< -1: none.
    uint64_t size;
    uint64_t number;      ///< Tells files of one disk apart,
    int64_t modified_ns;  ///< and this one content from another. Since 1970.
} lx_open_file;

/// Opens the regular file `folder`/`path`. `path` is relative, one name or several with single slashes between; no name may be "." or
/// "..", and none below `folder` may be a symbolic link: what is opened lies in the folder, whoever else changes it meanwhile. `folder`
/// itself may be a link. Messages do not repeat the path.
lx_result lx_file_open_below(const char *folder, const char *path, lx_open_file *out, lx_error *error);
/// Legal on closed ones.
void lx_open_file_close(lx_open_file *file);
/// Writes all of it to a new file at `path` and flushes it to disk; `file` is read from where it stands.
lx_result lx_open_file_copy(const lx_open_file *file, const char *path, lx_error *error);

/// Size of a regular file; 0 if there is none.
uint64_t lx_file_bytes(const char *path);

bool lx_path_exists(const char *path);
bool lx_path_is_folder(const char *path);
bool lx_path_is_link(const char *path);

/// "folder/name" in a fresh string; the folder of a path ("." if it has none); what follows its last slash (borrowed).
char *lx_path_join(const char *folder, const char *name);
char *lx_path_folder(const char *path);
const char *lx_path_name(const char *path);
/// The lower-case ending without its dot, up to 7 characters ("glb"); "" if there is none.
void lx_path_extension(const char *path, char out[8]);
/// True if `path` (symbolic links resolved) lies below `folder` (likewise).
bool lx_path_is_inside(const char *path, const char *folder);

/// Creates a folder; its parents must exist. An existing folder is fine.
lx_result lx_folder_create(const char *path, lx_error *error);
/// Removes a folder and all below it, without following links. A missing one is fine.
lx_result lx_folder_remove(const char *path, lx_error *error);
/// Puts the folder `fresh` in the place of `path`: atomically exchanged where the system can, else by two renames.
/// The old content is removed. Flushes the parent folder.
lx_result lx_folder_swap(const char *fresh, const char *path, lx_error *error);

/// Calls `func` for every name in the folder except . and .., sorted by bytes.
lx_result lx_folder_list(const char *path, void (*func)(void *user, const char *name), void *user, lx_error *error);

/// Calls `func` for everything below a folder, sorted, each folder before what is in it: `path` is relative to the folder. Links are not
/// followed: they count as files. The first result other than LX_OK ends it and is returned.
typedef lx_result (*lx_folder_visit)(void *user, const char *path, bool is_folder, lx_error *error);
lx_result lx_folder_walk(const char *folder, lx_folder_visit func, void *user, lx_error *error);

bool lx_is_terminal(FILE *stream);
/// Columns of the terminal on stderr, 80 if unknown.
int lx_terminal_columns(void);

#endif
