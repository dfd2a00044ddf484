/// Text of others in HTML.
#ifndef LX_API_HTML_H
#define LX_API_HTML_H

#include "base/builder.h"

/// Adds text so that HTML shows it as it is, between tags and in quoted attributes. Names in files may hold anything: bytes that are no
/// UTF-8, control characters and those that turn the direction of writing become U+FFFD.
void lx_html_text(lx_builder *html, const char *text);

#endif
