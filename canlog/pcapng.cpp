#include "canlog/pcapng.h"

#include <algorithm>

#include "canlog/byte_order.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

constexpr std::uint32_t kSection = 0x0A0D0D0A;  // reads the same in both byte orders
constexpr std::uint32_t kInterface = 1;
constexpr std::uint32_t kOldPacket = 2;
constexpr std::uint32_t kSimplePacket = 3;
constexpr std::uint32_t kPacket = 6;
constexpr std::uint32_t kOrderMagic = 0x1A2B3C4D;

constexpr std::size_t kBlockHeadBytes = 8;  // type, size
constexpr std::size_t kBlockTailBytes = 4;  // size again
constexpr std::size_t kSectionHeadBytes = 12;
constexpr std::size_t kPacketHeadBytes = 20;  // interface, stamp, two sizes

// More than any packet with its options has; the rest is not examined.
constexpr std::size_t kShownBytes = 65'536;
// A section with more is damaged, or made to exhaust memory.
constexpr std::size_t kInterfacesMax = 1'024;

constexpr std::uint16_t kOptionName = 2;
constexpr std::uint16_t kOptionFlags = 2;  // of a packet
constexpr std::uint16_t kOptionResolution = 9;
constexpr std::uint16_t kOptionOffset = 14;

constexpr std::size_t padded(std::size_t size) {
  return (size + 3) / 4 * 4;
}

/// The options of a block in sequence.
class Options {
 public:
  Options(std::string_view bytes, std::endian order) : rest_(bytes), order_(order) {}
  struct Option {
    std::uint16_t code;
    std::string_view value;
  };
  std::optional<Option> next() {
    constexpr std::size_t kHeadBytes = 4;
    if (rest_.size() < kHeadBytes) return std::nullopt;
    const auto code = load<std::uint16_t>(rest_.data(), order_);
    const std::size_t size = load<std::uint16_t>(&rest_[2], order_);
    if (code == 0 || rest_.size() - kHeadBytes < size) return std::nullopt;
    const std::string_view value = rest_.substr(kHeadBytes, size);
    rest_.remove_prefix(std::min(rest_.size(), kHeadBytes + padded(size)));
    return Option{code, value};
  }

 private:
  std::string_view rest_;
  std::endian order_;
};

// A name that a line of a candump log, or a configuration, can hold.
std::string interface_name(std::string_view text) {
  constexpr std::size_t kLettersMax = 31;
  std::string name(text.substr(0, std::min(text.find('\0'), kLettersMax)));
  for (char& letter : name)
    if (letter <= ' ' || letter > '~') letter = '_';
  return name;
}

Direction direction_of(std::uint32_t flags) {
  constexpr std::uint32_t kDirectionBits = 3;
  if ((flags & kDirectionBits) == 1) return Direction::kReceived;
  return (flags & kDirectionBits) == 2 ? Direction::kTransmitted : Direction::kUnknown;
}

}  // namespace

std::optional<std::int64_t> PcapngReader::Clock::to_ns(std::uint64_t count) const {
  constexpr unsigned kNanoExponent = 9;
  constexpr unsigned kExponentMax = 63;
  __extension__ using Wide = unsigned __int128;
  constexpr Wide kSecond_ns = 1'000'000'000;
  Wide ns = count;
  if (exponent > kExponentMax) return std::nullopt;
  if (is_binary) {
    ns = ns * kSecond_ns >> exponent;
  } else {
    for (unsigned i = exponent; i < kNanoExponent; ++i)
      ns *= 10;
    for (unsigned i = kNanoExponent; i < exponent; ++i)
      ns /= 10;
  }
  if (ns > static_cast<Wide>(kStampMax_ns)) return std::nullopt;
  const auto offset_max_s = static_cast<std::int64_t>(kStampMax_ns / kSecond_ns);
  if (offset_s < -offset_max_s || offset_s > offset_max_s) return std::nullopt;
  const std::int64_t sum_ns =
      static_cast<std::int64_t>(ns) / 2 + offset_s * static_cast<std::int64_t>(kSecond_ns) / 2;
  if (sum_ns < 0 || sum_ns > kStampMax_ns / 2) return std::nullopt;
  return static_cast<std::int64_t>(ns) + offset_s * static_cast<std::int64_t>(kSecond_ns);
}

bool is_pcapng(std::string_view head) {
  if (head.size() < kSectionHeadBytes) return false;
  const auto magic = load_little<std::uint32_t>(&head[kBlockHeadBytes]);
  return load_little<std::uint32_t>(head.data()) == kSection &&
         (magic == kOrderMagic || magic == swapped(kOrderMagic));
}

Expected<std::unique_ptr<LogReader>> PcapngReader::open(std::unique_ptr<ByteSource> bytes) {
  return std::unique_ptr<LogReader>(
      new PcapngReader(std::make_unique<ByteWindow>(std::move(bytes))));
}

bool PcapngReader::next(LogRecord& record) {
  while (!by_stamp_.is_ready()) {
    if (!read(record)) {
      by_stamp_.close();
      break;
    }
    if (!has_several_) return true;
    by_stamp_.push(record, &xl_, record.bus);
  }
  if (by_stamp_.is_empty()) return false;
  StampOrder::Held held = by_stamp_.pop();
  record = held.record;
  if (held.xl != nullptr) xl_ = *held.xl;
  return true;
}

