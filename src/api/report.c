#include "api/report.h"

#include "api/html.h"
#include "base/context.h"
#include "base/error.h"
#include "math/color.h"

#include <math.h>
#include <string.h>
#include <time.h>

enum {
    atlas_pixels = 512,
    thumbnail_pixels = 160,
    most_thumbnails = 400, // beyond, layers are listed by name alone: nobody looks at more, and the page stays a page
};

static const char style[] =
    ":root{color-scheme:light dark;--paper:#fbfaf8;--card:#fff;--ink:#1d1b18;--soft:#6d675f;--line:#e4dfd7;--accent:#b4540a;"
    "--warn:#fdf1dc;--warnline:#e5b567}"
    "@media(prefers-color-scheme:dark){:root{--paper:#151412;--card:#1e1c1a;--ink:#ece8e1;--soft:#9d968b;--line:#35312c;"
    "--accent:#f0a35e;--warn:#33270f;--warnline:#7d5d20}}"
    "*{box-sizing:border-box}"
    "body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',"
    "sans-serif;-webkit-text-size-adjust:100%;overflow-wrap:anywhere}"
    "main{max-width:1080px;margin:0 auto;padding:clamp(16px,4vw,48px)}"
    "h1{font-size:clamp(1.6rem,5vw,2.4rem);line-height:1.15;letter-spacing:-.02em;margin:0}"
    "h2{font-size:1.15rem;letter-spacing:-.01em;margin:2.6em 0 .8em}"
    "p{margin:.3em 0}h2+p{margin:-.4em 0 1em}.soft{color:var(--soft)}small,.small{font-size:.85rem}"
    "header p{color:var(--soft);margin:.5em 0 1.4em}"
    ".hero{display:block;width:100%;height:auto;border-radius:10px;background:#000}"
    ".figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(8.5rem,1fr));gap:1px;background:var(--card);"
    "border:1px solid var(--line);border-radius:10px;overflow:hidden;margin-top:20px}"
    ".figures div{padding:12px 14px;box-shadow:0 0 0 1px var(--line)}"
    ".figures b{display:block;font-size:1.2rem;white-space:nowrap;font-weight:600;letter-spacing:-.02em;font-variant-numeric:tabular-nums}"
    ".figures span{color:var(--soft);font-size:.8rem}"
    ".warn{background:var(--warn);border:1px solid var(--warnline);border-radius:10px;padding:12px 18px;margin-top:20px}"
    ".warn ul{margin:.3em 0 0;padding-left:1.1em}.warn li{margin:.25em 0}"
    ".layers{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(44%,190px),1fr));gap:14px;align-items:start}"
    ".pages{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,300px),1fr));gap:18px}"
    "figure{margin:0;background:var(--card);border:1px solid var(--line);border-radius:10px;overflow:hidden;break-inside:avoid}"
    "figure img{display:block;width:100%;height:auto;background:#000}"
    "figcaption{padding:9px 12px 11px;font-size:.85rem;line-height:1.4}"
    "figcaption b{display:flex;gap:.5em;align-items:baseline;font-size:.95rem}"
    ".swatch{flex:none;width:.8em;height:.8em;border-radius:50%;border:1px solid var(--line);print-color-adjust:exact;"
    "-webkit-print-color-adjust:exact}"
    "figure .cells{image-rendering:pixelated;border-top:1px solid var(--line)}"
    ".two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,380px),1fr));gap:0 40px}"
    "table{width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums}"
    "td,th{padding:6px 0;border-bottom:1px solid var(--line);text-align:left;font-weight:400;vertical-align:baseline}"
    "td:last-child{text-align:right;white-space:nowrap;padding-left:1em}"
    "tfoot td,tfoot th{font-weight:600;border-bottom:0}"
    ".bar{display:flex;height:14px;border-radius:7px;overflow:hidden;background:var(--line);margin:0 0 10px;print-color-adjust:exact;"
    "-webkit-print-color-adjust:exact}.bar i{display:block;min-width:1px}"
    ".s0{background:#8a5a2b}.s1{background:#c98a3c}.s2{background:#e0b65c}.s3{background:#e39a7b}.s4{background:#a8644f}"
    ".s5{background:#c8553d}.s6{background:#8f7fb0}.s7{background:#c8553d}.s8{background:#7a4e7e}.s9{background:#3f6c8f}"
    ".s10{background:#5d9a78}"
    "th .swatch{display:inline-block;margin-right:.6em}"
    "footer{margin-top:3em;color:var(--soft);font-size:.85rem}"
    "@media print{body{background:#fff;font-size:11pt}main{max-width:none;padding:0}.layers{grid-template-columns:repeat(4,1fr)}"
    ".pages{grid-template-columns:repeat(2,1fr)}h2{break-after:avoid}tr,.warn{break-inside:avoid}}";

