#pragma once

// pcap: what tcpdump and Wireshark write of CAN interfaces, stamps in microseconds or nanoseconds,
// in either byte order. A file holds one interface, which has no name in it: it is "can0".

#include <memory>

#include "canlog/packet_reader.h"

namespace vgyro::canlog {

bool is_pcap(std::string_view head);

class PcapReader final : public PacketReader {
 public:
  /// Error where the file holds packets of another kind than CAN's.
  static Expected<std::unique_ptr<LogReader>> open(std::unique_ptr<ByteSource> bytes);

  bool next(LogRecord& record) override;

 private:
  PcapReader(std::unique_ptr<ByteWindow> bytes, std::endian order, std::int64_t fraction_ns)
      : PacketReader(std::move(bytes)), order_(order), fraction_ns_(fraction_ns) {}

  std::endian order_;
  std::int64_t fraction_ns_;  ///< what a fraction of a second is counted in
  Interface interface_;
  bool ended_ = false;
};

}  // namespace vgyro::canlog
