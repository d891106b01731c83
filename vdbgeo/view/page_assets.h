// The script and the style of the report page, bundled when vdbgeo is built.
#pragma once

#include <string_view>

namespace vdbgeo {

/// Whether this build has the script, which needs npm when it is built.
bool have_page();

/// The script of the page with the library that it draws with; empty where there is none.
std::string_view page_script();

/// The page's style sheet; always there.
std::string_view page_style();

}  // namespace vdbgeo