// ---- small things

static void add_bytes(lx_builder *html, uint64_t bytes)
{
    static const char *const units[] = {"bytes", "KiB", "MiB", "GiB", "TiB"};
    double value = (double)bytes;
    size_t unit = 0;
    for (; value >= 1024 && unit + 1 < sizeof units / sizeof *units; ++unit) value /= 1024;
    lx_builder_number(html, value, unit ? 1 : 0);
    lx_builder_format(html, "&nbsp;%s", units[unit]);
}

static void add_seconds(lx_builder *html, double seconds)
{
    const unsigned long whole = seconds < 1e9 ? (unsigned long)(seconds + 0.5) : 1000000000;
    if (seconds < 59.95) {
        lx_builder_number(html, seconds, seconds < 9.95 ? 2 : 1);
        lx_builder_add(html, "&nbsp;s");
    } else if (whole < 3600) {
        lx_builder_format(html, "%lu&nbsp;m %02lu&nbsp;s", whole / 60, whole % 60);
    } else {
        lx_builder_format(html, "%lu&nbsp;h %02lu&nbsp;m", whole / 3600, whole / 60 % 60);
    }
}

// Three digits that count: 1200, 34.5, 0.00123.
static void add_quantity(lx_builder *html, double value)
{
    const double size = fabs(value);
    const int decimals = size >= 100 || size == 0 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : size >= 1e-9 ? 2 - (int)floor(log10(size)) : 12;
    lx_builder_number(html, value, decimals);
}

static const char *plural(uint64_t count)
{
    return count == 1 ? "" : "s";
}

static const char *unit_name(const char *unit)
{
    return strcmp(unit, "nt") == 0 ? "nit" : unit;
}

// ---- the top

static void add_figure(lx_builder *html, const char *label)
{
    lx_builder_format(html, "</b><span>%s</span></div>", label);
}

static void add_head(const lx_report *report, lx_builder *html)
{
    char when[64] = "";
    const time_t now = time(NULL);
    const struct tm *utc = gmtime(&now);
    if (utc) strftime(when, sizeof when, "%Y-%m-%d %H:%M UTC", utc);
    lx_builder_add(html, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
                         "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><meta name=\"generator\" content=\"");
    lx_html_text(html, report->manifest->generator);
    lx_builder_add(html, "\"><title>");
    lx_html_text(html, report->title);
    lx_builder_add(html, " · Luxel report</title><link rel=\"icon\" href=\"data:,\"><style>"); // no request for a favicon.ico
    lx_builder_add(html, style);
    lx_builder_add(html, "</style></head>\n<body><main>\n<header><h1>");
    lx_html_text(html, report->title);
    lx_builder_add(html, "</h1><p>baked ");
    lx_builder_add(html, when);
    lx_builder_add(html, " by ");
    lx_html_text(html, report->manifest->generator);
    lx_builder_add(html, "</p></header>\n");
}

static lx_result add_preview(const lx_report *report, lx_builder *html, lx_error *error)
{
    if (!report->preview) return LX_OK;
    lx_builder_format(html, "<img class=\"hero\" width=\"%u\" height=\"%u\" alt=\"The scene with its baked light\" src=\"",
                      report->preview->width, report->preview->height);
    const lx_result result = lx_report_add_jpeg(html, report->preview, 88, error);
    lx_builder_add(html, "\">\n");
    return result;
}

