#pragma once

// The senders that a J1939 parameter group came from, for a message of one identifier that never
// came: most likely its DBC file forgets to say that it is J1939, or another unit was built in.

#include <cstdint>
#include <set>
#include <string>

namespace vgyro::cli {

class OtherSenders {
 public:
  /// A frame's identifier; kept when it has the message's group and another sender. Both of 29
  /// bits.
  void add(std::uint32_t message_id, std::uint32_t frame_id);
  [[nodiscard]] bool empty() const { return addresses_.empty(); }
  /// "no frame 18F02A01 came (TURN_LEFT), but the same PGN came from 0x13"
  [[nodiscard]] std::string text(const std::string& message, std::uint32_t message_id) const;
  /// `mask` as the message is compared with: by PGN with a source address, or by all bits.
  [[nodiscard]] std::string remedy(std::uint32_t mask) const;

 private:
  std::set<std::uint32_t> addresses_;
};

}  // namespace vgyro::cli
