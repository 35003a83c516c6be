#pragma once

// pcap, which tcpdump and Wireshark write for CAN interfaces, with stamps in microseconds or
// nanoseconds, in either byte order. A file holds one interface without a name: it is "can0".

#include <memory>

#include "canlog/packet_reader.h"

namespace vgyro::canlog {

bool is_pcap(std::string_view head);

class PcapReader final : public PacketReader {
 public:
  /// Error if the file holds packets of another kind than CAN.
  static Expected<std::unique_ptr<LogReader>> open(std::unique_ptr<ByteSource> bytes);

  bool next(LogRecord& record) override;

 private:
  PcapReader(std::unique_ptr<ByteWindow> bytes, std::endian order, std::int64_t fraction_ns)
      : PacketReader(std::move(bytes)), order_(order), fraction_ns_(fraction_ns) {}

  std::endian order_;
  std::int64_t fraction_ns_;  ///< unit of the fraction of a second
  Interface interface_;
  bool ended_ = false;
};

}  // namespace vgyro::canlog
