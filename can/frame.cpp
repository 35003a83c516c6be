#include "can/frame.h"

#include <algorithm>

namespace vgyro::can {

bool operator==(const Frame& a, const Frame& b) {
  if (a.id != b.id || a.flags != b.flags || a.length != b.length || a.raw_dlc != b.raw_dlc) {
    return false;
  }
  return a.has(kRemote) || std::equal(a.payload().begin(), a.payload().end(), b.payload().begin());
}

std::size_t fd_padded_length(std::size_t bytes) {
  constexpr std::array<std::size_t, 8> kSizes{8, 12, 16, 20, 24, 32, 48, 64};
  if (bytes <= kClassicBytesMax) return bytes;
  return *std::find_if(kSizes.begin(), kSizes.end() - 1, [&](std::size_t s) { return s >= bytes; });
}

}  // namespace vgyro::can
