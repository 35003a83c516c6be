// Finds the companions of the rate in a gyro's message.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/core.h>

#include "base/spelling.h"
#include "cli/init/candidates.h"
#include "cli/init/words.h"
#include "dbc/codec.h"
#include "dbc/e2e.h"
#include "gateway/units.h"

namespace vgyro::cli {

namespace {

constexpr std::size_t kFramesLooked = 2000;
constexpr double kMostly = 0.95;

/// Raw values in the order of the log.
std::vector<std::int64_t> raw_values(const Found& found, const dbc::Signal& signal) {
  std::vector<std::int64_t> values;
  const auto codec = dbc::SignalCodec::make(signal, found.message->size_bytes, "");
  if (!codec) return values;
  for (const Stream::Kept& frame : found.stream->kept) {
    if (values.size() == kFramesLooked) break;
    const auto payload = found.stream->payload(frame);
    if (codec->fits(payload.size())) values.push_back(codec->decode(payload).raw);
  }
  return values;
}

/// For a counter that increments with every frame: its highest value in the log, or that of its
/// bits if it never wrapped. Nothing if it does not count.
std::optional<std::int64_t> counts_to(const Found& found, const dbc::Signal& signal) {
  if (!signal.is_integer() || signal.length_bits < 2 || signal.length_bits > 31) return {};
  if (signal.condition || signal.is_multiplexor) return {};
  const auto values = raw_values(found, signal);
  if (values.size() < 16) return {};
  std::size_t right = 0;
  std::map<std::int64_t, std::size_t> ends;  // value → how often 0 followed it
  for (std::size_t i = 1; i < values.size(); ++i) {
    right += values[i] == values[i - 1] + 1 ? 1U : 0U;
    if (values[i] == 0 && values[i - 1] > 0) ++ends[values[i - 1]];
  }
  std::int64_t most = (std::int64_t{1} << signal.length_bits) - 1;
  const auto end = std::max_element(
      ends.begin(), ends.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  const std::int64_t highest = *std::max_element(values.begin(), values.end());
  if (end != ends.end() && end->first == highest) {
    most = highest;
    right += end->second;
  }
  if (static_cast<double>(right) < kMostly * static_cast<double>(values.size() - 1)) return {};
  return most;
}

/// The highest value that the gateway assumes by default.
std::int64_t counter_max_of(const dbc::Signal& signal) {
  const std::int64_t bits_most = (std::int64_t{1} << signal.length_bits) - 1;
  return signal.maximum == static_cast<double>(bits_most - 1) ? bits_most - 1 : bits_most;
}

std::size_t shared_beginning(std::string_view a, std::string_view b) {
  std::size_t n = 0;
  while (n < std::min(a.size(), b.size()) && a[n] == b[n])
    ++n;
  return n;
}

bool is_ok(const std::string& label) {
  static const std::set<std::string> kWords{
      "ok",     "valid",    "normal",   "good",      "in_spec", "active",     "gueltig",
      "gültig", "no error", "no_error", "available", "working", "operational"};
  return kWords.contains(lower(label));
}

/// "Status == 0", if a label of the signal means valid and the signal mostly had that value.
void find_valid(const Found& found, const dbc::Signal& rate, Companions& companions) {
  const dbc::Signal* best = nullptr;
  std::int64_t value = 0;
  for (const dbc::Signal& signal : found.message->signals) {
    if (&signal == &rate || signal.condition || !signal.is_integer()) continue;
    // The flag of another rate has a name closer to that rate's.
    const bool others = std::any_of(found.message->signals.begin(), found.message->signals.end(),
                                    [&](const dbc::Signal& other) {
                                      return &other != &rate && &other != &signal &&
                                             !other.unit.empty() &&
                                             shared_beginning(other.name, signal.name) >
                                                 shared_beginning(rate.name, signal.name);
                                    });
    if (others) continue;
    for (const dbc::ValueLabel& label : signal.labels) {
      if (!is_ok(label.text)) continue;
      const bool nearer = best == nullptr || shared_beginning(rate.name, signal.name) >
                                                 shared_beginning(rate.name, best->name);
      if (nearer) {
        best = &signal;
        value = label.raw;
      }
    }
  }
  if (best == nullptr) return;
  const auto values = raw_values(found, *best);
  const auto good = std::count(values.begin(), values.end(), value);
  const std::string text = fmt::format("{} == {}", best->name, value);
  if (2 * good > static_cast<std::ptrdiff_t>(values.size())) {
    companions.valid = text;
  } else {
    companions.remarks.push_back(
        fmt::format("{} is labelled as valid, but holds in {} of {} frames only: not used", text,
                    good, values.size()));
  }
}

void find_temperature(const Found& found, Companions& companions) {
  for (const dbc::Signal& signal : found.message->signals) {
    const auto conversion = gateway::convert_unit(gateway::Dimension::kTemperature, signal.unit);
    if (!conversion || lower(signal.unit) == "c") continue;
    const auto series = series_of(found, signal, 1.0);
    if (series.value.empty()) continue;
    const auto [low, high] = std::minmax_element(series.value.begin(), series.value.end());
    const double low_c = *low * conversion->scale + conversion->shift;
    const double high_c = *high * conversion->scale + conversion->shift;
    if (low_c < -60.0 || high_c > 150.0) {
      companions.remarks.push_back(
          fmt::format("{} runs from {:g} to {:g} degC: not used as the "
                      "temperature",
                      signal.name, low_c, high_c));
    } else if (companions.temperature.empty()) {
      companions.temperature = signal.name;
    }
  }
}

// --- check values --------------------------------------------------------------------------------

using Payloads = std::vector<std::span<const std::uint8_t>>;

/// Distinct frames of full length.
Payloads distinct(const Found& found) {
  std::set<std::vector<std::uint8_t>> seen;
  Payloads payloads;
  for (const Stream::Kept& frame : found.stream->kept) {
    const auto payload = found.stream->payload(frame);
    if (payload.size() != found.message->size_bytes || payloads.size() == 256) continue;
    if (seen.emplace(payload.begin(), payload.end()).second) payloads.push_back(payload);
  }
  return payloads;
}

struct Trial {
  dbc::E2eKind kind;
  std::string_view name;
  std::uint32_t ids;  ///< number of data IDs to try; 1: the kind has none
};

// Profile 1C comes before 1A: for its IDs both give the same value, and the constant nibble shows
// that it is 1C.
constexpr std::array kTrials{Trial{dbc::E2eKind::kCrc8J1850, "crc8_j1850", 1},
                             Trial{dbc::E2eKind::kToyota, "toyota", 1},
                             Trial{dbc::E2eKind::kProfile1C, "profile_1c", 0x1000},
                             Trial{dbc::E2eKind::kProfile1A, "profile_1a", 0x10000},
                             Trial{dbc::E2eKind::kProfile1B, "profile_1b", 0x10000},
                             Trial{dbc::E2eKind::kProfile5, "profile_5", 0x10000}};

bool all_agree(const dbc::E2eProtection& protection, const Payloads& payloads) {
  std::size_t wrong = 0;
  for (const auto payload : payloads) {
    if (!protection.check(payload) && ++wrong * 50 > payloads.size()) return false;
  }
  return true;
}

std::optional<E2eFound> try_kind(const Found& found, const Trial& trial, std::size_t byte,
                                 const Payloads& payloads) {
  dbc::E2eProtection::Layout layout{.kind = trial.kind,
                                    .crc_byte = byte,
                                    .bytes = found.message->size_bytes,
                                    .data_ids = {},
                                    .can_id = found.message->id};
  // Most senders use the identifier itself.
  for (std::uint32_t k = 0; k <= trial.ids; ++k) {
    const std::uint32_t id = k == 0 ? found.message->id & (trial.ids - 1) : k - 1;
    layout.data_ids[0] = static_cast<std::uint16_t>(id);
    if (!all_agree(dbc::E2eProtection(layout), payloads)) continue;
    E2eFound result{std::string(trial.name), trial.ids > 1 ? fmt::format("{:#x}", id) : "", byte,
                    ""};
    const unsigned bits = trial.kind == dbc::E2eKind::kProfile5 ? 16 : 8;
    for (const dbc::Signal& signal : found.message->signals) {
      const bool intel = signal.byte_order == dbc::ByteOrder::kIntel;
      const bool there = signal.length_bits == bits && signal.start_bit / 8U == byte &&
                         signal.start_bit % 8U == (intel ? 0U : 7U) && (intel || bits == 8);
      if (there && signal.is_integer()) result.signal = signal.name;
    }
    return result;
  }
  return std::nullopt;
}

std::optional<E2eFound> try_profile_2(const Found& found, std::size_t byte,
                                      const Payloads& payloads) {
  dbc::E2eProtection::Layout layout{.kind = dbc::E2eKind::kProfile2,
                                    .crc_byte = byte,
                                    .bytes = found.message->size_bytes,
                                    .data_ids = {}};
  std::string list;
  for (std::size_t counter = 0; counter < dbc::kE2eDataIdsMost; ++counter) {
    Payloads mine;
    for (const auto payload : payloads) {
      if ((payload[byte + 1] & 0x0FU) == counter) mine.push_back(payload);
    }
    if (mine.size() < 3) return std::nullopt;
    std::uint16_t id = 0;
    for (; id < 256; ++id) {
      layout.data_ids[counter] = id;
      if (all_agree(dbc::E2eProtection(layout), mine)) break;
    }
    if (id == 256) return std::nullopt;
    list += fmt::format("{}{:#04x}", counter == 0 ? "" : ", ", id);
  }
  E2eFound result{"profile_2", "[" + list + "]", byte, ""};
  for (const dbc::Signal& signal : found.message->signals) {
    if (signal.length_bits == 8 && signal.start_bit / 8U == byte) result.signal = signal.name;
  }
  return result;
}

}  // namespace

std::optional<E2eFound> find_e2e(const Found& found) {
  const Payloads payloads = distinct(found);
  if (payloads.size() < 24) return std::nullopt;
  for (std::size_t byte = 0; byte < payloads[0].size(); ++byte) {
    std::set<std::uint8_t> values;
    for (const auto payload : payloads)
      values.insert(payload[byte]);
    if (values.size() < 12) continue;  // check values hardly repeat
    for (const Trial& trial : kTrials) {
      if (byte + dbc::E2eProtection::header_bytes(trial.kind) > payloads[0].size()) continue;
      if (auto result = try_kind(found, trial, byte, payloads)) return result;
    }
    if (byte + 2 > payloads[0].size()) continue;
    if (auto result = try_profile_2(found, byte, payloads)) return result;
  }
  return std::nullopt;
}

Companions find_companions(const Found& found, const dbc::Signal& rate) {
  Companions companions;
  companions.e2e = find_e2e(found);
  const auto& e2e = companions.e2e;
  for (const dbc::Signal& signal : found.message->signals) {
    if (&signal == &rate || !companions.counter.empty()) continue;
    const auto most = counts_to(found, signal);
    if (!most) continue;
    companions.counter = signal.name;
    const bool fixed = e2e && e2e->kind.starts_with("profile_1");
    if (!fixed && *most != counter_max_of(signal)) companions.counter_max = most;
  }
  find_temperature(found, companions);
  find_valid(found, rate, companions);
  if (e2e && e2e->signal.empty()) {
    const bool wide = e2e->kind == "profile_5";
    companions.remarks.push_back(fmt::format(
        "byte {} carries a check value that agrees with {}, but the DBC file has no signal there. "
        "To have it checked, add to the file\n   SG_ VG_CHECK : {}|{}@1+ (1,0) [0|0] \"\" "
        "Vector__XXX\nand here crc = \"VG_CHECK\", e2e = \"{}\"{}",
        e2e->byte, e2e->kind, 8 * e2e->byte, wide ? 16 : 8, e2e->kind,
        e2e->data_id.empty() ? "" : ", data_id = " + e2e->data_id));
  }
  for (const dbc::Signal& signal : found.message->signals) {
    if (e2e || !has_any(lower(signal.name), {"crc", "checksum", "chksum"})) continue;
    companions.remarks.push_back(fmt::format(
        "{} looks like a check value; none of the kinds that `e2e` supports agrees with the frames",
        signal.name));
  }
  return companions;
}

}  // namespace vgyro::cli
