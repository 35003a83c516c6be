#pragma once

// A CAN frame, classic or FD, as it is on the bus: no interface, no time, no meaning.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace vgyro::can {

inline constexpr std::uint32_t kStandardIdMax = 0x7FF;
inline constexpr std::uint32_t kExtendedIdMax = 0x1FFFFFFF;
inline constexpr std::size_t kClassicBytesMax = 8;
inline constexpr std::size_t kFdBytesMax = 64;

enum FrameFlag : std::uint8_t {
  kExtended = 1U << 0U,
  kRemote = 1U << 1U,
  kError = 1U << 2U,
  kFd = 1U << 3U,
  kBitRateSwitch = 1U << 4U,       ///< FD only
  kErrorStateIndicator = 1U << 5U  ///< FD only
};

struct Frame {
  std::uint32_t id = 0;      ///< identifier without flags, 11 or 29 bits (29 for error frames)
  std::uint8_t flags = 0;    ///< FrameFlag
  std::uint8_t length = 0;   ///< payload bytes; in a remote frame, the bytes requested
  std::uint8_t raw_dlc = 0;  ///< 9…15 if a classic frame's DLC exceeds its 8 bytes
  std::array<std::uint8_t, kFdBytesMax> data{};  ///< bytes beyond `length` have no meaning

  [[nodiscard]] bool has(FrameFlag flag) const { return (flags & flag) != 0; }
  /// Carries a payload: neither remote nor error.
  [[nodiscard]] bool is_data() const { return (flags & (kRemote | kError)) == 0; }
  [[nodiscard]] std::span<const std::uint8_t> payload() const { return {data.data(), length}; }

  friend bool operator==(const Frame& a, const Frame& b);
};

bool operator==(const Frame& a, const Frame& b);

/// Index of an interface in a driver's own list of names.
using BusIndex = std::uint8_t;

/// The smallest FD payload size that holds `bytes` (0…8, 12, 16, 20, 24, 32, 48, 64).
std::size_t fd_padded_length(std::size_t bytes);

}  // namespace vgyro::can
