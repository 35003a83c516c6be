#pragma once

// Shared by the readers of captures: packets of CAN interfaces become records, others are counted.

#include <memory>
#include <string>
#include <vector>

#include "canlog/binary_reader.h"
#include "canlog/byte_window.h"
#include "canlog/socketcan_packet.h"

namespace vgyro::canlog {

class PacketReader : public BinaryReader {
 public:
  [[nodiscard]] std::uint64_t bytes_read() const final { return bytes_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const final { return bytes_->bytes_total(); }
  void before_wait(std::function<void()> callback) final {
    bytes_->before_wait(std::move(callback));
  }
  [[nodiscard]] const XlFrame* xl_frame() const final { return &xl_; }

 protected:
  explicit PacketReader(std::unique_ptr<ByteWindow> bytes)
      : BinaryReader("packet"), bytes_(std::move(bytes)) {}

  /// Where a packet was captured.
  struct Interface {
    std::uint32_t link = 0;
    std::string name;     ///< empty: unknown
    unsigned number = 0;  ///< from 0 on; without a name the interface is "canN"
    std::optional<can::BusIndex> bus;
  };
  /// Counts the packet; true if `record` now holds a frame, except for its stamp and direction.
  bool take_packet(const Packet& packet, Interface& interface, LogRecord& record);
  /// The log ends inside a packet, or cannot be read further.
  void end_inside();
  /// The rest cannot be read, because the file is damaged here.
  void end_damaged(const char* what);

  ByteWindow& bytes() { return *bytes_; }

  XlFrame xl_;

 private:
  bool set_interface(const PacketResult& result, Interface& interface, LogRecord& record);

  std::unique_ptr<ByteWindow> bytes_;
  /// For cooked captures: the kernel's interface numbers, in order of appearance.
  std::vector<std::uint32_t> kernel_interfaces_;
};

}  // namespace vgyro::canlog
