#include "gateway/condition_text.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

namespace vgyro::gateway {

namespace {

using fusion::Hypothesis;

constexpr std::uint64_t kFruitlessMin = 3;  // fewer are not a pattern
constexpr double kSecondsPerHour = 3600.0;
constexpr double kDegPerHourAnHour = kSecondsPerHour * kSecondsPerHour;  // for 1 (deg/s)/s

double of(const Probabilities& probability, Hypothesis hypothesis) {
  return probability[static_cast<std::size_t>(hypothesis)];
}

void add(std::string& text, const char* separator, const std::string& part) {
  if (!text.empty()) text += separator;
  text += part;
}

void add_likely(std::string& text, const char* separator, const std::string& words, double p) {
  if (p > kWorthTelling) add(text, separator, fmt::format("{} {:.0f} %", words, 100.0 * p));
}

// Rounded to the second significant digit of σ, without an exponent.
std::string with_doubt(double value, double sigma) {
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 6);
  const double step = std::pow(10.0, -decimals);
  const double rounded = std::round(value / step) * step + 0.0;  // no "-0"
  return fmt::format("{:+.{}f} ± {:.{}f}", rounded, decimals, sigma, decimals);
}

// Two decimals; two significant digits below 0.1.
std::string times(double slope) {
  return std::abs(slope) < 0.1 ? fmt::format("{:.2g}", slope) : fmt::format("{:.2f}", slope);
}

struct UnitMistake {
  double factor;
  const char* units;
};
// Factors that are typical of a wrong unit or a wrong byte.
constexpr UnitMistake kMistakes[] = {{6.0, "rpm and deg/s"},
                                     {10.0, "a factor of ten"},
                                     {17.453292519943295, "mrad/s and deg/s"},
                                     {57.29577951308232, "rad/s and deg/s"},
                                     {100.0, "a factor of a hundred"},
                                     {256.0, "a byte more or less"},
                                     {360.0, "turns a second and deg/s"},
                                     {1000.0, "a factor of a thousand"},
                                     {3600.0, "deg/s and deg/h"},
                                     {65536.0, "two bytes more or less"},
                                     {206264.80624709636, "rad/s and deg/h"}};
// Scale factors scatter, and so do slopes estimated from motion.
constexpr double kMistakeTolerance = 0.25;

std::string unit_guess(double slope) {
  const double factor = std::max(slope, 1.0 / slope);
  const UnitMistake* nearest = nullptr;
  double least = kMistakeTolerance;
  for (const UnitMistake& mistake : kMistakes) {
    const double away = std::abs(std::log(factor / mistake.factor));
    if (away > least) continue;
    least = away;
    nearest = &mistake;
  }
  return nearest == nullptr ? "" : fmt::format("{}?", nearest->units);
}

}  // namespace

SteadyStretches steady_stretches(const Status& status) {
  return {status.stops, status.stops_refused, status.stops_open};
}

std::string stretches_text(const SteadyStretches& stretches) {
  const std::uint64_t all = stretches.learned + stretches.refused;
  if (all == 0) return {};
  std::string text = fmt::format("{} steady stretch{}: ", all, all == 1 ? "" : "es");
  std::string parts;
  if (stretches.learned > 0) {
    parts =
        fmt::format("{} {} learned", stretches.learned, stretches.learned == 1 ? "stop" : "stops");
  }
  if (stretches.refused > 0)
    add(parts, ", ", fmt::format("{} refused: turning together", stretches.refused));
  text += parts;
  if (stretches.open > 0) {
    text += fmt::format("; {} of these left open: stop and turn could not be distinguished",
                        stretches.open);
  }
  return text;
}

std::string stretches_advice(const SteadyStretches& stretches) {
  const std::uint64_t all = stretches.learned + stretches.refused;
  const std::uint64_t fruitless = stretches.refused + stretches.open;
  if (fruitless < kFruitlessMin || 2 * fruitless <= all) return {};
  return "little was learned from most of them: if the platform stood still in them, check the "
         "true "
         "rate at rest (rate_dps or latitude_deg in [calibration]) and max_bias_dps of both gyros; "
         "wheel speeds ([speed]) distinguish stops from turns";
}

std::string hypotheses_text(const Probabilities& probability, const GyroNames& names) {
  std::string text;
  add_likely(text, ", ", "standing", of(probability, Hypothesis::kStanding));
  add_likely(text, ", ", "turning steadily", of(probability, Hypothesis::kTurning));
  for (const std::size_t gyro : {0U, 1U}) {
    const auto stepped = gyro == 0 ? Hypothesis::kGyro1Stepped : Hypothesis::kGyro2Stepped;
    add_likely(text, "; ", fmt::format("gyro {} has stepped", names[gyro]),
               of(probability, stepped));
  }
  for (const std::size_t gyro : {0U, 1U}) {
    const auto blind = gyro == 0 ? Hypothesis::kGyro1Blind : Hypothesis::kGyro2Blind;
    add_likely(text, "; ", fmt::format("gyro {} feels no rotation", names[gyro]),
               of(probability, blind));
  }
  return text;
}

