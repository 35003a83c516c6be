# One place for flags, so that a layer's CMakeLists.txt lists only its parts.

# Assertions stay on in a release: a bug must stop the daemon, not publish a rate.
set(CMAKE_CXX_FLAGS_RELEASE "-O2")
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g")
if(VGYRO_SANITIZE)
  # GCC takes minutes to optimise sanitized Eigen code and to write its debug information; line numbers are
  # enough.
  set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1")
endif()

add_library(vgyro_flags INTERFACE)
target_include_directories(vgyro_flags INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(vgyro_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Werror
  # Same input, same bytes out: a fused multiply-add would round differently on some machines.
  -ffp-contract=off
  # No code reads errno after mathematics; without it, rounding is one instruction.
  -fno-math-errno)
if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|i.86)$")
  # Elsewhere a char may have no sign, and a byte beyond ASCII would be another number.
  target_compile_options(vgyro_flags INTERFACE -fsigned-char)
endif()
if(CMAKE_BUILD_TYPE STREQUAL "Release")
  # A frame on the bus can hold anything: if a bug lets it overwrite memory, these checks stop the program.
  target_compile_options(vgyro_flags INTERFACE -fstack-protector-strong -D_FORTIFY_SOURCE=2)
  # Stops a stack that grows past its guard page, and calls and returns to manipulated addresses.
  include(CheckCXXCompilerFlag)
  foreach(guard stack-clash-protection cf-protection=full)
    string(MAKE_C_IDENTIFIER "VGYRO_HAS_${guard}" known)
    check_cxx_compiler_flag(-f${guard} ${known})
    if(${known})
      target_compile_options(vgyro_flags INTERFACE -f${guard})
    endif()
  endforeach()
  # Assertions show paths within the project, not the folder of the build.
  target_compile_options(vgyro_flags INTERFACE -ffile-prefix-map=${PROJECT_SOURCE_DIR}=.)
endif()
if(VGYRO_SANITIZE)
  target_compile_options(vgyro_flags INTERFACE -fsanitize=${VGYRO_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(vgyro_flags INTERFACE -fsanitize=${VGYRO_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # With a sanitizer, GCC 12 gives false warnings of uninitialised use inside std::optional and std::regex.
    target_compile_options(vgyro_flags INTERFACE -Wno-maybe-uninitialized)
  endif()
endif()
if(VGYRO_FUZZERS)
  target_compile_options(vgyro_flags INTERFACE -fsanitize=fuzzer-no-link)
endif()

# A frame crosses every layer in some tens of nanoseconds, so in a release the sources on its way, a layer's
# FRAME_PATH, are optimised across layers. Tests link the ordinary code of the same objects.
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  set(VGYRO_WHOLE_PROGRAM ON)
endif()
function(vgyro_whole_program target)
  if(VGYRO_WHOLE_PROGRAM)
    # Symbols are resolved at the start and then read-only, so that no call can be redirected.
    target_link_options(${target} PRIVATE -flto=auto -Wno-stringop-overflow -Wl,-z,relro,-z,now)
  endif()
endfunction()

# Precompiles third-party headers that many sources include: the STL here, and with it Eigen, JSON or
# GoogleTest. A source still includes what it uses; CMAKE_DISABLE_PRECOMPILE_HEADERS, which the debug preset
# sets, shows missing includes.
function(vgyro_precompiled name)
  add_library(vgyro_${name}_pch OBJECT ${PROJECT_SOURCE_DIR}/cmake/precompiled.cpp)
  target_link_libraries(vgyro_${name}_pch PRIVATE vgyro_flags fmt::fmt)
  target_precompile_headers(vgyro_${name}_pch PRIVATE <algorithm> <array> <cmath> <cstdint> <functional> <limits> <map> <memory>
    <optional> <span> <string> <string_view> <utility> <vector> <fmt/format.h> <tl/expected.hpp> ${ARGN})
endfunction()
vgyro_precompiled(stl)
vgyro_precompiled(eigen <Eigen/Dense> <unsupported/Eigen/FFT>)
target_link_libraries(vgyro_eigen_pch PRIVATE Eigen3::Eigen)
vgyro_precompiled(json <nlohmann/json.hpp>)
target_link_libraries(vgyro_json_pch PRIVATE nlohmann_json::nlohmann_json)

# vgyro_layer(NAME SOURCES ... FRAME_PATH ... LINKS ... PRECOMPILED stl|eigen|json): a static library vgyro_NAME.
function(vgyro_layer name)
  cmake_parse_arguments(ARG "" "PRECOMPILED" "SOURCES;FRAME_PATH;LINKS" ${ARGN})
  add_library(vgyro_${name} STATIC ${ARG_SOURCES} ${ARG_FRAME_PATH})
  target_link_libraries(vgyro_${name} PUBLIC vgyro_flags ${ARG_LINKS})
  if(NOT ARG_PRECOMPILED)
    set(ARG_PRECOMPILED stl)
  endif()
  target_precompile_headers(vgyro_${name} REUSE_FROM vgyro_${ARG_PRECOMPILED}_pch)
  if(VGYRO_WHOLE_PROGRAM)
    set_property(SOURCE ${ARG_FRAME_PATH} APPEND PROPERTY COMPILE_OPTIONS -flto=auto -ffat-lto-objects)
  endif()
endfunction()
