# Shared by ./run and ./test: installing missing packages, building, progress messages.

BUILD_PACKAGES=(g++ cmake ninja-build pkg-config libeigen3-dev libfmt-dev libcli11-dev
  libtomlplusplus-dev libexpected-dev nlohmann-json3-dev liblzma-dev libsystemd-dev libnlopt-cxx-dev
  zlib1g-dev libzstd-dev libbz2-dev libsimdjson-dev nettle-dev libjs-dygraphs)
PACKAGE_PACKAGES=(debhelper scdoc python3)
RUN_PACKAGES=(gnuplot-nox fonts-dejavu-core can-utils iproute2 util-linux xz-utils)
TEST_PACKAGES=(libgtest-dev libbenchmark-dev clang-format git python3 python3-numpy python3-can
  python3-yaml python3-canmatrix python3-distributed user-mode-linux kmod dbus lintian man-db systemd mmdebstrap uidmap genext2fs e2fsprogs)
FUZZ_PACKAGES=(clang libclang-rt-14-dev)
TIDY_PACKAGES=(clang-tidy)
ARM64_PACKAGES=(g++-aarch64-linux-gnu qemu-user mmdebstrap binutils)

LAYERS=(base can canlog dbc model simulation fusion analysis gap fleet gateway daemon cli)

# clang-tidy uses the commands of the debug preset, because clang cannot read the precompiled headers of
# another compiler.
configure_tidy() {
  mkdir -p build
  cmake --preset debug >build/debug.log 2>&1 || { cat build/debug.log; die "the configuration of debug failed"; }
}

say() { printf '\n== %s\n' "$*"; }
die() { printf 'error: %s\n' "$*" >&2; exit 1; }

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"
  elif command -v sudo >/dev/null; then sudo "$@"
  else die "packages are missing ($*) and this is neither root nor a user with sudo"
  fi
}

# install_missing PACKAGE...
install_missing() {
  local missing=() package
  for package in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
  done
  [ ${#missing[@]} = 0 ] && return
  say "installing ${missing[*]}"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null 2>&1 && return
  # A fresh machine's package lists are empty or old.
  as_root apt-get update -qq
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

# build PRESET [CMAKE-OPTION...]
build() {
  local preset=$1 log; shift
  log=build/$preset.log
  mkdir -p build
  say "building $preset"
  cmake --preset "$preset" "$@" >"$log" 2>&1 || { cat "$log"; die "the configuration of $preset failed"; }
  if [ -t 1 ]; then
    cmake --build --preset "$preset"
  else
    cmake --build --preset "$preset" >>"$log" 2>&1 || { tail -n 60 "$log"; die "the build of $preset failed"; }
  fi
}
