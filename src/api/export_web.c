// A static site: the built viewer, and what it shows of a baked folder in `baked/`.
//
// A site may live on in other hands: someone adds a CNAME file, or a repository. So the export lists its own files, and a folder that holds
// anything else is never replaced.
#include "luxel/serve.h"

#include "base/builder.h"
#include "base/error.h"
#include "store/folder.h"
#include "store/manifest.h"

#include <string.h>

static const char list_name[] = ".luxel-export";
static const size_t max_list_bytes = (size_t)1 << 24;
static const size_t max_manifest_bytes = (size_t)1 << 28;

// ---- what an earlier export wrote

typedef struct file_list {
    const char *folder;
    char *text; // one path a line
} file_list;

static bool is_listed(const char *text, const char *path)
{
    const size_t length = strlen(path);
    for (const char *line = text; *line; line += strspn(line, "\n")) {
        const size_t line_length = strcspn(line, "\n");
        if (line_length == length && memcmp(line, path, length) == 0) return true;
        line += line_length;
    }
    return false;
}

static lx_result check_listed(void *user, const char *path, bool is_folder, lx_error *error)
{
    const file_list *list = user;
    if (is_folder || strcmp(path, list_name) == 0 || is_listed(list->text, path)) return LX_OK;
    return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: holds %s, which no export wrote, so it is not replaced; choose another name",
                   list->folder, path);
}

lx_result lx_export_web_check(const char *folder, lx_error *error)
{
    lx_result result = lx_folder_check_marked(folder, list_name, error);
    if (result != LX_OK) return result;
    lx_bytes bytes = {0};
    file_list list = {.folder = folder};
    char *path = lx_path_join(folder, list_name);
    if (!path) return lx_fail_memory(error, "path");
    if (lx_path_exists(path)) {
        result = lx_file_read(path, max_list_bytes, &bytes, error);
        if (result == LX_OK && !(list.text = lx_strndup((const char *)bytes.data, bytes.size))) result = lx_fail_memory(error, "export");
        if (result != LX_OK)
            lx_error_prefix(error, "%s", path);
        else
            result = lx_folder_walk(folder, check_listed, &list, error);
    }
    lx_free(list.text);
    lx_bytes_release(&bytes);
    lx_free(path);
    return result;
}

// ---- copying

typedef struct site_copy {
    lx_new_folder fresh;
    const char *viewer, *baked;
    lx_builder list; // of the files so far
    lx_web_export sum;
} site_copy;

static void note_file(site_copy *copy, const char *path, uint64_t bytes)
{
    lx_builder_add(&copy->list, path);
    lx_builder_add(&copy->list, "\n");
    ++copy->sum.file_count;
    copy->sum.bytes += bytes;
}

// from/name to the site's `to`. Messages name the file.
static lx_result copy_file(site_copy *copy, const char *from, const char *name, const char *to, lx_error *error)
{
    lx_open_file file = {.handle = -1};
    char *path = lx_path_join(copy->fresh.partial, to);
    if (!path) return lx_fail_memory(error, "path");
    lx_result result = lx_file_open_below(from, name, &file, error);
    if (result != LX_OK) {
        lx_error_prefix(error, "%s/%s", from, name);
    } else {
        result = lx_open_file_copy(&file, path, error);
        if (result != LX_OK) lx_error_prefix(error, "%s", path);
    }
    if (result == LX_OK) note_file(copy, to, file.size);
    lx_open_file_close(&file);
    lx_free(path);
    return result;
}

static lx_result create_folder(site_copy *copy, const char *name, lx_error *error)
{
    char *path = lx_path_join(copy->fresh.partial, name);
    if (!path) return lx_fail_memory(error, "path");
    const lx_result result = lx_folder_create(path, error);
    lx_free(path);
    return result;
}

