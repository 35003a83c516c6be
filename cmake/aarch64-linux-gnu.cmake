# Builds for ARM64 on another machine, with Debian's cross compiler (g++-aarch64-linux-gnu) and the libraries of a Debian for ARM64
# that scripts/arm64 unpacks into a folder. Without that folder the libraries are those of a multiarch system.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

get_filename_component(VGYRO_SYSROOT "${CMAKE_CURRENT_LIST_DIR}/../build/arm64-sysroot" ABSOLUTE)
if(EXISTS "${VGYRO_SYSROOT}/usr")
  set(CMAKE_SYSROOT "${VGYRO_SYSROOT}")
  set(CMAKE_FIND_ROOT_PATH "${VGYRO_SYSROOT}")
  set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
  set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
  set(ENV{PKG_CONFIG_SYSROOT_DIR} "${VGYRO_SYSROOT}")
else()
  set(VGYRO_SYSROOT "")
endif()
# pkg-config must not find the libraries of this machine.
set(ENV{PKG_CONFIG_LIBDIR} "${VGYRO_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${VGYRO_SYSROOT}/usr/share/pkgconfig")
