#include "dbc/e2e.h"

#include <algorithm>
#include <initializer_list>

namespace vgyro::dbc {

namespace {

constexpr unsigned kCounterMax1 = 14;  // 15 is "invalid"
constexpr std::size_t kHeaderBytes5 = 3;

/// The state of a CRC register of W bits after one byte, for each value of its topmost byte.
template <class W>
constexpr std::array<W, 256> crc_table(unsigned polynomial) {
  constexpr unsigned kBits = 8 * sizeof(W);
  constexpr unsigned kTop = 1U << (kBits - 1);
  std::array<W, 256> table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte << (kBits - 8);
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & kTop) != 0 ? (crc << 1U) ^ polynomial : crc << 1U;
    table[byte] = static_cast<W>(crc);
  }
  return table;
}

/// The contribution of a byte to a CRC-8 when up to seven bytes follow it. The contributions of
/// eight bytes are looked up independently; byte by byte, each step would wait for the one before.
using Crc8Shares = std::array<std::array<std::uint8_t, 256>, 8>;
constexpr Crc8Shares crc8_shares(unsigned polynomial) {
  Crc8Shares shares{};
  shares[0] = crc_table<std::uint8_t>(polynomial);
  for (std::size_t behind = 1; behind < shares.size(); ++behind) {
    for (std::size_t byte = 0; byte < 256; ++byte)
      shares[behind][byte] = shares[0][shares[behind - 1][byte]];
  }
  return shares;
}

constexpr Crc8Shares kCrc8 = crc8_shares(0x1D);
constexpr Crc8Shares kCrc8H2f = crc8_shares(0x2F);
constexpr auto kCrc16 = crc_table<std::uint16_t>(0x1021);

using Bytes = std::span<const std::uint8_t>;

/// The protected data: all bytes but those of the check value.
struct Data {
  Bytes before;
  Bytes after;
};

class Crc8 {
 public:
  Crc8(const Crc8Shares& shares, std::uint8_t begin) : shares_(shares), crc_(begin) {}
  void add(unsigned byte) { crc_ = shares_[0][(crc_ ^ byte) & 0xFFU]; }
  void add(const Data& data) {
    add(data.before);
    add(data.after);
  }
  void add(Bytes bytes) {
    for (; bytes.size() > shares_.size(); bytes = bytes.subspan(shares_.size()))
      add_some(bytes.first(shares_.size()));
    if (!bytes.empty()) add_some(bytes);
  }
  [[nodiscard]] std::uint8_t value() const { return crc_; }

 private:
  // Precondition: one to eight bytes.
  void add_some(Bytes bytes) {
    const std::size_t last = bytes.size() - 1;
    std::uint8_t sum = shares_[last][bytes[0] ^ crc_];
    for (std::size_t i = 1; i <= last; ++i)
      sum ^= shares_[last - i][bytes[i]];
    crc_ = sum;
  }

  const Crc8Shares& shares_;
  std::uint8_t crc_;
};

std::uint16_t crc16_step(std::uint16_t crc, unsigned byte) {
  return static_cast<std::uint16_t>((crc << 8U) ^ kCrc16[((crc >> 8U) ^ byte) & 0xFFU]);
}

unsigned low_byte(unsigned word) {
  return word & 0xFFU;
}
unsigned high_byte(unsigned word) {
  return word >> 8U & 0xFFU;
}

std::uint8_t profile_1(std::initializer_list<unsigned> id_bytes, const Data& data) {
  Crc8 crc(kCrc8, 0);
  for (const unsigned byte : id_bytes)
    crc.add(byte);
  crc.add(data);
  return crc.value();
}

std::uint8_t profile_2(unsigned id, const Data& data) {
  Crc8 crc(kCrc8H2f, 0xFF);
  crc.add(data);
  crc.add(low_byte(id));
  return crc.value() ^ 0xFFU;
}

std::uint16_t profile_5(unsigned id, const Data& data) {
  std::uint16_t crc = 0xFFFF;
  for (const Bytes part : {data.before, data.after}) {
    for (const std::uint8_t byte : part)
      crc = crc16_step(crc, byte);
  }
  return crc16_step(crc16_step(crc, low_byte(id)), high_byte(id));
}

std::uint8_t crc8_j1850(const Data& data) {
  Crc8 crc(kCrc8, 0xFF);
  crc.add(data);
  return crc.value() ^ 0xFFU;
}

std::uint8_t toyota(std::uint32_t can_id, unsigned length, const Data& data) {
  unsigned sum = length;
  for (; can_id != 0; can_id >>= 8U)
    sum += low_byte(can_id);
  for (const Bytes part : {data.before, data.after}) {
    for (const std::uint8_t byte : part)
      sum += byte;
  }
  return static_cast<std::uint8_t>(low_byte(sum));
}

struct Named {
  std::string_view name;
  E2eKind kind;
};
constexpr std::array kNamed{
    Named{"profile_1a", E2eKind::kProfile1A},  Named{"profile_1b", E2eKind::kProfile1B},
    Named{"profile_1c", E2eKind::kProfile1C},  Named{"profile_2", E2eKind::kProfile2},
    Named{"profile_5", E2eKind::kProfile5},    Named{"profile_11a", E2eKind::kProfile1A},
    Named{"profile_11c", E2eKind::kProfile1C}, Named{"profile_22", E2eKind::kProfile2},
    Named{"crc8_j1850", E2eKind::kCrc8J1850},  Named{"toyota", E2eKind::kToyota}};
constexpr auto kNames = [] {
  std::array<std::string_view, kNamed.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i)
    names[i] = kNamed[i].name;
  return names;
}();

bool is_profile_1(E2eKind kind) {
  return kind == E2eKind::kProfile1A || kind == E2eKind::kProfile1B || kind == E2eKind::kProfile1C;
}

}  // namespace

