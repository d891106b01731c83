# cmake -DSCRIPT=page.js -DSTYLE=page.css -DOUTPUT=page_assets.cpp -P VdbgeoPageAssets.cmake
# The report page's script (may be empty: none) and style as the strings that view/page_assets.h promises.
function(read_asset path forbidden result)
  file(READ "${path}" text)
  foreach(word IN LISTS forbidden)
    string(FIND "${text}" "${word}" at)
    if(NOT at EQUAL -1)
      message(FATAL_ERROR "${path} has \"${word}\" in it, which would end its element in the page")
    endif()
  endforeach()
  string(FIND "${text}" ")vdbgeo\"" at)
  if(NOT at EQUAL -1)
    message(FATAL_ERROR "${path} has the end of a raw string in it")
  endif()
  set(${result} "${text}" PARENT_SCOPE)
endfunction()

set(script)
if(SCRIPT)
  read_asset("${SCRIPT}" "</script;<!--" script)
endif()
read_asset("${STYLE}" "</style" style)
file(WRITE "${OUTPUT}"
"// The report page's script and style. Written by cmake/VdbgeoPageAssets.cmake.
#include \"vdbgeo/view/page_assets.h\"

#pragma GCC diagnostic ignored \"-Woverlength-strings\"

namespace vdbgeo {
namespace {
constexpr char script_text[] = R\"vdbgeo(${script})vdbgeo\";
constexpr char style_text[] = R\"vdbgeo(${style})vdbgeo\";
}  // namespace

bool have_page() { return sizeof(script_text) > 1; }
std::string_view page_script() { return {script_text, sizeof(script_text) - 1}; }
std::string_view page_style() { return {style_text, sizeof(style_text) - 1}; }

}  // namespace vdbgeo
")