static lx_result copy_viewer_entry(void *user, const char *path, bool is_folder, lx_error *error)
{
    static const char baked[] = "baked";
    site_copy *copy = user;
    if (path[0] == '.' || strstr(path, "/.")) return LX_OK; // an editor's, a version control's
    if (strncmp(path, baked, strlen(baked)) == 0 && (path[strlen(baked)] == '\0' || path[strlen(baked)] == '/')) return LX_OK;
    if (strchr(path, '\n')) return LX_OK; // the list has one path a line, and no viewer has such a file
    return is_folder ? create_folder(copy, path, error) : copy_file(copy, copy->viewer, path, path, error);
}

static lx_result copy_baked_file(site_copy *copy, const char *name, bool optional, lx_error *error)
{
    lx_result result = LX_OK;
    char *from = lx_path_join(copy->baked, name), *to = lx_path_join("baked", name);
    if (!from || !to)
        result = lx_fail_memory(error, "path");
    else if (strchr(name, '/'))
        result = lx_fail(error, LX_ERROR_UNSUPPORTED, "%s: lies in a folder of its own; no Luxel writes such a manifest", from);
    else if (!optional || lx_path_exists(from))
        result = copy_file(copy, copy->baked, name, to, error);
    lx_free(from);
    lx_free(to);
    return result;
}

static lx_result copy_baked(site_copy *copy, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bytes text = {0};
    lx_manifest manifest = {0};
    char *lean = NULL, *path = lx_path_join(copy->baked, LX_MANIFEST_NAME);
    if (!path) return lx_fail_memory(error, "path");
    result = lx_file_read(path, max_manifest_bytes, &text, error);
    if (result == LX_OK) result = lx_manifest_read((const char *)text.data, text.size, &manifest, error);
    if (result == LX_OK) result = lx_manifest_drop_files((const char *)text.data, text.size, &lean, error);
    if (result != LX_OK) {
        lx_error_prefix(error, "%s", path);
        goto cleanup;
    }
    LX_TRY(create_folder(copy, "baked", error));
    LX_TRY(lx_new_folder_write(&copy->fresh, "baked/" LX_MANIFEST_NAME, lean, strlen(lean), error));
    note_file(copy, "baked/" LX_MANIFEST_NAME, strlen(lean));
    LX_TRY(copy_baked_file(copy, manifest.pack, false, error));
    if (manifest.scene) LX_TRY(copy_baked_file(copy, manifest.scene, false, error));
    if (manifest.has_sky) LX_TRY(copy_baked_file(copy, manifest.sky.file, false, error));
    LX_TRY(copy_baked_file(copy, "preview.png", true, error));
    LX_TRY(copy_baked_file(copy, "report.html", true, error));
cleanup:
    lx_manifest_release(&manifest);
    lx_bytes_release(&text);
    lx_free(lean);
    lx_free(path);
    return result;
}

lx_result lx_export_web(const char *viewer, const char *baked, const char *folder, lx_web_export *out, lx_error *error)
{
    lx_result result = LX_OK;
    site_copy copy = {.viewer = viewer, .baked = baked};
    LX_TRY(lx_export_web_check(folder, error));
    LX_TRY(lx_new_folder_begin_marked(folder, list_name, &copy.fresh, error));
    if (lx_path_is_inside(copy.fresh.partial, viewer)) { // it would be copied into itself
        result = lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: lies inside of the viewer, %s", folder, viewer);
        goto cleanup;
    }
    LX_TRY(lx_folder_walk(viewer, copy_viewer_entry, &copy, error));
    LX_TRY(copy_baked(&copy, error));
    if (copy.list.failed) {
        result = lx_fail_memory(error, "export");
        goto cleanup;
    }
    LX_TRY(lx_new_folder_write(&copy.fresh, list_name, copy.list.text, copy.list.length, error));
    LX_TRY(lx_new_folder_commit(&copy.fresh, error));
    if (out) *out = copy.sum;
cleanup:
    lx_new_folder_abort(&copy.fresh);
    lx_builder_release(&copy.list);
    return result;
}
