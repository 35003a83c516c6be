#include "canlog/mdf_frames.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "canlog/byte_order.h"
#include "canlog/frame_fields.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

// A channel's block: links, then data.
constexpr std::size_t kNextLink = 0;
constexpr std::size_t kPartsLink = 1;
constexpr std::size_t kNameLink = 2;
constexpr std::size_t kConversionLink = 4;
constexpr std::size_t kDataLink = 5;
constexpr std::size_t kChannelBytes = 24;
constexpr unsigned kTypeVariable = 1;  // the payload is elsewhere
constexpr unsigned kTypeMaster = 2;
constexpr unsigned kTypeVirtualMaster = 3;
constexpr unsigned kTypeVirtual = 6;  // a function of the record's number; here a constant

// Data types.
constexpr unsigned kUnsignedLittle = 0;
constexpr unsigned kUnsignedBig = 1;
constexpr unsigned kSignedLittle = 2;
constexpr unsigned kFloatLittle = 4;
constexpr unsigned kFloatBig = 5;

constexpr double kSecond_ns = 1e9;

bool is_big(unsigned type) {
  return type == kUnsignedBig || type == kSignedLittle + 1 || type == kFloatBig;
}

}  // namespace

Expected<MdfField> MdfField::describe(MdfFile& file, const MdfBlock& channel,
                                      std::uint64_t record_bytes) {
  if (channel.data.size() < kChannelBytes) {
    return tl::unexpected(file.damage(channel.at, "a channel"));
  }
  MdfField field;
  const unsigned channel_type = load_byte(&channel.data[0]);
  field.type_ = load_byte(&channel.data[2]);
  field.bit_ = load_byte(&channel.data[3]);
  field.byte_ = load_little<std::uint32_t>(&channel.data[4]);
  field.bits_ = load_little<std::uint32_t>(&channel.data[8]);
  if (auto done = field.read_conversion(file, channel.link(kConversionLink)); !done) {
    return tl::unexpected(done.error());
  }
  if (channel_type == kTypeVirtual || channel_type == kTypeVirtualMaster) {
    field.kind_ = Kind::kConstant;
    if (field.factor_ != 0.0 || !(field.offset_ >= 0.0) || field.offset_ > UINT32_MAX) {
      return tl::unexpected(file.damage(channel.at, "a channel without data that is not constant"));
    }
    field.constant_ = static_cast<std::uint64_t>(field.offset_);
    return field;
  }
  field.kind_ = Kind::kBits;
  constexpr unsigned kBitsMax = 64;
  if (field.bits_ == 0 || field.bit_ >= 8 || field.bit_ + field.bits_ > kBitsMax ||
      field.byte_ + (field.bit_ + field.bits_ + 7) / 8 > record_bytes) {
    return tl::unexpected(file.damage(channel.at, "a channel that its record has no room for"));
  }
  return field;
}

// Reads linear conversions and tables of values; text for a value does not matter here.
Expected<void> MdfField::read_conversion(MdfFile& file, std::uint64_t at) {
  constexpr std::size_t kHeadBytes = 24;
  constexpr std::size_t kValuesMax = 64;
  constexpr unsigned kLinear = 1;
  constexpr unsigned kTable = 5;
  if (at == 0) return {};
  const auto block = file.block(at, "##CC", kHeadBytes + kValuesMax * sizeof(double));
  if (!block) return tl::unexpected(block.error());
  if (block->data.size() < kHeadBytes) return tl::unexpected(file.damage(at, "a conversion"));
  const unsigned type = load_byte(block->data.data());
  std::vector<double> values;
  for (std::size_t i = kHeadBytes; i + sizeof(double) <= block->data.size(); i += sizeof(double))
    values.push_back(std::bit_cast<double>(load_little<std::uint64_t>(&block->data[i])));
  if (type == kLinear && values.size() >= 2) {
    offset_ = values[0];
    factor_ = values[1];
  }
  for (std::size_t i = 0; type == kTable && i + 1 < values.size(); i += 2) {
    if (values[i] >= 0.0 && values[i] <= UINT32_MAX && values[i + 1] >= 0.0 &&
        values[i + 1] <= UINT32_MAX) {
      table_.emplace_back(values[i], values[i + 1]);
    }
  }
  return {};
}

