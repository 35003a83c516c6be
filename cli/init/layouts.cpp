#include "cli/init/layouts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/core.h>

#include "analysis/field.h"
#include "dbc/codec.h"

namespace vgyro::cli {

namespace {

constexpr std::size_t kFramesLooked = 65536;
constexpr std::size_t kFramesLeast = 64;
constexpr double kFloatMost = 1e4;    // deg/s; bytes that are not a float give values beyond it, or
constexpr double kFloatLeast = 1e-3;  // hardly above 0
constexpr double kFloatFinest = 1e-12;

struct Layout {
  std::size_t byte = 0;
  std::size_t bytes = 2;
  dbc::ByteOrder order = dbc::ByteOrder::kIntel;
  dbc::ValueType type = dbc::ValueType::kSigned;
};

struct Judged {
  dbc::Signal signal;
  Layout layout;
  double roughness = 0.0;  ///< step over range
};

dbc::Signal signal_of(const Layout& layout) {
  dbc::Signal signal;
  const bool intel = layout.order == dbc::ByteOrder::kIntel;
  signal.start_bit = static_cast<std::uint16_t>(8 * layout.byte + (intel ? 0 : 7));
  signal.length_bits = static_cast<std::uint16_t>(8 * layout.bytes);
  signal.byte_order = layout.order;
  signal.type = layout.type;
  signal.name = fmt::format("Field_{}_{}", layout.byte, signal.length_bits);
  return signal;
}

std::vector<dbc::Reading> readings_of(const Stream& stream, const dbc::Signal& signal,
                                      std::size_t length) {
  std::vector<dbc::Reading> readings;
  const auto codec = dbc::SignalCodec::make(signal, length, "");
  if (!codec) return readings;
  for (const Stream::Kept& frame : stream.kept) {
    if (readings.size() == kFramesLooked) break;
    const auto payload = stream.payload(frame);
    if (payload.size() == length) readings.push_back(codec->decode(payload));
  }
  return readings;
}

std::vector<double> values_of(const std::vector<dbc::Reading>& readings) {
  std::vector<double> values;
  values.reserve(readings.size());
  for (const dbc::Reading& reading : readings)
    values.push_back(reading.value);
  return values;
}

/// A float of a platform that turns to and fro has several exponents; bytes that are not a float
/// have most exponents out of bounds, or a single one.
bool is_float(const std::vector<double>& values) {
  double most = 0.0;
  std::set<int> exponents;
  for (const double value : values) {
    if (!std::isfinite(value) || std::abs(value) > kFloatMost) return false;
    if (value != 0.0 && std::abs(value) < kFloatFinest) return false;
    most = std::max(most, std::abs(value));
    exponents.insert(std::ilogb(value));
  }
  constexpr std::size_t kExponentsLeast = 3;
  return most >= kFloatLeast && exponents.size() >= kExponentsLeast;
}

/// A constant byte may be above a small number, but only in the shortest layout.
bool is_one_number(const std::vector<dbc::Reading>& readings, const Layout& layout) {
  std::vector<std::int64_t> raw;
  raw.reserve(readings.size());
  for (const dbc::Reading& reading : readings)
    raw.push_back(reading.raw);
  const unsigned top = 8 * static_cast<unsigned>(layout.bytes - 1);
  const bool top_stands = std::all_of(
      raw.begin(), raw.end(), [&](std::int64_t one) { return one >> top == raw[0] >> top; });
  if (top_stands) return layout.bytes == 2;
  for (std::size_t low = 1; low < layout.bytes; ++low) {
    if (!analysis::carries_into(raw, 8 * static_cast<unsigned>(low))) return false;
  }
  return true;
}

std::optional<Judged> judge(const Stream& stream, const Layout& layout, std::size_t length) {
  Judged judged{signal_of(layout), layout, 0.0};
  const auto readings = readings_of(stream, judged.signal, length);
  if (readings.size() < kFramesLeast) return std::nullopt;
  const auto values = values_of(readings);
  const bool floating = layout.type == dbc::ValueType::kFloat32;
  if (floating && !is_float(values)) return std::nullopt;
  const auto figures = analysis::field_figures(values);
  if (!analysis::moves_as_a_rate(figures)) return std::nullopt;
  if (!floating && !is_one_number(readings, layout)) return std::nullopt;
  judged.roughness = figures.step / figures.range;
  return judged;
}

/// Signed, unless the values leap only with a sign, or stay around the middle of the unsigned
/// range.
std::optional<Judged> judge_signs(const Stream& stream, Layout layout, std::size_t length) {
  const auto with = judge(stream, layout, length);
  layout.type = dbc::ValueType::kUnsigned;
  auto without = judge(stream, layout, length);
  if (!with || !without) return with ? with : without;
  auto values = values_of(readings_of(stream, without->signal, length));
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const double share = *middle / std::ldexp(1.0, 8 * static_cast<int>(layout.bytes));
  return share > 0.25 && share < 0.75 ? without : with;
}

bool overlap(const Layout& a, const Layout& b) {
  return a.byte < b.byte + b.bytes && b.byte < a.byte + a.bytes;
}

/// Increments with nearly every frame and wraps at its highest value, if at all.
bool counts(const std::vector<dbc::Reading>& readings, std::int64_t modulus) {
  constexpr double kMostly = 0.95;
  if (readings.size() < kFramesLeast) return false;
  std::int64_t highest = 0;
  for (const dbc::Reading& reading : readings)
    highest = std::max(highest, reading.raw);
  std::size_t right = 0;
  for (std::size_t i = 1; i < readings.size(); ++i) {
    const std::int64_t before = readings[i - 1].raw;
    const std::int64_t next = before == highest ? 0 : before + 1;
    right += readings[i].raw == next ? 1U : 0U;
  }
  return highest > modulus / 4 &&
         static_cast<double>(right) >= kMostly * static_cast<double>(readings.size() - 1);
}

}  // namespace

std::size_t usual_length(const Stream& stream) {
  std::map<std::size_t, std::size_t> frames;
  for (const Stream::Kept& frame : stream.kept)
    ++frames[frame.length];
  const auto most =
      std::max_element(frames.begin(), frames.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == frames.end() ? 0 : most->first;
}

std::vector<dbc::Signal> find_fields(const Stream& stream) {
  std::vector<Judged> all;
  const std::size_t length = usual_length(stream);
  for (const auto order : {dbc::ByteOrder::kIntel, dbc::ByteOrder::kMotorola}) {
    for (std::size_t byte = 0; byte < length; ++byte) {
      for (const std::size_t bytes : {4U, 3U, 2U}) {
        if (byte + bytes > length) continue;
        Layout layout{byte, bytes, order};
        if (auto good = judge_signs(stream, layout, length)) all.push_back(std::move(*good));
        layout.type = dbc::ValueType::kFloat32;
        if (bytes != 4) continue;
        if (auto good = judge(stream, layout, length)) all.push_back(std::move(*good));
      }
    }
  }
  // Floats hardly occur by chance; a longer number includes the shorter ones that are part of it.
  const auto rank = [](const Judged& one) {
    const bool floating = one.layout.type == dbc::ValueType::kFloat32;
    return std::tuple(!floating, -static_cast<int>(one.layout.bytes), one.roughness);
  };
  std::stable_sort(all.begin(), all.end(),
                   [&](const Judged& a, const Judged& b) { return rank(a) < rank(b); });
  std::vector<Judged> chosen;
  for (Judged& one : all) {
    const bool taken = std::any_of(chosen.begin(), chosen.end(), [&](const Judged& other) {
      return overlap(one.layout, other.layout);
    });
    if (!taken) chosen.push_back(std::move(one));
  }
  std::vector<dbc::Signal> signals;
  signals.reserve(chosen.size());
  for (Judged& one : chosen)
    signals.push_back(std::move(one.signal));
  return signals;
}

std::vector<dbc::Signal> find_counters(const Stream& stream) {
  std::vector<dbc::Signal> found;
  const std::size_t length = usual_length(stream);
  for (std::size_t byte = 0; byte < length; ++byte) {
    for (const unsigned bits : {8U, 4U}) {
      for (unsigned from = 0; from + bits <= 8; from += bits) {
        dbc::Signal signal;
        signal.start_bit = static_cast<std::uint16_t>(8 * byte + from);
        signal.length_bits = static_cast<std::uint16_t>(bits);
        signal.name = fmt::format("Counter_{}", signal.start_bit);
        if (!counts(readings_of(stream, signal, length), std::int64_t{1} << bits)) continue;
        found.push_back(signal);
        from = 8;  // skip the 4-bit counter inside an 8-bit one
      }
      if (!found.empty() && found.back().start_bit / 8U == byte) break;
    }
  }
  return found;
}

}  // namespace vgyro::cli