static void add_key_figures(const lx_report *report, lx_builder *html)
{
    const lx_bake_summary *s = &report->bake->summary;
    lx_builder_format(html, "<div class=\"figures\"><div><b>%u", s->layer_count);
    add_figure(html, s->layer_count == 1 ? "layer" : "layers");
    lx_builder_format(html, "<div><b>%u", s->source_count);
    add_figure(html, s->source_count == 1 ? "light source" : "light sources");
    lx_builder_format(html, "<div><b>%u × %u²", s->page_count, s->page_size);
    add_figure(html, "texels");
    lx_builder_add(html, "<div><b>");
    lx_builder_number(html, 100.0 * (double)s->coverage, 1);
    lx_builder_add(html, "&nbsp;%");
    add_figure(html, "covered by surfaces");
    lx_builder_add(html, "<div><b>");
    add_quantity(html, (double)s->texels_per_m);
    add_figure(html, "texels per metre");
    lx_builder_add(html, "<div><b>");
    add_bytes(html, s->pack_bytes);
    add_figure(html, "luxel.pack");
    lx_builder_add(html, "<div><b>");
    add_seconds(html, s->seconds);
    add_figure(html, "of baking");
    if (s->noise > 0) {
        lx_builder_add(html, "<div><b>");
        add_quantity(html, 100 * (double)s->noise);
        lx_builder_add(html, "&nbsp;%");
        add_figure(html, strcmp(report->manifest->bake.denoise, "none") == 0 ? "noise, estimated" : "noise, estimated before denoising");
    }
    lx_builder_add(html, "</div>\n");
}

static void add_warnings(const lx_report *report, lx_builder *html)
{
    lx_log *log = report->bake->scene->context ? report->bake->scene->context->log : NULL;
    const size_t count = lx_log_warning_count(log);
    const lx_bake_summary *s = &report->bake->summary;
    if (count == 0 && s->invalid_count == 0) return;
    lx_builder_add(html, "<section class=\"warn\"><b>");
    if (count)
        lx_builder_format(html, "%zu warning%s", count, plural(count));
    else
        lx_builder_add(html, "Note");
    lx_builder_add(html, "</b><ul>");
    for (size_t i = 0; i < count; ++i) {
        lx_builder_add(html, "<li>");
        lx_html_text(html, lx_log_warning_text(log, i));
        lx_builder_add(html, "</li>");
    }
    if (s->invalid_count)
        lx_builder_format(html, "<li>%llu of %llu texels lie inside solid geometry and were filled from their neighbours</li>",
                          (unsigned long long)s->invalid_count, (unsigned long long)s->texel_count);
    lx_builder_add(html, "</ul></section>\n");
}

// ---- layers

static void set_all(lx_baked *baked, const lx_manifest *manifest, bool on)
{
    for (uint32_t i = 0; i < manifest->layer_count; ++i)
        lxrt_set_layer(baked->pack, i, on ? manifest->layers[i].color : (const float[3]){0, 0, 0}, manifest->layers[i].intensity);
}

// What shines in the pack now: as the preview's camera sees it, else on the page where it shines most.
static lx_result add_thumbnail(const lx_report *report, lx_builder *html, bool *out_black, lx_error *error)
{
    lx_result result = LX_OK;
    lx_image image = {0};
    uint32_t page;
    *out_black = false;
    if (report->seen) {
        LX_TRY(lx_report_seen_picture(report->baked, report->seen, &image, out_black, error));
    } else {
        LX_TRY(lx_report_brightest_page(report->baked, &page, error));
        LX_TRY(lx_report_page_picture(report->baked, page, thumbnail_pixels, &image, error));
    }
    lx_builder_format(html, "<figure><img loading=\"lazy\" width=\"%u\" height=\"%u\" alt=\"\" src=\"", image.width, image.height);
    LX_TRY(lx_report_add_jpeg(html, &image, 82, error));
    lx_builder_add(html, "\">");
cleanup:
    lx_image_release(&image);
    return result;
}

static uint32_t count_sources(const lx_baked *baked, uint32_t layer)
{
    uint32_t count = 0;
    lxrt_source source;
    for (uint32_t i = 0; lxrt_get_source(baked->pack, i, &source) == LXRT_OK; ++i) count += source.layer == layer;
    return count;
}

