# vdbgeo_target(NAME): the warnings and the sanitizers of this project, for its own targets only.
function(vdbgeo_target name)
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wold-style-cast
                         -Wcast-qual -Woverloaded-virtual $<$<BOOL:${VDBGEO_WERROR}>:-Werror>)
endfunction()

if(VDBGEO_SANITIZE)
  add_compile_options(-fsanitize=${VDBGEO_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${VDBGEO_SANITIZE})
endif()
