#include "cli/init/candidates.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "base/spelling.h"
#include "cli/init/words.h"
#include "dbc/codec.h"
#include "dbc/codes.h"
#include "dbc/multiplex.h"
#include "gateway/units.h"

namespace vgyro::cli {

namespace {

constexpr std::size_t kFramesLeast = 32;
constexpr double kRateLeast_hz = 5.0;     // motion cannot be followed below it
constexpr double kPeakMost_dps = 3000.0;  // more is an engine, not a platform

/// The sign bit, if the rate is a magnitude.
const dbc::Signal* sign_of(const dbc::Message& message, const dbc::Signal& rate) {
  if (rate.type != dbc::ValueType::kUnsigned || rate.offset < 0.0) return nullptr;
  const dbc::Signal* sign = nullptr;
  for (const dbc::Signal& other : message.signals) {
    if (other.length_bits != 1 || !has_any(lower(other.name), {"sign", "vorz", "_vz", "direction"}))
      continue;
    // If a message has several, prefer the nearest name.
    const bool nearer = sign == nullptr || other.name.find(rate.name.substr(0, 4)) == 0;
    if (nearer) sign = &other;
  }
  return sign;
}

/// For a signal without a unit: judges by the name, unless that belongs to a companion of a rate
/// ("YawRateCrc").
bool is_rate_by_name(const dbc::Signal& signal) {
  constexpr unsigned kBitsLeast = 8;
  if (!signal.unit.empty() || signal.length_bits < kBitsLeast) return false;
  if (!signal.labels.empty() && signal.length_bits == kBitsLeast) return false;
  if (has_any(lower(signal.name),
              {"crc", "check", "count", "cnt", "status", "state", "flag", "valid", "qual", "merit",
               "sign", "temp", "angle", "acc", "bias", "offset"}))
    return false;
  return name_score(signal.name, "") > 0.7;
}

std::optional<Candidate> candidate_of(const Found& found, const dbc::Signal& signal) {
  const auto known = gateway::convert_unit(gateway::Dimension::kRate, signal.unit);
  const double score = name_score(signal.name, found.message->name);
  if (!known && !is_rate_by_name(signal)) return std::nullopt;
  Candidate candidate;
  candidate.found = found;
  candidate.signal = &signal;
  candidate.name_score = score;
  if (!known) candidate.assumed_unit = "deg/s";
  const dbc::Signal* sign = sign_of(*found.message, signal);
  if (sign != nullptr) candidate.sign_signal = sign->name;
  candidate.series = series_of(found, signal, known ? known->scale : 1.0, sign);
  if (candidate.series.t_s.size() < kFramesLeast) return std::nullopt;
  candidate.figures = analysis::signal_figures(candidate.series);
  const double level = std::abs(candidate.figures.median) + candidate.figures.peak;
  if (!candidate.figures.changes) {
    candidate.why_not = "never changes";
  } else if (found.stream->frames_per_s() < kRateLeast_hz) {
    candidate.why_not = fmt::format("fewer than {:g} frames a second", kRateLeast_hz);
  } else if (level > kPeakMost_dps) {
    candidate.why_not = fmt::format("reaches {:.0f} deg/s: no platform turns so fast", level);
  } else if (score <= -2.0) {
    candidate.why_not = "its name is that of another rotating part";
  }
  return candidate;
}

}  // namespace

double name_score(std::string_view signal, std::string_view message) {
  const std::string name = lower(signal);
  const std::string both = name + " " + lower(message);
  if (has_any(name, {"engine", "motor", "eng_", "rpm", "wheel", "steer", "lenk", "shaft", "gear"}))
    return -2.0;
  if (has_any(both, {"steer", "lenk", "engine", "wheel"})) return -2.0;
  if (has_any(name, {"roll", "pitch", "wank", "nick"})) return -1.0;
  // Computed from other sensors: suitable to judge gyros, but not a gyro.
  if (has_any(both, {"pose", "gnss", "gps", "camera", "table", "reference"})) return -0.6;
  if (has_any(name, {"yaw", "gier", "turn", "omega_z", "wz"})) return 1.0;
  if (name.ends_with("z")) return 0.8;
  if (name.ends_with("x") || name.ends_with("y")) return -1.0;
  if (has_any(both, {"yaw", "gyro", "rate", "gier", "imu"})) return 0.4;
  return 0.0;
}

std::string Candidate::place() const {
  if (guessed) {
    return fmt::format("{} {:03X} byte {}, {} bits{}", found.stream->bus, found.stream->id,
                       signal->start_bit / 8, signal->length_bits,
                       signal->byte_order == dbc::ByteOrder::kIntel ? "" : ", Motorola");
  }
  return fmt::format("{} {}.{}", found.stream->bus, found.message->name, signal->name);
}

std::vector<Found> find_messages(const Traffic& traffic,
                                 const std::vector<dbc::Database>& databases) {
  std::vector<Found> all;
  for (const Stream* stream : traffic.streams()) {
    Found best{stream, nullptr, nullptr};
    int closest = 0;
    for (const dbc::Database& database : databases) {
      for (const dbc::Message& message : database.messages) {
        if (!message.matches(stream->id, stream->extended)) continue;
        const int close = message.id == stream->id                   ? 3
                          : dbc::same_sender(message.id, stream->id) ? 2
                                                                     : 1;
        if (close <= closest) continue;
        closest = close;
        best = {stream, &database, &message};
      }
    }
    if (best.message != nullptr) all.push_back(best);
  }
  return all;
}

analysis::StampedSignal series_of(const Found& found, const dbc::Signal& signal, double scale,
                                  const dbc::Signal* sign) {
  analysis::StampedSignal series;
  const auto codec = dbc::SignalCodec::make(signal, found.message->size_bytes, "");
  const auto presence = dbc::Presence::make(*found.message, signal, "");
  if (!codec || !presence) return series;
  std::optional<dbc::SignalCodec> sign_codec;
  if (sign != nullptr) {
    if (auto made = dbc::SignalCodec::make(*sign, found.message->size_bytes, ""))
      sign_codec = *made;
  }
  const bool limited = dbc::has_reachable_range(signal, *codec);
  if (signal.is_integer()) series.step = std::abs(signal.factor * scale);
  const dbc::NoValues no_values(signal, found.message->codes);
  double newest_s = -1e300;
  const auto& kept = found.stream->kept;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const Stream::Kept& frame = kept[i];
    // A stamp above the next one was too late; it would make all others up to it seem too early.
    if (i + 1 < kept.size() && kept[i + 1].t_ns < frame.t_ns) continue;
    const auto payload = found.stream->payload(frame);
    if (!codec->fits(payload.size()) || !presence->holds(payload)) continue;
    const dbc::Reading reading = codec->decode(payload);
    if (!std::isfinite(reading.value) || no_values.contains(reading.raw)) continue;
    if (limited && (reading.value < signal.minimum || reading.value > signal.maximum)) continue;
    // A double holds stamps since the epoch to a quarter of a microsecond.
    const double t_s = static_cast<double>(frame.t_ns) * 1e-9;
    if (t_s <= newest_s) continue;
    newest_s = t_s;
    const bool negative =
        sign_codec && sign_codec->fits(payload.size()) && sign_codec->decode(payload).raw != 0;
    series.t_s.push_back(t_s);
    series.value.push_back(reading.value * (negative ? -scale : scale));
  }
  return series;
}

std::vector<Candidate> find_candidates(const std::vector<Found>& messages) {
  std::vector<Candidate> all;
  for (const Found& found : messages) {
    for (const dbc::Signal& signal : found.message->signals) {
      if (auto candidate = candidate_of(found, signal)) all.push_back(std::move(*candidate));
    }
  }
  return all;
}

}  // namespace vgyro::cli