static void add_swatch(lx_builder *html, const float color[3])
{
    char swatch[8];
    lx_report_swatch(color, swatch);
    lx_builder_format(html, "<span class=\"swatch\" title=\"%s\" style=\"background:%s\"></span>", swatch, swatch);
}

static lx_result add_layer(const lx_report *report, uint32_t index, lx_builder *html, lx_error *error)
{
    static const float white[3] = {1, 1, 1};
    const lx_manifest_layer *layer = &report->manifest->layers[index];
    const bool dark = layer->color[0] <= 0 && layer->color[1] <= 0 && layer->color[2] <= 0;
    lxrt_set_layer(report->baked->pack, index, dark ? white : layer->color, 1);
    bool out_of_sight;
    const lx_result result = add_thumbnail(report, html, &out_of_sight, error);
    lxrt_set_layer(report->baked->pack, index, white, 0);
    lx_builder_add(html, "<figcaption><b>");
    add_swatch(html, layer->color);
    lx_builder_add(html, "<span>");
    lx_html_text(html, layer->name);
    lx_builder_add(html, "</span></b>");
    add_quantity(html, (double)layer->intensity);
    lx_builder_add(html, "&nbsp;");
    lx_html_text(html, unit_name(layer->unit));
    lx_builder_add(html, "<br><span class=\"soft\">");
    lx_html_text(html, layer->kind);
    if (strcmp(layer->mode, "baked") != 0) {
        lx_builder_add(html, ", ");
        lx_html_text(html, layer->mode);
    }
    const uint32_t sources = count_sources(report->baked, index);
    if (sources != 1) lx_builder_format(html, ", %u sources", sources);
    if (out_of_sight) lx_builder_add(html, ", out of sight here");
    lx_builder_add(html, "</span></figcaption></figure>\n");
    return result;
}

// The cells' authored colours as a picture of one pixel each.
static lx_result add_cells(const lx_report *report, const lxrt_monitor *monitor, lx_builder *html, lx_error *error)
{
    lx_result result = LX_OK;
    lx_image image = {0};
    lx_bytes png = {0};
    float strongest = 0;
    LX_TRY(lx_image_create(monitor->columns, monitor->rows, 3, LX_PIXEL_U8, &image, error));
    const uint32_t count = monitor->columns * monitor->rows;
    for (int pass = 0; pass < 2; ++pass)
        for (uint32_t cell = 0; cell < count; ++cell) {
            const lx_manifest_layer *layer = &report->manifest->layers[monitor->first_layer + cell];
            for (int k = 0; k < 3; ++k) {
                const float c = layer->color[k] * layer->intensity;
                if (pass == 0) strongest = fmaxf(strongest, c);
                else image.u8[3 * cell + (uint32_t)k] = (uint8_t)(lx_linear_to_srgb(strongest > 0 ? lx_clamp(c / strongest, 0, 1) : 0) * 255 + 0.5f);
            }
        }
    LX_TRY(lx_png_encode(&image, &png, error));
    lx_builder_format(html, "<img class=\"cells\" width=\"%u\" height=\"%u\" alt=\"Authored colours of the cells\" src=\"data:image/png;base64,",
                      monitor->columns, monitor->rows);
    lx_builder_base64(html, png.data, png.size);
    lx_builder_add(html, "\">");
cleanup:
    lx_bytes_release(&png);
    lx_image_release(&image);
    return result;
}

// All cells in one picture: they are layers too, but hundreds of them.
static lx_result add_monitor(const lx_report *report, const lxrt_monitor *monitor, lx_builder *html, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_manifest *manifest = report->manifest;
    const uint32_t first = monitor->first_layer, last = first + monitor->columns * monitor->rows - 1;
    bool dark = true, out_of_sight;
    for (uint32_t i = first; i <= last; ++i) {
        const lx_manifest_layer *layer = &manifest->layers[i];
        for (int k = 0; k < 3; ++k) dark &= !(layer->color[k] * layer->intensity > 0);
    }
    for (uint32_t i = first; i <= last; ++i)
        lxrt_set_layer(report->baked->pack, i, dark ? (const float[3]){1, 1, 1} : manifest->layers[i].color,
                       dark ? 1 : manifest->layers[i].intensity);
    LX_TRY(add_thumbnail(report, html, &out_of_sight, error));
    LX_TRY(add_cells(report, monitor, html, error));
    for (uint32_t i = first; i <= last; ++i) lxrt_set_layer(report->baked->pack, i, (const float[3]){0, 0, 0}, 0);
    lx_builder_add(html, "<figcaption><b><span>");
    lx_html_text(html, monitor->name);
    lx_builder_format(html, "</span></b>%u × %u cells<br><span class=\"soft\">monitor, layers ", monitor->columns, monitor->rows);
    lx_html_text(html, manifest->layers[first].name);
    lx_builder_add(html, " … ");
    lx_html_text(html, manifest->layers[last].name);
    lx_builder_add(html, "</span></figcaption></figure>\n");
cleanup:
    return result;
}

