# The script of the report page: three.js and vdbgeo/view/page/src in one file that needs no network. npm fetches
# three.js and esbuild into the build folder when CMake configures, and only when package-lock.json has changed.
# Without npm, or without its registry, the report has no viewer that turns and all else is built as ever.
#
# Sets VDBGEO_PAGE_FOUND, VDBGEO_PAGE_FOLDER (node_modules is there), VDBGEO_NODE and VDBGEO_THREE_VERSION.
set(VDBGEO_PAGE_SOURCE ${PROJECT_SOURCE_DIR}/vdbgeo/view/page)
set(VDBGEO_PAGE_FOLDER ${PROJECT_BINARY_DIR}/page)
set(VDBGEO_PAGE_FOUND OFF)
set(VDBGEO_THREE_VERSION off)

# Fills VDBGEO_PAGE_FOLDER/node_modules; `result` gets what went wrong, or nothing.
function(vdbgeo_fetch_page_modules result)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${VDBGEO_PAGE_SOURCE}/package-lock.json)
  set(${result} "" PARENT_SCOPE)
  set(omit)
  if(NOT VDBGEO_BUILD_TESTS)
    set(omit --omit=dev)  # playwright-core drives a browser in the tests
  endif()
  file(SHA256 ${VDBGEO_PAGE_SOURCE}/package-lock.json wanted)
  string(APPEND wanted "${omit}")
  set(stamp ${VDBGEO_PAGE_FOLDER}/installed.txt)
  if(EXISTS ${stamp})
    file(READ ${stamp} installed)
    if(installed STREQUAL wanted)
      return()
    endif()
  endif()
  file(REMOVE ${stamp})
  file(MAKE_DIRECTORY ${VDBGEO_PAGE_FOLDER})
  foreach(name package.json package-lock.json)
    configure_file(${VDBGEO_PAGE_SOURCE}/${name} ${VDBGEO_PAGE_FOLDER}/${name} COPYONLY)
  endforeach()
  message(STATUS "Fetching three.js and esbuild for the report page")
  execute_process(
    COMMAND ${VDBGEO_NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline ${omit}
            --fetch-retries=2 --fetch-retry-mintimeout=1000 --fetch-retry-maxtimeout=5000 --fetch-timeout=30000
    WORKING_DIRECTORY ${VDBGEO_PAGE_FOLDER} TIMEOUT 180
    RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status STREQUAL 0)
    string(REGEX MATCH "(npm ERR!|npm error) [^\n]*" line "${output}")
    set(${result} "npm ci: ${status}. ${line}" PARENT_SCOPE)
    return()
  endif()
  execute_process(COMMAND ${VDBGEO_NODE} node_modules/esbuild/bin/esbuild --version
    WORKING_DIRECTORY ${VDBGEO_PAGE_FOLDER} TIMEOUT 60 RESULT_VARIABLE status OUTPUT_QUIET ERROR_VARIABLE output)
  if(NOT status STREQUAL 0)
    set(${result} "esbuild does not run here: ${output}" PARENT_SCOPE)
    return()
  endif()
  file(WRITE ${stamp} "${wanted}")
endfunction()

if(VDBGEO_WITH_PAGE)
  set(VDBGEO_THREE_VERSION "not found")
  find_program(VDBGEO_NPM npm)
  find_program(VDBGEO_NODE NAMES node nodejs)
  mark_as_advanced(VDBGEO_NPM VDBGEO_NODE)
  set(_problem "npm and node are not installed")
  if(VDBGEO_NPM AND VDBGEO_NODE)
    vdbgeo_fetch_page_modules(_problem)
  endif()
  if(_problem)
    message(WARNING "The report page will have no viewer: ${_problem}")
  else()
    set(VDBGEO_PAGE_FOUND ON)
    file(READ ${VDBGEO_PAGE_FOLDER}/node_modules/three/package.json _package)
    string(JSON VDBGEO_THREE_VERSION GET "${_package}" version)
  endif()
endif()

# vdbgeo_add_page(TARGET): the bundle and the style sheet become a source of the target (view/page_assets.h).
function(vdbgeo_add_page target)
  set(script)
  if(VDBGEO_PAGE_FOUND)
    set(script ${VDBGEO_PAGE_FOLDER}/page.js)
    file(GLOB sources CONFIGURE_DEPENDS ${VDBGEO_PAGE_SOURCE}/src/*.js)
    add_custom_command(OUTPUT ${script}
      COMMAND ${CMAKE_COMMAND} -E env NODE_PATH=${VDBGEO_PAGE_FOLDER}/node_modules
              ${VDBGEO_NODE} ${VDBGEO_PAGE_FOLDER}/node_modules/esbuild/bin/esbuild ${VDBGEO_PAGE_SOURCE}/src/main.js
              --bundle --minify --format=iife --target=es2022 --charset=ascii --legal-comments=eof
              --log-level=warning --outfile=${script}
      DEPENDS ${sources} ${VDBGEO_PAGE_FOLDER}/installed.txt
      COMMENT "Bundling the script of the report page" VERBATIM)
  endif()
  set(assets ${PROJECT_BINARY_DIR}/generated/view/page_assets.cpp)
  add_custom_command(OUTPUT ${assets}
    COMMAND ${CMAKE_COMMAND} -DSCRIPT=${script} -DSTYLE=${VDBGEO_PAGE_SOURCE}/page.css -DOUTPUT=${assets}
            -P ${PROJECT_SOURCE_DIR}/cmake/VdbgeoPageAssets.cmake
    DEPENDS ${script} ${VDBGEO_PAGE_SOURCE}/page.css ${PROJECT_SOURCE_DIR}/cmake/VdbgeoPageAssets.cmake
    COMMENT "Report page into C++" VERBATIM)
  add_custom_target(vdbgeo_page DEPENDS ${script} ${assets})
  add_dependencies(${target} vdbgeo_page)
  target_sources(${target} PRIVATE ${assets})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
endfunction()