std::string innovation_text(double normalized_innovation) {
  if (!(normalized_innovation > kInnovationHigh)) return {};
  return fmt::format(
      "the measurements of the drifts scatter {:.1f} times more than expected (normalised "
      "innovation {:.1f}, expected 1): more noise, faster drifts or larger scale factors than "
      "assumed",
      std::sqrt(normalized_innovation), normalized_innovation);
}

// If no other kind is likely, the method distinguishes none, so the random walk is no finding
// either.
std::string drift_kind_text(const Probabilities& probability) {
  const double warming = of(probability, Hypothesis::kWarmingUp);
  const double own = of(probability, Hypothesis::kOwnSlopes);
  const double alike = of(probability, Hypothesis::kAlikeSlopes);
  std::string text;
  add_likely(text, ", ", "warming up", warming);
  add_likely(text, ", ", "slopes of their own", own);
  add_likely(text, ", ", "slopes alike", alike);
  if (text.empty()) return {};
  add_likely(text, ", ", "random walk", 1.0 - warming - own - alike);
  return text;
}

std::string ambiguity_text(const Probabilities& probability, const GyroNames& names) {
  const std::string readings = hypotheses_text(probability, names);
  return "what the gyros show can be read in two ways, and σ spans both" +
         (readings.empty() ? "" : ": " + readings);
}

std::string slopes_text(const std::array<double, 2>& slope_dps_s,
                        const std::array<double, 2>& sigma_dps_s, const GyroNames& names) {
  std::string text;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!std::isfinite(slope_dps_s[gyro]) || !(sigma_dps_s[gyro] > 0.0)) continue;
    add(text, ", ",
        names[gyro] + ' ' +
            with_doubt(slope_dps_s[gyro] * kDegPerHourAnHour,
                       sigma_dps_s[gyro] * kDegPerHourAnHour));
  }
  return text.empty() ? text : text + " deg/h an hour";
}

std::string blind_text() {
  return "does not feel the rotation that the other one feels, and is left out";
}

std::string blind_advice() {
  return "is its axis parallel to the other one's, is it switched on and past its self-test, is "
         "its "
         "frame the right one?";
}

std::string contradiction_text(const fusion::PairVerdict& pair, const GyroNames& names) {
  using fusion::Contradiction;
  const std::string moves = names[1] + " moves " + times(pair.slope) + " times " + names[0];
  switch (pair.contradiction) {
    case Contradiction::kNone:
      return {};
    case Contradiction::kSign: {
      const std::string unit = unit_guess(std::abs(pair.slope));
      return moves + ": sign = -1?" + (unit.empty() ? "" : " And " + unit);
    }
    case Contradiction::kScale: {
      const std::string unit = unit_guess(pair.slope);
      return moves + ": " + (unit.empty() ? "is its unit, or its factor, right?" : unit);
    }
    case Contradiction::kLag: {
      const std::size_t late = pair.lag_s > 0.0 ? 1 : 0;
      return fmt::format(
          "{} moves {:.1f} s later than {}: does one of them come from a queue, or from "
          "another clock?",
          names[late], std::abs(pair.lag_s), names[1 - late]);
    }
    case Contradiction::kUnrelated:
      return fmt::format(
          "{} and {} both move, and not together: the same axis, the same vehicle, the right "
          "signal, the right byte order?",
          names[0], names[1]);
    case Contradiction::kErratic:
      return fmt::format(
          "the values of {} jump, or stand, where no gyro's do: byte order, start bit, "
          "signed or unsigned?",
          pair.gyro < names.size() ? names[pair.gyro] : "one gyro");
  }
  return {};
}

std::string contradiction_advice() {
  return "the data do not show which gyro is wrong, so no rate is valid until they move together; "
         "look at sign, unit, message and signal of both (`vgyro check` shows them)";
}

std::string counter_text(const GyroStatus& gyro) {
  if (!gyro.counter_turns_at) return {};
  return fmt::format("its counter always goes from {0} back to 0: counter_max = {0}?",
                     *gyro.counter_turns_at);
}

std::string rates_too_far_apart_text() {
  return "one gyro sends so much more often than the other that no pairs can be made of them; up "
         "to "
         "2000 times as often is possible";
}

std::string restarts_text(std::uint64_t restarts) {
  return fmt::format(
      "the estimate was not finite and was restarted {}: a fault of vgyro itself, please "
      "report it with the recording",
      restarts == 1 ? std::string("once") : fmt::format("{} times", restarts));
}

}  // namespace vgyro::gateway