std::uint64_t MdfField::raw(const char* record) const {
  std::uint64_t bits = 0;
  const std::size_t bytes = (bit_ + bits_ + 7) / 8;
  for (std::size_t i = 0; i < bytes; ++i) {
    const std::size_t at = byte_ + (is_big(type_) ? i : bytes - 1 - i);
    bits = bits << 8U | load_byte(record + at);
  }
  bits >>= bit_;
  return bits_ < 64 ? bits & ((std::uint64_t{1} << bits_) - 1) : bits;
}

std::uint64_t MdfField::value(const char* record) const {
  if (kind_ != Kind::kBits) return constant_;
  const std::uint64_t bits = raw(record);
  for (const auto& [from, to] : table_)
    if (from == bits) return to;
  if (factor_ == 1.0 && offset_ == 0.0) return bits;
  const double value = offset_ + factor_ * static_cast<double>(bits);
  return value >= 0.0 && value <= UINT32_MAX ? static_cast<std::uint64_t>(value) : UINT32_MAX;
}

MdfClock::MdfClock(MdfField field) : field_(std::move(field)) {
  // 1e-6 is no exact double; a factor close to it means microseconds.
  constexpr double kRelative = 1e-9;
  const double tick_ns = field_.factor_ * kSecond_ns;
  if (tick_ns >= 1.0 && tick_ns < kSecond_ns * kSecond_ns &&
      std::abs(tick_ns - std::round(tick_ns)) < kRelative * tick_ns) {
    tick_ns_ = std::llround(tick_ns);
  }
}

std::optional<std::int64_t> MdfClock::to_ns(const char* record) const {
  const std::uint64_t bits = field_.raw(record);
  const bool is_float = field_.type_ == kFloatLittle || field_.type_ == kFloatBig;
  const bool is_unsigned = field_.type_ == kUnsignedLittle || field_.type_ == kUnsignedBig;
  const long double tick_ns = tick_ns_ > 0 ? static_cast<long double>(tick_ns_)
                                           : static_cast<long double>(field_.factor_ * kSecond_ns);
  long double count = 0.0L;
  if (is_float && field_.bits_ == 64) {
    count = std::bit_cast<double>(bits);
  } else if (is_float) {
    count = std::bit_cast<float>(static_cast<std::uint32_t>(bits));
  } else if (is_unsigned) {
    count = static_cast<long double>(bits);
  } else {
    const unsigned unused = 64 - field_.bits_;
    count = static_cast<long double>(static_cast<std::int64_t>(bits << unused) >> unused);
  }
  const long double ns = count * tick_ns + static_cast<long double>(field_.offset_ * kSecond_ns);
  if (!(std::abs(ns) < static_cast<long double>(kStampMax_ns))) return std::nullopt;
  return std::llround(ns);
}

Expected<std::optional<MdfFrames>> MdfFrames::describe(MdfFile& file, const MdfBlock& group,
                                                       std::uint64_t record_bytes) {
  constexpr std::size_t kFirstChannelLink = 1;
  MdfFrames frames;
  if (auto done = frames.add_all(file, group.link(kFirstChannelLink), record_bytes, 0); !done) {
    return tl::unexpected(done.error());
  }
  if (!frames.known_ || !frames.clock) return std::optional<MdfFrames>();
  const bool needs_id = frames.kind != MdfFrameKind::kError;
  if (needs_id &&
      (!frames.id.is_there() || (!frames.dlc.is_there() && !frames.length.is_there()))) {
    return tl::unexpected(file.damage(group.at, "frames without identifier or length"));
  }
  return std::optional(std::move(frames));
}

Expected<void> MdfFrames::add_all(MdfFile& file, std::uint64_t first, std::uint64_t record_bytes,
                                  unsigned depth) {
  constexpr unsigned kDepthMax = 4;
  for (std::uint64_t at = first; at != 0 && depth < kDepthMax;) {
    const auto channel = file.block(at, "##CN", kChannelBytes);
    if (!channel) return tl::unexpected(channel.error());
    if (auto done = add(file, *channel, record_bytes); !done) return done;
    // Another kind of block describes the parts of an array.
    const std::uint64_t parts = channel->link(kPartsLink);
    const auto part = parts != 0 ? file.block(parts, {}, 0) : MdfBlock();
    if (part && part->kind == "##CN") {
      if (auto done = add_all(file, parts, record_bytes, depth + 1); !done) return done;
    }
    at = channel->link(kNextLink);
  }
  return {};
}