// The monitor that owns a layer; false: none. Monitors that show one picture share their layers: the first counts.
static bool find_monitor(const lx_baked *baked, uint32_t layer, lxrt_monitor *out)
{
    for (uint32_t i = 0; lxrt_get_monitor(baked->pack, i, out) == LXRT_OK; ++i)
        if (layer >= out->first_layer && layer - out->first_layer < out->columns * out->rows) return true;
    return false;
}

static lx_result add_layers(const lx_report *report, lx_builder *html, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_manifest *manifest = report->manifest;
    uint32_t shown = 0, layer = 0;
    lx_builder_add(html, "<section><h2>Layers</h2><p class=\"soft small\">What each of them brings to the surfaces, in its authored colour, each at an "
                         "exposure of its own.</p>\n<div class=\"layers\">\n");
    set_all(report->baked, manifest, false);
    for (; layer < manifest->layer_count && shown < most_thumbnails; ++shown) {
        lxrt_monitor monitor;
        if (find_monitor(report->baked, layer, &monitor)) {
            LX_TRY(add_monitor(report, &monitor, html, error));
            layer = monitor.first_layer + monitor.columns * monitor.rows;
        } else {
            LX_TRY(add_layer(report, layer, html, error));
            ++layer;
        }
    }
    lx_builder_add(html, "</div>\n");
    if (layer < manifest->layer_count) {
        lx_builder_format(html, "<p class=\"small\">And %u more: ", manifest->layer_count - layer);
        for (bool first = true; layer < manifest->layer_count; ++layer, first = false) {
            if (!first) lx_builder_add(html, ", ");
            lx_html_text(html, manifest->layers[layer].name);
        }
        lx_builder_add(html, "</p>\n");
    }
    lx_builder_add(html, "</section>\n");
cleanup:
    return result;
}

// ---- atlas

static lx_result add_atlas(const lx_report *report, lx_builder *html, lx_error *error)
{
    const lx_manifest *manifest = report->manifest;
    lx_builder_add(html, "<section><h2>Atlas</h2><p class=\"soft small\">All layers at their authored colours, as white walls would show them.</p>\n"
                         "<div class=\"pages\">\n");
    set_all(report->baked, manifest, true);
    for (uint32_t page = 0; page < manifest->page_count; ++page) {
        lx_image image = {0};
        lx_result result = lx_report_page_picture(report->baked, page, atlas_pixels, &image, error);
        if (result == LX_OK) {
            lx_builder_format(html, "<figure><img loading=\"lazy\" width=\"%u\" height=\"%u\" alt=\"Atlas page %u\" src=\"", image.width,
                              image.height, page);
            result = lx_report_add_jpeg(html, &image, 86, error);
        }
        lx_image_release(&image);
        if (result != LX_OK) return result;
        lx_builder_format(html, "\"><figcaption><b>Page %u</b>%u × %u texels, ", page, manifest->pages[page].width, manifest->pages[page].height);
        lx_builder_number(html, 100.0 * (double)manifest->pages[page].coverage, 1);
        lx_builder_add(html, "&nbsp;% covered, ");
        add_quantity(html, (double)manifest->texels_per_m);
        lx_builder_add(html, " texels per metre</figcaption></figure>\n");
    }
    lx_builder_add(html, "</div></section>\n");
    return LX_OK;
}

// ---- tables