bool PcapngReader::read(LogRecord& record) {
  while (const auto block = next_block()) {
    bool is_frame = false;
    if (block->type == kInterface) describe_interface(*block);
    if (block->type == kPacket || block->type == kOldPacket) {
      is_frame = read_packet_block(*block, record);
    }
    if (block->type == kSimplePacket) {
      ++counts_.lines;
      counts_.add_malformed("a packet without a stamp (a simple packet block)");
    }
    if (!bytes().pass(block->bytes)) {
      ended_ = true;
      end_inside();
    }
    if (is_frame) return true;
  }
  return false;
}

// The block that begins here; none at the end, or if no valid block follows.
std::optional<PcapngReader::Block> PcapngReader::next_block() {
  if (ended_) return std::nullopt;
  const std::string_view head = bytes().peek(kSectionHeadBytes);
  ended_ = head.size() < kSectionHeadBytes;
  if (ended_) {
    if (!head.empty() || bytes().error()) end_inside();
    return std::nullopt;
  }
  Block block;
  block.type = load_little<std::uint32_t>(head.data());
  if (block.type == kSection && !begin_section(head)) return std::nullopt;
  if (block.type != kSection) block.type = load<std::uint32_t>(head.data(), order_);
  block.bytes = load<std::uint32_t>(&head[4], order_);
  if (block.bytes < kBlockHeadBytes + kBlockTailBytes || block.bytes % 4 != 0) {
    ended_ = true;
    end_damaged("no valid block follows");
    return std::nullopt;
  }
  const std::size_t shown = std::min<std::size_t>(block.bytes, kShownBytes);
  block.content = bytes().peek(shown);
  if (block.content.size() < shown) {
    ended_ = true;
    end_inside();
    return std::nullopt;
  }
  block.content.remove_prefix(kBlockHeadBytes);
  if (shown == block.bytes) block.content.remove_suffix(kBlockTailBytes);
  return block;
}

bool PcapngReader::begin_section(std::string_view head) {
  interfaces_.clear();
  const char* magic = &head[kBlockHeadBytes];
  for (const std::endian order : {std::endian::little, std::endian::big}) {
    order_ = order;
    if (load<std::uint32_t>(magic, order) == kOrderMagic) return true;
  }
  ended_ = true;
  end_damaged("a section of neither byte order");
  return false;
}

void PcapngReader::describe_interface(const Block& block) {
  constexpr std::size_t kHeadBytes = 8;  // link type, reserved, limit
  if (interfaces_.size() == kInterfacesMax || block.content.size() < kHeadBytes) {
    ended_ = true;
    end_damaged("an invalid interface description");
    return;
  }
  Described& added = interfaces_.emplace_back();
  added.interface.link = load<std::uint16_t>(block.content.data(), order_);
  added.interface.number = static_cast<unsigned>(interfaces_.size() - 1);
  has_several_ = has_several_ || interfaces_.size() > 1;
  Options options(block.content.substr(kHeadBytes), order_);
  while (const auto option = options.next()) {
    constexpr unsigned kBinary = 0x80;
    if (option->code == kOptionName) added.interface.name = interface_name(option->value);
    if (option->code == kOptionResolution && !option->value.empty()) {
      const unsigned value = load_byte(option->value.data());
      added.clock.is_binary = (value & kBinary) != 0;
      added.clock.exponent = value & ~kBinary;
    }
    if (option->code == kOptionOffset && option->value.size() == sizeof(std::uint64_t)) {
      added.clock.offset_s =
          static_cast<std::int64_t>(load<std::uint64_t>(option->value.data(), order_));
    }
  }
}

bool PcapngReader::read_packet_block(const Block& block, LogRecord& record) {
  const char* head = block.content.data();
  if (block.content.size() < kPacketHeadBytes) {
    ++counts_.lines;
    counts_.add_malformed("the packet is shorter than its head");
    return false;
  }
  // The old block has a 16-bit interface, followed by a counter of losses.
  const std::size_t number =
      block.type == kPacket ? load<std::uint32_t>(head, order_) : load<std::uint16_t>(head, order_);
  const std::uint64_t stamp = std::uint64_t{load<std::uint32_t>(head + 4, order_)} << 32U |
                              load<std::uint32_t>(head + 8, order_);
  const std::size_t captured = load<std::uint32_t>(head + 12, order_);
  const std::string_view rest = block.content.substr(kPacketHeadBytes);
  if (number >= interfaces_.size()) {
    ++counts_.lines;
    counts_.add_malformed("the packet is of an interface that is not described");
    return false;
  }
  Described& from = interfaces_[number];
  if (!take_packet({from.interface.link, rest.substr(0, captured), order_}, from.interface,
                   record)) {
    return false;
  }
  const auto ns = from.clock.to_ns(stamp);
  if (!ns) {
    --(record.is_xl ? counts_.xl_frames : counts_.frames);
    counts_.add_malformed("stamp: before 1970 or beyond 2255");
    return false;
  }
  set_stamp(*ns, record);
  Options options(rest.substr(std::min(rest.size(), padded(captured))), order_);
  while (const auto option = options.next()) {
    if (option->code == kOptionFlags && option->value.size() == sizeof(std::uint32_t)) {
      record.direction = direction_of(load<std::uint32_t>(option->value.data(), order_));
    }
  }
  return true;
}

}  // namespace vgyro::canlog
