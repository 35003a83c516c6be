#pragma once

// pcapng, which Wireshark, tshark and dumpcap write for one or several interfaces, which may have
// names; also several files in sequence. dumpcap writes the packets of several interfaces some
// tenths of a second out of order: they are returned by stamp. Blocks of other kinds are skipped.

#include <memory>
#include <vector>

#include "canlog/packet_reader.h"
#include "canlog/stamp_order.h"

namespace vgyro::canlog {

bool is_pcapng(std::string_view head);

class PcapngReader final : public PacketReader {
 public:
  static Expected<std::unique_ptr<LogReader>> open(std::unique_ptr<ByteSource> bytes);

  bool next(LogRecord& record) override;

 private:
  explicit PcapngReader(std::unique_ptr<ByteWindow> bytes) : PacketReader(std::move(bytes)) {}

  struct Clock {
    unsigned exponent = 6;  ///< unit of the stamps: 10^-exponent or 2^-exponent seconds
    bool is_binary = false;
    std::int64_t offset_s = 0;
    /// Nothing if it does not fit.
    [[nodiscard]] std::optional<std::int64_t> to_ns(std::uint64_t count) const;
  };
  struct Described {
    Interface interface;
    Clock clock;
  };
  struct Block {
    std::uint32_t type = 0;
    std::uint32_t bytes = 0;   ///< size of the whole block
    std::string_view content;  ///< without head and tail, as much as is examined
  };

  bool read(LogRecord& record);
  std::optional<Block> next_block();
  bool begin_section(std::string_view head);
  void describe_interface(const Block& block);
  bool read_packet_block(const Block& block, LogRecord& record);

  std::endian order_ = std::endian::little;
  std::vector<Described> interfaces_;
  bool has_several_ = false;  ///< several interfaces in some section
  // dumpcap is a fifth of a second late; a reader of a live capture waits as long.
  static constexpr std::int64_t kLateMax_ns = 1'000'000'000;
  StampOrder by_stamp_{kLateMax_ns};  ///< used if has_several_
  bool ended_ = false;
};

}  // namespace vgyro::canlog
