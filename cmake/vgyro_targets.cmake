# One place for flags, so that a layer's CMakeLists.txt says only what it is made of.

# Assertions stay on in a release: a bug must stop the daemon, not publish a rate.
set(CMAKE_CXX_FLAGS_RELEASE "-O2")
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g")
if(VGYRO_SANITIZE)
  # GCC takes minutes to optimise and describe what the sanitizers make of Eigen; lines are enough.
  set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1")
endif()

add_library(vgyro_flags INTERFACE)
target_include_directories(vgyro_flags INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(vgyro_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Werror
  # A fused multiply-add rounds differently from machine to machine: same input, same bytes out.
  -ffp-contract=off
  # Nobody reads errno after mathematics; without it rounding is one instruction.
  -fno-math-errno)
if(VGYRO_SANITIZE)
  target_compile_options(vgyro_flags INTERFACE -fsanitize=${VGYRO_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(vgyro_flags INTERFACE -fsanitize=${VGYRO_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # With a sanitizer GCC 12 warns of uninitialised use inside std::optional and std::regex where there is none.
    target_compile_options(vgyro_flags INTERFACE -Wno-maybe-uninitialized)
  endif()
endif()
if(VGYRO_FUZZERS)
  target_compile_options(vgyro_flags INTERFACE -fsanitize=fuzzer-no-link)
endif()

# A frame crosses every layer in some tens of nanoseconds: the programs of a release are optimised
# across them. Tests link the same objects' ordinary code.
if(CMAKE_BUILD_TYPE STREQUAL "Release" AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  set(VGYRO_WHOLE_PROGRAM ON)
endif()
function(vgyro_whole_program target)
  if(VGYRO_WHOLE_PROGRAM)
    # Resolved at the start and read-only from then on: nothing overwrites where a call goes.
    target_link_options(${target} PRIVATE -flto=auto -Wno-stringop-overflow -Wl,-z,relro,-z,now)
  endif()
endfunction()

# vgyro_layer(NAME SOURCES ... LINKS ...): a static library vgyro_NAME.
function(vgyro_layer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_library(vgyro_${name} STATIC ${ARG_SOURCES})
  target_link_libraries(vgyro_${name} PUBLIC vgyro_flags ${ARG_LINKS})
  if(VGYRO_WHOLE_PROGRAM)
    target_compile_options(vgyro_${name} PRIVATE -flto=auto -ffat-lto-objects)
  endif()
endfunction()
