#pragma once

// A captured packet → the CAN frame in it: packets of CAN interfaces, and of Linux's "any"
// interface in both of its cooked forms. No file and no stamp is known here.

#include <bit>
#include <cstdint>
#include <optional>
#include <string_view>

#include "canlog/record.h"

namespace vgyro::canlog {

/// The link types that may hold CAN frames.
enum LinkType : std::uint32_t {
  kLinkLinuxCooked = 113,
  kLinkSocketCan = 227,
  kLinkWiresharkExport = 252,
  kLinkLinuxCooked2 = 276
};
bool may_hold_can(std::uint32_t link);

struct Packet {
  std::uint32_t link = 0;
  std::string_view bytes;  ///< what was captured, or as much of it as any CAN frame has
  /// Of the machine that captured: the order of its file. Cooked packets have their identifiers in
  /// it, those of CAN interfaces do not.
  std::endian host = std::endian::little;
};
/// A packet's head, frame and payload are never longer than this.
inline constexpr std::size_t kPacketBytesMax = 256 + kXlBytesMax;

struct PacketResult {
  enum class Kind : std::uint8_t { kFrame, kXl, kOther, kMalformed };
  Kind kind = Kind::kOther;
  const char* why = "";                    ///< of a malformed one
  std::optional<std::uint32_t> interface;  ///< the kernel's number of it, where the packet has it
};
/// Fills in `record` but for stamp and bus; or `xl`.
PacketResult read_packet(const Packet& packet, LogRecord& record, XlFrame& xl);

}  // namespace vgyro::canlog
