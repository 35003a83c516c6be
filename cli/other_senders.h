#pragma once

// The senders of a J1939 parameter group, for a message whose own identifier never came: most
// likely its DBC file does not mark it as J1939, or another unit was built in.

#include <cstdint>
#include <set>
#include <string>

namespace vgyro::cli {

class OtherSenders {
 public:
  /// Keeps the frame's sender if it has the message's group and a different sender. Both
  /// identifiers have 29 bits.
  void add(std::uint32_t message_id, std::uint32_t frame_id);
  [[nodiscard]] bool empty() const { return addresses_.empty(); }
  /// "no frame 18F02A01 came (TURN_LEFT), but the same PGN came from 0x13"
  [[nodiscard]] std::string text(const std::string& message, std::uint32_t message_id) const;
  /// `mask`: the bits by which the message is compared: PGN and source address, or all.
  [[nodiscard]] std::string remedy(std::uint32_t mask) const;

 private:
  std::set<std::uint32_t> addresses_;
};

}  // namespace vgyro::cli