static void add_byte_row(lx_builder *html, const char *what, const char *why, uint64_t bytes)
{
    lx_builder_format(html, "<tr><th>%s%s%s%s</th><td>", what, *why ? " <span class=\"soft small\">" : "", why, *why ? "</span>" : "");
    add_bytes(html, bytes);
    lx_builder_add(html, "</td></tr>\n");
}

static void add_memory(const lx_report *report, lx_builder *html)
{
    const lx_budget *b = &report->manifest->memory;
    lx_builder_add(html, "<section><h2>Memory at run time</h2><table>\n");
    add_byte_row(html, "RAM", "the pack and its handle", b->ram);
    add_byte_row(html, "RAM for sums", "if only changes are to be added", b->accumulator);
    add_byte_row(html, "GPU, composed", "one RGB9E5 lightmap with mips; half floats: twice", b->gpu_composed);
    add_byte_row(html, "GPU, all layers", "summed per pixel", b->gpu_layers);
    add_byte_row(html, "Texels if none were absent", "of which the pack keeps what is lit", b->dense);
    lx_builder_add(html, "</table></section>\n");
}

typedef struct disk_list {
    const lx_report *report;
    lx_builder *html;
    uint64_t total;
} disk_list;

static void add_disk_row(void *user, const char *name)
{
    disk_list *list = user;
    char *path = lx_path_join(list->report->files_folder, name);
    const uint64_t bytes = path && *name != '.' ? lx_file_bytes(path) : 0;
    lx_free(path);
    if (bytes == 0) return;
    list->total += bytes;
    lx_builder_add(list->html, "<tr><th>");
    lx_html_text(list->html, name);
    lx_builder_add(list->html, "</th><td>");
    add_bytes(list->html, bytes);
    lx_builder_add(list->html, "</td></tr>\n");
}

static lx_result add_disk(const lx_report *report, lx_builder *html, lx_error *error)
{
    disk_list list = {report, html, 0};
    lx_builder_add(html, "<section><h2>On disk</h2><table>\n");
    const lx_result result = lx_folder_list(report->files_folder, add_disk_row, &list, error);
    lx_builder_add(html, "<tfoot><tr><th>Together, without this page</th><td>");
    add_bytes(html, list.total);
    lx_builder_add(html, "</td></tr></tfoot></table></section>\n");
    return result;
}

static void add_stages(const lx_report *report, lx_builder *html)
{
    const lx_stage_seconds *s = &report->manifest->bake.stages;
    const double parts = s->direct + s->cache + s->gather + s->denoise; // of the bake
    const struct {
        const char *name, *what;
        double seconds;
    } stages[] = {
        {"import", "reading and checking the scene", s->import},
        {"unwrap", "charts and atlas", s->unwrap},
        {"luxels", "texels in the world", s->luxels},
        {"direct", "light straight from its sources", s->direct},
        {"cache", "light that bounces between texels", s->cache},
        {"gather", "what every texel sees of both", s->gather},
        {"denoise", "smoothing what noise is left", s->denoise},
        {"bake", parts > 0 ? "the rest of it" : "tracing", s->bake - parts},
        {"post", "filling the padding", s->post},
        {"save", "mips, pack, files", s->save},
        {"preview", "the picture above", s->preview},
    };
    enum { stage_count = sizeof stages / sizeof *stages };
    double total = 0;
    for (size_t i = 0; i < stage_count; ++i) total += stages[i].seconds;
    lx_builder_add(html, "<section><h2>Time</h2><div class=\"bar\">");
    for (size_t i = 0; i < stage_count && total > 0; ++i) {
        if (stages[i].seconds <= 0) continue;
        lx_builder_format(html, "<i class=\"s%zu\" style=\"width:", i);
        lx_builder_number(html, 100 * stages[i].seconds / total, 3);
        lx_builder_format(html, "%%\" title=\"%s\"></i>", stages[i].name);
    }
    lx_builder_add(html, "</div><table>\n");
    for (size_t i = 0; i < stage_count; ++i) {
        if (stages[i].seconds <= 0) continue;
        lx_builder_format(html, "<tr><th><span class=\"swatch s%zu\"></span>%s <span class=\"soft small\">%s</span></th><td>", i, stages[i].name,
                          stages[i].what);
        add_seconds(html, stages[i].seconds);
        lx_builder_add(html, "</td></tr>\n");
    }
    lx_builder_add(html, "<tfoot><tr><th>Together</th><td>");
    add_seconds(html, total);
    lx_builder_add(html, "</td></tr></tfoot></table></section>\n");
}