Expected<void> MdfFrames::add(MdfFile& file, const MdfBlock& channel, std::uint64_t record_bytes) {
  if (channel.data.size() < kChannelBytes) {
    return tl::unexpected(file.damage(channel.at, "a channel"));
  }
  if (load_byte(channel.data.data()) == kTypeMaster) {
    auto time = MdfField::describe(file, channel, record_bytes);
    if (!time) return tl::unexpected(time.error());
    clock.emplace(std::move(*time));
    return {};
  }
  const std::string name = file.text(channel.link(kNameLink));
  const std::pair<std::string_view, MdfFrameKind> kinds[] = {
      {"CAN_DataFrame.", MdfFrameKind::kData},
      {"CAN_RemoteFrame.", MdfFrameKind::kRemote},
      {"CAN_ErrorFrame.", MdfFrameKind::kError}};
  std::string part;
  for (const auto& [prefix, its_kind] : kinds) {
    if (!name.starts_with(prefix)) continue;
    kind = its_kind;
    known_ = true;
    part = name.substr(prefix.size());
  }
  if (part == "DataBytes") return add_payload(file, channel, record_bytes);
  const std::pair<std::string_view, MdfField*> fields[] = {
      {"BusChannel", &bus},    {"ID", &id},         {"IDE", &extended}, {"DLC", &dlc},
      {"DataLength", &length}, {"Dir", &direction}, {"EDL", &fd},       {"BRS", &rate_switch},
      {"ESI", &error_state},   {"RTR", &remote}};
  for (const auto& [field, to] : fields) {
    if (field != part) continue;
    auto described = MdfField::describe(file, channel, record_bytes);
    if (!described) return tl::unexpected(described.error());
    *to = std::move(*described);
  }
  return {};
}

Expected<void> MdfFrames::add_payload(MdfFile& file, const MdfBlock& channel,
                                      std::uint64_t record_bytes) {
  if (load_byte(channel.data.data()) == kTypeVariable) {
    // The record holds an offset, whatever width the channel states.
    constexpr std::uint32_t kBitsMax = 64;
    MdfBlock place = channel;
    const std::uint64_t room =
        record_bytes -
        std::min<std::uint64_t>(record_bytes, load_little<std::uint32_t>(&channel.data[4]));
    const std::uint32_t bits = std::min(load_little<std::uint32_t>(&channel.data[8]), kBitsMax);
    store_little(&place.data[8],
                 static_cast<std::uint32_t>(std::min<std::uint64_t>(bits, 8 * room)));
    auto described = MdfField::describe(file, place, record_bytes);
    if (!described) return tl::unexpected(described.error());
    offset = std::move(*described);
    elsewhere = channel.link(kDataLink);
    return {};
  }
  data_at = load_little<std::uint32_t>(&channel.data[4]);
  data_bytes = load_little<std::uint32_t>(&channel.data[8]) / 8;
  if (load_byte(&channel.data[3]) != 0 || data_at + data_bytes > record_bytes) {
    return tl::unexpected(file.damage(channel.at, "a payload that its record has no room for"));
  }
  return {};
}

const char* MdfFrames::read(const char* record, LogRecord& to) const {
  can::Frame& frame = to.frame;
  if (direction.is_there()) {
    to.direction = direction.value(record) != 0 ? Direction::kTransmitted : Direction::kReceived;
  }
  if (kind == MdfFrameKind::kError) {
    to.direction = Direction::kUnknown;
    set_error_frame(frame);
    return nullptr;
  }
  constexpr std::uint64_t kExtendedBit = 1ULL << 31U;
  const std::uint64_t bits = id.value(record);
  const auto bare = static_cast<std::uint32_t>(bits & ~kExtendedBit);
  const bool is_extended =
      (bits & kExtendedBit) != 0 ||
      (extended.is_there() ? extended.value(record) != 0 : bare > can::kStandardIdMax);
  if (const char* why = set_id(bare, is_extended, frame)) return why;
  if (kind == MdfFrameKind::kRemote || (remote.is_there() && remote.value(record) != 0)) {
    frame.flags |= can::kRemote;
  } else if (fd.is_there() && fd.value(record) != 0) {
    frame.flags |= can::kFd;
    if (rate_switch.is_there() && rate_switch.value(record) != 0) {
      frame.flags |= can::kBitRateSwitch;
    }
    if (error_state.is_there() && error_state.value(record) != 0) {
      frame.flags |= can::kErrorStateIndicator;
    }
  }
  if (dlc.is_there() && (frame.has(can::kRemote) || !frame.has(can::kFd) || !length.is_there())) {
    return set_dlc(static_cast<unsigned>(dlc.value(record)), frame);
  }
  return set_length(static_cast<unsigned>(length.value(record)), frame);
}

}  // namespace vgyro::canlog
