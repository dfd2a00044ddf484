/// Files for what does not fit into memory, read and written at any place.
#ifndef LX_BASE_SCRATCH_H
#define LX_BASE_SCRATCH_H

#include "luxel/base.h"

#include <stddef.h>

typedef struct lx_scratch lx_scratch;

/// A file without a name, so that nothing of it is left however the process ends. In `folder`; NULL: where TMPDIR points, else /var/tmp, which is on a disk where /tmp may be memory.
lx_result lx_scratch_create(const char *folder, lx_scratch **out_scratch, lx_error *error);
/// A new file that stays, at `path`. Messages of this and of all that follows do not repeat the path.
lx_result lx_scratch_create_file(const char *path, lx_scratch **out_scratch, lx_error *error);
/// Waits until all of it is on the disk.
lx_result lx_scratch_flush(lx_scratch *scratch, lx_error *error);
void lx_scratch_destroy(lx_scratch *scratch);

/// All of it, at a position. Any thread, also several at once on different parts.
lx_result lx_scratch_write(lx_scratch *scratch, uint64_t offset, const void *data, size_t size, lx_error *error);
/// LX_ERROR_IO where nothing has been written yet.
lx_result lx_scratch_read(const lx_scratch *scratch, uint64_t offset, void *data, size_t size, lx_error *error);

#endif
