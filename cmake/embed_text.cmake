# vgyro_embed_text(TARGET NAMESPACE NAME=FILE...): embeds files in the program, as string_views NAME in a
# header "TARGET_text.h". A changed file is embedded again.
function(vgyro_embed_text target namespace)
  set(header "#pragma once\n#include <string_view>\nnamespace ${namespace} {\n")
  set(body "#include \"${target}_text.h\"\nnamespace ${namespace} {\n")
  foreach(pair IN LISTS ARGN)
    string(REGEX MATCH "^([a-z_]+)=(.*)$" matched "${pair}")
    set(name ${CMAKE_MATCH_1})
    get_filename_component(file "${CMAKE_MATCH_2}" ABSOLUTE)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
    # Bytes are written as hexadecimal numbers, which need no escaping.
    file(READ "${file}" bytes HEX)
    string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
    string(APPEND header "extern const std::string_view ${name};\n")
    string(APPEND body "static constexpr unsigned char bytes_of_${name}[] = {\n${bytes}};\n"
      "const std::string_view ${name}(reinterpret_cast<const char*>(bytes_of_${name}), sizeof(bytes_of_${name}));\n")
  endforeach()
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/embedded")
  file(CONFIGURE OUTPUT "${folder}/${target}_text.h" CONTENT "${header}}\n" @ONLY)
  file(CONFIGURE OUTPUT "${folder}/${target}_text.cpp" CONTENT "${body}}\n" @ONLY)
  add_library(${target} STATIC "${folder}/${target}_text.cpp")
  target_include_directories(${target} SYSTEM PUBLIC "${folder}")
endfunction()
