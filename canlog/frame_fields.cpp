#include "canlog/frame_fields.h"

#include <algorithm>
#include <array>

namespace vgyro::canlog {

namespace {

// Indexed by the length code of CAN FD.
constexpr std::array<std::uint8_t, 16> kFdLengths{0, 1,  2,  3,  4,  5,  6,  7,
                                                  8, 12, 16, 20, 24, 32, 48, 64};

}  // namespace

const char* set_length(unsigned bytes, can::Frame& frame) {
  if (bytes > (frame.has(can::kFd) ? can::kFdBytesMax : can::kClassicBytesMax)) {
    return "length: more bytes than the frame can hold";
  }
  frame.length = static_cast<std::uint8_t>(bytes);
  return nullptr;
}

const char* set_dlc(unsigned dlc, can::Frame& frame) {
  if (dlc >= kFdLengths.size()) return "length code: above 15";
  if (frame.has(can::kFd)) {
    frame.length = kFdLengths[dlc];
  } else {
    frame.length = static_cast<std::uint8_t>(std::min<std::size_t>(dlc, can::kClassicBytesMax));
    if (dlc > can::kClassicBytesMax) frame.raw_dlc = static_cast<std::uint8_t>(dlc);
  }
  return nullptr;
}

void set_error_frame(can::Frame& frame) {
  constexpr std::uint32_t kBusError = 0x80;  // linux/can/error.h
  constexpr std::uint8_t kErrorBytes = 8;
  frame = {};
  frame.id = kBusError;
  frame.flags = can::kError;
  frame.length = kErrorBytes;
}

unsigned dlc_of(std::size_t bytes) {
  const auto* const found = std::lower_bound(kFdLengths.begin(), kFdLengths.end(), bytes);
  return static_cast<unsigned>(found - kFdLengths.begin());
}

const char* set_id(std::uint32_t id, bool extended, can::Frame& frame) {
  if (id > (extended ? can::kExtendedIdMax : can::kStandardIdMax)) {
    return "identifier: larger than its kind can be";
  }
  frame.id = id;
  if (extended) frame.flags |= can::kExtended;
  return nullptr;
}

}  // namespace vgyro::canlog
