#include "dbc/layout_check.h"

#include <array>
#include <bitset>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "dbc/layout.h"

namespace vgyro::dbc {

namespace {

// Overlaps are checked within what one frame can carry; in longer (transported) messages only
// within the first 64 bytes.
constexpr std::size_t kCheckedBits = 512;
using Bits = std::bitset<kCheckedBits>;
using Owners = std::array<const Signal*, kCheckedBits>;

Bits bits_of(const Signal& signal) {
  Bits bits;
  const bool intel = signal.byte_order == ByteOrder::kIntel;
  const std::size_t start = signal.start_bit;
  const std::size_t from_first_top = start / 8 * 8 + 7 - start % 8;
  for (std::size_t i = 0; i < signal.length_bits; ++i) {
    const std::size_t place = from_first_top + i;
    const std::size_t bit = intel ? start + i : place / 8 * 8 + 7 - place % 8;
    if (bit < kCheckedBits) bits.set(bit);
  }
  return bits;
}

bool has_length(const Signal& signal) {
  return signal.length_bits > 0 && signal.length_bits <= kSignalBitsMax;
}

void check_signal(const Message& message, Signal& signal, Diagnostics& diagnostics) {
  const auto odd = [&](std::string what) {
    diagnostics.add(signal.line,
                    fmt::format("signal {} of message {} {}", signal.name, message.name, what));
  };
  if (!has_length(signal)) {
    odd(fmt::format("is {} bits long; 1 to 64 can be read", signal.length_bits));
  } else if (const BitPlace place = bit_place(signal); place.last_byte >= message.size_bytes) {
    odd(fmt::format("ends in byte {} of {} bytes", place.last_byte, message.size_bytes));
  }
  const bool is_float32 = signal.type == ValueType::kFloat32;
  const bool is_float64 = signal.type == ValueType::kFloat64;
  if ((is_float32 && signal.length_bits != 32) || (is_float64 && signal.length_bits != 64)) {
    odd(fmt::format("is a float of {} bits; 32 or 64 can be read", signal.length_bits));
  }
  if (signal.factor == 0.0) odd("has scale 0: all its values are the same");
  const bool no_range = !std::isfinite(signal.minimum) || !std::isfinite(signal.maximum);
  if (signal.minimum > signal.maximum) {
    odd(fmt::format("has a minimum {} above its maximum {}; the range is ignored", signal.minimum,
                    signal.maximum));
  }
  if (no_range || signal.minimum > signal.maximum) signal.minimum = signal.maximum = 0.0;
}

/// The first unconditional signal that has one of these bits.
const Signal* owner_of(const Bits& bits, const Owners& owners) {
  for (std::size_t i = 0; i < kCheckedBits; ++i) {
    if (bits[i] && owners[i] != nullptr) return owners[i];
  }
  return nullptr;
}

/// Compares multiplexed signals with those always present and with those of the same value.
void check_overlaps(const Message& message, Diagnostics& diagnostics) {
  const auto overlap = [&](const Signal& signal, std::string_view other) {
    diagnostics.add(signal.line, fmt::format("signal {} of message {} overlaps {}", signal.name,
                                             message.name, other));
  };
  Owners owners{};
  for (const Signal& signal : message.signals) {
    if (signal.condition || !has_length(signal)) continue;
    const Bits bits = bits_of(signal);
    if (const Signal* const owner = owner_of(bits, owners)) overlap(signal, owner->name);
    for (std::size_t i = 0; i < kCheckedBits; ++i) {
      if (bits[i] && owners[i] == nullptr) owners[i] = &signal;
    }
  }
  std::map<std::pair<std::string_view, std::uint64_t>, Bits> taken;
  for (const Signal& signal : message.signals) {
    if (!signal.condition || signal.condition->ranges.empty() || !has_length(signal)) continue;
    const Bits bits = bits_of(signal);
    if (const Signal* const owner = owner_of(bits, owners)) {
      overlap(signal, owner->name);
      continue;
    }
    Bits& others = taken[{signal.condition->multiplexor, signal.condition->ranges.front().first}];
    if ((others & bits).any()) overlap(signal, "another one with the same multiplexor value");
    others |= bits;
  }
}

}  // namespace

void check_layout(Message& message, Diagnostics& diagnostics) {
  for (Signal& signal : message.signals)
    check_signal(message, signal, diagnostics);
  check_overlaps(message, diagnostics);
}

}  // namespace vgyro::dbc