static void add_setting(lx_builder *html, const char *name)
{
    lx_builder_format(html, "<tr><th>%s</th><td>", name);
}

static void add_settings(const lx_report *report, lx_builder *html)
{
    static const char end[] = "</td></tr>\n";
    const lx_manifest_bake *b = &report->manifest->bake;
    const lx_bake_desc *desc = &report->bake->desc;
    const bool gather = desc->integrator == LX_INTEGRATOR_GATHER;
    lx_builder_add(html, "<section><h2>Settings</h2><table>\n");
    add_setting(html, "integrator");
    lx_html_text(html, b->integrator);
    lx_builder_add(html, end);
    add_setting(html, gather ? "samples per texel, at most" : "samples per texel");
    lx_builder_format(html, "%u%s", b->samples, end);
    if (gather && desc->noise > 0) {
        add_setting(html, "noise wanted");
        add_quantity(html, 100 * (double)desc->noise);
        lx_builder_format(html, "&nbsp;%%%s", end);
    }
    if (gather && desc->time_s > 0) {
        add_setting(html, "time limit");
        add_seconds(html, desc->time_s);
        lx_builder_add(html, end);
    }
    if (gather && desc->memory_bytes > 0) {
        add_setting(html, "memory limit");
        add_bytes(html, desc->memory_bytes);
        lx_builder_add(html, end);
    }
    if (gather) {
        add_setting(html, "denoiser");
        lx_html_text(html, b->denoise);
        lx_builder_add(html, end);
    }
    add_setting(html, "bounces");
    if (b->bounces == LX_BOUNCES_INF)
        lx_builder_add(html, "∞");
    else
        lx_builder_format(html, "%u", b->bounces);
    lx_builder_add(html, end);
    add_setting(html, "light");
    lx_builder_format(html, "%s%s%s", desc->direct_only ? "direct only" : desc->indirect_only ? "bounced only" : "direct and bounced",
                      desc->transport.coloured_shadows ? ", coloured shadows" : "", end);
    add_setting(html, "seed");
    lx_builder_format(html, "%u%s", b->seed, end);
    if (report->manifest->has_sky) {
        add_setting(html, "sky");
        lx_html_text(html, report->manifest->sky.file);
        lx_builder_add(html, end);
    }
    add_setting(html, "texels between charts");
    lx_builder_format(html, "%u%s", report->manifest->padding, end);
    if (report->manifest->has_view) {
        add_setting(html, "exposure of the picture");
        lx_builder_add(html, report->manifest->view_ev < 0 ? "−" : "+");
        lx_builder_number(html, fabs((double)report->manifest->view_ev), 2);
        lx_builder_format(html, "&nbsp;EV%s", end);
    }
    add_setting(html, "machine");
    lx_html_text(html, b->isa);
    lx_builder_format(html, ", %u thread%s%s", b->threads, plural(b->threads), end);
    lx_builder_add(html, "</table></section>\n");
}

lx_result lx_report_build(const lx_report *report, lx_builder *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_builder html = {0};
    add_head(report, &html);
    LX_TRY(add_preview(report, &html, error));
    add_key_figures(report, &html);
    add_warnings(report, &html);
    LX_TRY(add_layers(report, &html, error));
    LX_TRY(add_atlas(report, &html, error));
    lx_builder_add(&html, "<div class=\"two\">\n");
    add_memory(report, &html);
    LX_TRY(add_disk(report, &html, error));
    add_stages(report, &html);
    add_settings(report, &html);
    lx_builder_add(&html, "</div>\n<footer>Change the lights: <code>luxel view</code>. The lit result is the sum of layers times colours; nothing has to "
                          "be baked again.</footer>\n</main></body></html>\n");
    if (html.failed) {
        result = lx_fail_memory(error, "report.html");
        goto cleanup;
    }
    *out = html;
    html = (lx_builder){0};
cleanup:
    lx_builder_release(&html);
    return result;
}
