#include "cli/init/guess.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include <fmt/core.h>

#include "base/angle.h"
#include "cli/init/layouts.h"
#include "cli/output/progress.h"
#include "dbc/writer.h"

namespace vgyro::cli {

namespace {

constexpr double kRateLeast_hz = 5.0;     // motion cannot be followed below it
constexpr std::size_t kFieldsMost = 400;  // the quick comparison compares each with each
constexpr std::size_t kGuessedMost = 30;  // for these the figures are computed
constexpr double kQuickLeast = 0.5;       // slightly below what a pair needs
constexpr double kGapMost_s = 0.5;
constexpr double kZero_s = 3.0;

std::string name_of(const Stream& stream, std::set<std::string>& names) {
  std::string name = fmt::format("Frame_{:0{}X}", stream.id, stream.extended ? 8 : 3);
  if (!names.insert(name).second) {
    name += "_" + stream.bus;
    std::replace_if(
        name.begin(), name.end(),
        [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
    names.insert(name);
  }
  return name;
}

/// Mean of the 64 consecutive samples that differ least, which are from a rest if there is one.
double quietest_value(const analysis::StampedSignal& series) {
  constexpr std::size_t kBlock = 64;
  double quietest = std::numeric_limits<double>::infinity();
  double value = 0.0;
  for (std::size_t i = 0; i + kBlock <= series.value.size(); i += kBlock) {
    double sum = 0.0;
    double power = 0.0;
    for (std::size_t k = i; k < i + kBlock; ++k) {
      const double off = series.value[k] - series.value[i];
      sum += off;
      power += off * off;
    }
    const double mean = sum / static_cast<double>(kBlock);
    const double variance = power / static_cast<double>(kBlock) - mean * mean;
    if (variance >= quietest) continue;
    quietest = variance;
    value = series.value[i] + mean;
  }
  return value;
}

/// Rounded to this many digits, as the nearest double to that decimal number.
double rounded(double value, int digits) {
  const std::string text = fmt::format("{:.{}e}", value, digits - 1);
  double result = value;
  std::from_chars(text.data(), text.data() + text.size(), result);
  return result;
}

/// 0; without a sign, the middle of the range of the bits, or of those that change.
std::vector<double> usual_zeros(const dbc::Signal& signal, double near) {
  std::vector<double> zeros{0.0};
  if (signal.type == dbc::ValueType::kUnsigned) {
    zeros = {std::ldexp(1.0, signal.length_bits - 1)};
    if (signal.length_bits == 16) zeros.push_back(32000.0);  // J1939
  }
  constexpr double kBitsLeast = 7.0;
  if (signal.is_integer() && near > 0.0 && std::round(std::log2(near)) >= kBitsLeast)
    zeros.push_back(std::exp2(std::round(std::log2(near))));
  return zeros;
}

/// A score like that of a name: a rate lies on both sides of its zero, while speeds, temperatures
/// and levels stay on one side.
double shape_score(const Candidate& candidate) {
  constexpr double kShareLeast = 0.02;
  const auto size = static_cast<double>(candidate.series.value.size());
  for (const double zero : usual_zeros(*candidate.signal, candidate.figures.median)) {
    const auto above = static_cast<double>(
        std::count_if(candidate.series.value.begin(), candidate.series.value.end(),
                      [&](double value) { return value > zero; }));
    const double share = above / size;
    if (share > kShareLeast && share < 1.0 - kShareLeast) return 0.5;
  }
  return -0.5;
}

// --- scales --------------------------------------------------------------------------------------

struct TypicalScale {
  double dps;
  const char* name;
};

/// Scales of sensors and vehicles on the market, the more usual ones first.
constexpr std::array kIntegerScales{
    TypicalScale{0.01, "0.01 deg/s"},
    TypicalScale{0.005, "0.005 deg/s"},
    TypicalScale{0.001 * kDegPerRad, "0.001 rad/s"},
    TypicalScale{1.0 / 128, "1/128 deg/s"},
    TypicalScale{0.001, "0.001 deg/s"},
    TypicalScale{0.02, "0.02 deg/s"},
    TypicalScale{kDegPerRad / 512, "1/512 rad/s"},
    TypicalScale{0.0002 * kDegPerRad, "0.0002 rad/s"},
    TypicalScale{0.0001 * kDegPerRad, "0.0001 rad/s"},
    TypicalScale{1e-6, "0.000001 deg/s"},
    TypicalScale{0.05, "0.05 deg/s"},
    TypicalScale{0.1, "0.1 deg/s"},
    TypicalScale{1.0 / 16, "1/16 deg/s"},
    TypicalScale{1.0 / 32, "1/32 deg/s"},
    TypicalScale{1.0 / 64, "1/64 deg/s"},
    TypicalScale{1.0 / 131, "1/131 deg/s"},
    TypicalScale{1.0 / 65.5, "1/65.5 deg/s"},
    TypicalScale{1.0 / 32.8, "1/32.8 deg/s"},
    TypicalScale{1.0 / 16.4, "1/16.4 deg/s"},
    TypicalScale{0.00875, "0.00875 deg/s"},
    TypicalScale{0.07, "0.07 deg/s"},
    TypicalScale{0.244, "0.244 deg/s"},
};
constexpr std::array kFloatScales{TypicalScale{1.0, "1 deg/s"},
                                  TypicalScale{kDegPerRad, "1 rad/s"}};

std::vector<TypicalScale> typical_scales(const Candidate& candidate) {
  if (!candidate.signal->is_integer()) return {kFloatScales.begin(), kFloatScales.end()};
  return {kIntegerScales.begin(), kIntegerScales.end()};
}

// In a useful log, a platform with wheels or wings turns at rates in this range.
constexpr double kPeakLeast_dps = 2.0;
constexpr double kPeakMost_dps = 400.0;
constexpr double kScaleTolerance = 0.03;  // scale factor errors of two cheap gyros together

double tolerance_of(const analysis::Likeness& likeness) {
  return std::max(kScaleTolerance, 2.0 * likeness.scale_error());
}

struct Scales {
  double first = 1.0;  ///< deg/s per raw number
  double second = 1.0;
  std::string why;
};

/// The scale of a raw number by comparison with a gyro of known scale; a usual scale if one is
/// close.
double by_the_other(const Candidate& guessed, double measured_dps, double tolerance,
                    std::string& why) {
  double best = rounded(measured_dps, 6);
  double off = tolerance;
  const char* name = nullptr;
  for (const TypicalScale& typical : typical_scales(guessed)) {
    const double here = std::abs(std::log(typical.dps / measured_dps));
    if (here >= off) continue;
    off = here;
    best = typical.dps;
    name = typical.name;
  }
  why += fmt::format("By the other gyro one bit of {} is {:.4g} deg/s, give or take {:.1f} %",
                     guessed.place(), measured_dps, 100.0 * tolerance);
  why += name == nullptr ? "; no usual scale is near it."
                         : fmt::format("; {}, a usual scale, was taken.", name);
  return best;
}

/// Both gyros are in raw numbers, so only the ratio of their scales is known.
Scales by_usual_pairs(const Candidate& first, const Candidate& second,
                      const analysis::Likeness& likeness) {
  using Option = std::tuple<double, TypicalScale, TypicalScale>;
  std::vector<Option> options;
  const double ratio = std::abs(likeness.scale);
  const auto firsts = typical_scales(first);
  const auto seconds = typical_scales(second);
  for (std::size_t i = 0; i < firsts.size(); ++i) {
    const double peak_dps = first.figures.peak * firsts[i].dps;
    const bool odd = peak_dps < kPeakLeast_dps || peak_dps > kPeakMost_dps;
    for (std::size_t k = 0; k < seconds.size(); ++k) {
      const double off = std::abs(std::log(seconds[k].dps * ratio / firsts[i].dps));
      if (off > tolerance_of(likeness)) continue;
      // 1 % of difference in scale costs as much as ten places in the list of usual scales.
      const double cost = static_cast<double>(i + k) + (odd ? 100.0 : 0.0) + 1000.0 * off;
      options.emplace_back(cost, firsts[i], seconds[k]);
    }
  }
  std::stable_sort(options.begin(), options.end(), [](const Option& a, const Option& b) {
    return std::get<0>(a) < std::get<0>(b);
  });
  Scales scales;
  scales.why = "The log does not show the scale, only the ratio of the two.";
  if (options.empty()) {
    scales.first = firsts.front().dps;
    scales.second = rounded(scales.first / ratio, 6);
    scales.why +=
        fmt::format(" No two usual scales have it; {} is a mere supposition.", firsts.front().name);
    return scales;
  }
  scales.first = std::get<1>(options[0]).dps;
  scales.second = std::get<2>(options[0]).dps;
  scales.why += fmt::format(" Taken were the likeliest usual ones that have it, {} and {}",
                            std::get<1>(options[0]).name, std::get<2>(options[0]).name);
  constexpr std::size_t kOthersTold = 3;
  for (std::size_t i = 1; i < std::min(options.size(), kOthersTold + 1); ++i) {
    scales.why += fmt::format("{}{} and {}", i == 1 ? "; also possible: " : "; ",
                              std::get<1>(options[i]).name, std::get<2>(options[i]).name);
  }
  scales.why += ".";
  return scales;
}

Scales scales_of(const Candidate& first, const Candidate& second,
                 const analysis::Likeness& likeness, std::optional<double> turned_deg) {
  const double ratio = std::abs(likeness.scale);
  const double tolerance = tolerance_of(likeness);
  Scales scales;
  const auto angle = turned_deg ? turned_angle(first.series) : std::nullopt;
  if (first.guessed && angle && *angle != 0.0) {
    scales.first = rounded(std::abs(*turned_deg / *angle), 6);
    scales.why = fmt::format("By the turn of {:g} deg one bit of {} is {:.4g} deg/s.", *turned_deg,
                             first.place(), scales.first);
    if (second.guessed) scales.second = rounded(scales.first / ratio, 6);
    return scales;
  }
  if (first.guessed && second.guessed) return by_usual_pairs(first, second, likeness);
  if (second.guessed) scales.second = by_the_other(second, 1.0 / ratio, tolerance, scales.why);
  if (first.guessed) scales.first = by_the_other(first, ratio, tolerance, scales.why);
  return scales;
}

/// The raw number of no rotation: a usual zero if the log's rest is close to it compared with its
/// motion. Independent of the scale, which may be wrong.
double zero_of(const Candidate& candidate) {
  const dbc::Signal& signal = *candidate.signal;
  const double rest = quietest_value(candidate.series);
  double zero = signal.is_integer() ? std::round(rest) : rest;
  double off = candidate.figures.peak;
  for (const double one : usual_zeros(signal, rest)) {
    if (std::abs(rest - one) >= off) continue;
    off = std::abs(rest - one);
    zero = one;
  }
  return zero;
}

constexpr int kDigits = 9;

dbc::Message described_message(const Candidate& candidate, double scale_dps) {
  dbc::Message message = *candidate.found.message;
  dbc::Signal rate = *candidate.signal;
  rate.name = "Rate";
  rate.factor = scale_dps;
  rate.offset = 0.0 - rounded(zero_of(candidate) * scale_dps, kDigits);
  rate.unit = "deg/s";
  rate.comment =
      "Found by trial in a log: place, length, byte order and sign are likely, scale and zero a "
      "supposition.";
  message.signals = {rate};
  for (const dbc::Signal& counter : find_counters(*candidate.found.stream))
    message.signals.push_back(counter);
  if (const auto check = find_e2e(candidate.found)) {
    dbc::Signal signal;
    signal.name = "Check";
    signal.start_bit = static_cast<std::uint16_t>(8 * check->byte);
    signal.length_bits = check->kind == "profile_5" ? 16 : 8;
    signal.comment = "A check value: " + check->kind + " agrees with the frames of the log.";
    message.signals.push_back(signal);
  }
  return message;
}

void point_into(Candidate& candidate, const dbc::Database& database, const dbc::Message& message) {
  candidate.guessed = false;
  candidate.found.database = &database;
  candidate.found.message = &message;
  candidate.signal = &message.signals.front();
  candidate.series = series_of(candidate.found, *candidate.signal, 1.0);
  candidate.figures = analysis::signal_figures(candidate.series);
}

// --- which fields are worth a closer look --------------------------------------------------------

/// Makes the series on demand: all at once would take many times the log's size.
analysis::StampedSignal series_of(const Candidate& candidate) {
  return candidate.guessed ? series_of(candidate.found, *candidate.signal, 1.0) : candidate.series;
}

struct Span {
  double begin_s = 0.0;
  double seconds = 0.0;
};

Span span_of(const std::vector<Candidate>& candidates) {
  Span all{1e300, 0.0};
  double end_s = -1e300;
  for (const Candidate& candidate : candidates) {
    const auto& kept = candidate.found.stream->kept;
    if (kept.empty()) continue;
    all.begin_s = std::min(all.begin_s, static_cast<double>(kept.front().t_ns) * 1e-9);
    end_s = std::max(end_s, static_cast<double>(kept.back().t_ns) * 1e-9);
  }
  all.seconds = std::max(0.0, end_s - all.begin_s);
  return all;
}

/// The best quick correlation of each candidate with one of another message.
std::vector<double> best_correlations(const std::vector<Candidate>& candidates) {
  const Span span = span_of(candidates);
  std::vector<analysis::ChangeShape> shapes;
  shapes.reserve(candidates.size());
  for (const Candidate& candidate : candidates)
    shapes.push_back(analysis::change_shape(series_of(candidate), span.begin_s, span.seconds));
  std::vector<double> best(candidates.size());
  Progress progress("comparing");
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    progress.update("fields", static_cast<double>(i) / static_cast<double>(candidates.size()));
    for (std::size_t k = 0; k < i; ++k) {
      if (candidates[i].found.stream == candidates[k].found.stream) continue;
      if (!candidates[k].why_not.empty()) continue;
      const double here = analysis::quick_correlation(shapes[i], shapes[k]);
      best[i] = std::max(best[i], here);
      best[k] = std::max(best[k], here);
    }
  }
  return best;
}

}  // namespace

std::unique_ptr<Guess> guess_messages(const Traffic& traffic, const std::vector<Found>& known) {
  auto guess = std::make_unique<Guess>();
  std::set<const Stream*> described;
  for (const Found& found : known)
    described.insert(found.stream);
  std::vector<const Stream*> streams;
  for (const Stream* stream : traffic.streams()) {
    if (!described.contains(stream) && stream->frames_per_s() >= kRateLeast_hz)
      streams.push_back(stream);
  }
  guess->streams = streams.size();
  guess->database.messages.reserve(streams.size());
  std::set<std::string> names;
  Progress progress("trying layouts");
  std::size_t fields = 0;
  for (std::size_t i = 0; i < streams.size() && fields < kFieldsMost; ++i) {
    progress.update("identifiers", static_cast<double>(i) / static_cast<double>(streams.size()));
    dbc::Message message;
    message.signals = find_fields(*streams[i]);
    if (message.signals.empty()) continue;
    fields += message.signals.size();
    message.name = name_of(*streams[i], names);
    message.id = streams[i]->id;
    message.extended = streams[i]->extended;
    message.size_bytes = static_cast<std::uint16_t>(usual_length(*streams[i]));
    guess->database.messages.push_back(std::move(message));
    guess->found.push_back({streams[i], &guess->database, &guess->database.messages.back()});
  }
  return guess;
}

void add_guessed(std::vector<Candidate>& candidates, const Guess& guess) {
  const std::size_t known = candidates.size();
  for (const Found& found : guess.found) {
    for (const dbc::Signal& signal : found.message->signals) {
      Candidate candidate;
      candidate.found = found;
      candidate.signal = &signal;
      candidate.guessed = true;
      candidates.push_back(std::move(candidate));
    }
  }
  const std::vector<double> best = best_correlations(candidates);
  std::vector<std::size_t> kept;
  for (std::size_t i = known; i < candidates.size(); ++i) {
    if (best[i] >= kQuickLeast) kept.push_back(i);
  }
  std::stable_sort(kept.begin(), kept.end(),
                   [&](std::size_t a, std::size_t b) { return best[a] > best[b]; });
  kept.resize(std::min(kept.size(), kGuessedMost));
  std::sort(kept.begin(), kept.end());
  std::vector<Candidate> fields;
  fields.reserve(kept.size());
  for (const std::size_t i : kept) {
    Candidate& field = fields.emplace_back(std::move(candidates[i]));
    field.series = series_of(field);
    field.figures = analysis::signal_figures(field.series);
    field.name_score = shape_score(field);
  }
  candidates.resize(known);
  std::move(fields.begin(), fields.end(), std::back_inserter(candidates));
}

std::optional<double> turned_angle(const analysis::StampedSignal& series) {
  if (series.t_s.size() < 2) return std::nullopt;
  double zero = 0.0;
  std::size_t count = 0;
  while (count < series.t_s.size() && series.t_s[count] < series.t_s[0] + kZero_s)
    zero += series.value[count++];
  zero /= static_cast<double>(count);
  double angle = 0.0;
  for (std::size_t i = 1; i < series.t_s.size(); ++i) {
    const double span_s = series.t_s[i] - series.t_s[i - 1];
    if (span_s > kGapMost_s) return std::nullopt;
    angle += span_s * (0.5 * (series.value[i] + series.value[i - 1]) - zero);
  }
  return angle;
}

std::unique_ptr<Described> describe(std::vector<Candidate>& candidates, Choice& choice,
                                    const std::string& path, std::optional<double> turned_deg) {
  if (!choice.pair) return nullptr;
  Candidate& first = candidates[choice.pair->first];
  Candidate& second = candidates[choice.pair->second];
  if (!first.guessed && !second.guessed) return nullptr;
  auto described = std::make_unique<Described>();
  described->database.path = path;
  const Scales scales = scales_of(first, second, choice.pair->likeness, turned_deg);
  described->remarks = {
      "No DBC file describes one of these gyros or both: the layout was found by trial. In a "
      "vehicle "
      "steering angle, lateral acceleration and differences of wheel speeds move like a yaw rate: "
      "is each of the two a gyro? One that is rests where the vehicle rests, however the wheels "
      "are "
      "turned.",
      scales.why};
  auto& messages = described->database.messages;
  messages.reserve(2);
  choice.pair->likeness.scale *= scales.second / scales.first;
  for (const bool is_second : {false, true}) {
    Candidate& one = is_second ? second : first;
    if (!one.guessed) continue;
    messages.push_back(described_message(one, is_second ? scales.second : scales.first));
    point_into(one, described->database, messages.back());
  }
  described->text = dbc::to_text(
      messages, "Proposed by vgyro init from a log alone. " + scales.why +
                    " Turn the platform by a known angle, and multiply the factors by the true "
                    "angle over the one that vgyro replay --csv shows.");
  return described;
}

}  // namespace vgyro::cli