std::optional<E2eKind> e2e_kind_from(std::string_view name) {
  const auto* found = std::find_if(kNamed.begin(), kNamed.end(),
                                   [&](const Named& named) { return named.name == name; });
  if (found == kNamed.end()) return std::nullopt;
  return found->kind;
}

std::span<const std::string_view> e2e_kind_names() {
  return kNames;
}

// --- a frame -------------------------------------------------------------------------------------

std::size_t E2eProtection::header_bytes(E2eKind kind) {
  if (kind == E2eKind::kProfile5) return kHeaderBytes5;
  return kind == E2eKind::kCrc8J1850 || kind == E2eKind::kToyota ? 1 : 2;
}

E2eProtection E2eProtection::for_can_id(std::uint32_t can_id) const {
  E2eProtection other = *this;
  other.layout_.can_id = can_id;
  return other;
}

std::uint8_t E2eProtection::header(Bytes payload) const {
  return payload[layout_.crc_byte + 1];
}

std::uint16_t E2eProtection::carried(Bytes payload) const {
  const unsigned low = payload[layout_.crc_byte];
  if (layout_.kind != E2eKind::kProfile5) return static_cast<std::uint16_t>(low);
  return static_cast<std::uint16_t>(low | static_cast<unsigned>(header(payload)) << 8U);
}

std::uint16_t E2eProtection::value(Bytes payload) const {
  const std::size_t width = layout_.kind == E2eKind::kProfile5 ? 2 : 1;
  const Data data{payload.first(layout_.crc_byte),
                  payload.first(layout_.bytes).subspan(layout_.crc_byte + width)};
  const unsigned id = layout_.data_ids[0];
  switch (layout_.kind) {
    case E2eKind::kProfile1A:
      return profile_1({low_byte(id), high_byte(id)}, data);
    case E2eKind::kProfile1B:
      return profile_1({(header(payload) & 1U) == 0 ? low_byte(id) : high_byte(id)}, data);
    case E2eKind::kProfile1C:
      // The high byte's nibble is part of the data, so zero replaces it here.
      return profile_1({low_byte(id), 0U}, data);
    case E2eKind::kProfile2:
      return profile_2(layout_.data_ids[header(payload) & 0x0FU], data);
    case E2eKind::kProfile5:
      return profile_5(id, data);
    case E2eKind::kCrc8J1850:
      return crc8_j1850(data);
    case E2eKind::kToyota:
      break;
  }
  return toyota(layout_.can_id, static_cast<unsigned>(layout_.bytes), data);
}

bool E2eProtection::check(Bytes payload) const {
  if (is_profile_1(layout_.kind) && (header(payload) & 0x0FU) > kCounterMax1) return false;
  const unsigned nibble = high_byte(layout_.data_ids[0]) & 0x0FU;
  if (layout_.kind == E2eKind::kProfile1C && header(payload) >> 4U != nibble) return false;
  return carried(payload) == value(payload);
}

void E2eProtection::seal(std::span<std::uint8_t> payload) const {
  std::uint8_t* const crc = &payload[layout_.crc_byte];
  if (layout_.kind == E2eKind::kProfile1C) {
    const unsigned nibble = high_byte(layout_.data_ids[0]) & 0x0FU;
    crc[1] = static_cast<std::uint8_t>(nibble << 4U | (crc[1] & 0x0FU));
  }
  const unsigned made = value(payload);
  crc[0] = static_cast<std::uint8_t>(low_byte(made));
  if (layout_.kind == E2eKind::kProfile5) crc[1] = static_cast<std::uint8_t>(high_byte(made));
}

// --- senders -------------------------------------------------------------------------------------

E2eProfile11C::E2eProfile11C(std::uint16_t data_id)
    : protection_({.kind = E2eKind::kProfile1C, .data_ids = {data_id}}),
      nibble_(static_cast<std::uint8_t>((high_byte(data_id) & 0x0FU) << 4U)),
      crc_of_id_(profile_1({low_byte(data_id), 0U}, {})) {}

// Same as E2eProtection::seal() for this layout, in fewer steps.
void E2eProfile11C::protect(std::span<std::uint8_t, 8> payload) {
  payload[1] = static_cast<std::uint8_t>(nibble_ | counter_);
  payload[0] = static_cast<std::uint8_t>(
      kCrc8[6][payload[1] ^ crc_of_id_] ^ kCrc8[5][payload[2]] ^ kCrc8[4][payload[3]] ^
      kCrc8[3][payload[4]] ^ kCrc8[2][payload[5]] ^ kCrc8[1][payload[6]] ^ kCrc8[0][payload[7]]);
  counter_ = static_cast<std::uint8_t>(counter_ == kCounterMax1 ? 0 : counter_ + 1);
}

std::uint8_t E2eProfile11C::crc(std::span<const std::uint8_t, 8> payload) const {
  return static_cast<std::uint8_t>(protection_.value(payload));
}

bool E2eProfile11C::check(std::span<const std::uint8_t, 8> payload) const {
  return protection_.check(payload);
}

E2eProtection E2eProfile5::of_length(std::size_t bytes) const {
  return E2eProtection({.kind = E2eKind::kProfile5, .bytes = bytes, .data_ids = {data_id_}});
}

void E2eProfile5::protect(std::span<std::uint8_t> payload) {
  payload[2] = counter_++;
  of_length(payload.size()).seal(payload);
}

std::uint16_t E2eProfile5::crc(std::span<const std::uint8_t> payload) const {
  return of_length(payload.size()).value(payload);
}

bool E2eProfile5::check(std::span<const std::uint8_t> payload) const {
  return payload.size() >= kHeaderBytes5 && of_length(payload.size()).check(payload);
}

}  // namespace vgyro::dbc
