#include "simulation/simulator.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <span>

#include <fmt/core.h>

#include "base/angle.h"
#include "model/catalogue.h"
#include "model/equation.h"
#include "model/temperature_past.h"
#include "simulation/gyro_chain.h"
#include "simulation/low_pass.h"
#include "simulation/noise_source.h"

namespace vgyro::simulation {

namespace {

using model::Effect;
using model::Kind;

constexpr double kVibrationWindow_s = 1.0;
// A bus keeps the order of a sender's frames; in a log they are at least a microsecond apart.
constexpr double kStampStep_s = 1e-6;
// Names of random number streams besides the gyros and kinds; docs/simulate.md lists them.
constexpr std::string_view kJitterOfAll = "jitter";
constexpr std::string_view kReferenceSender = "reference";
constexpr std::string_view kAccelerometerSender = "accelerometer";

// Includes a sample at the very end of the motion.
std::size_t sample_count(const Timing& timing, double length_s) {
  const double intervals = (length_s - timing.offset_s) * timing.rate_hz;
  return intervals < 0.0 ? 0 : static_cast<std::size_t>(std::floor(intervals + 1e-6)) + 1;
}

double sample_time_s(const Timing& timing, std::size_t n) {
  return timing.offset_s + static_cast<double>(n) / timing.rate_hz;
}

// The stamp of a frame in the log: the sender's clock, then delays.
class Stamps {
 public:
  Stamps(std::span<const Effect> effects, const Settings& settings, std::string_view sender)
      : equation_(effects),
        jitters_{{settings.jitter_s, NoiseSource(settings.seed, sender, kJitterOfAll, 0)}} {
    std::uint32_t ordinal = 0;
    for (const Effect& effect : effects) {
      if (effect.kind != Kind::kTimestampJitter) continue;
      const std::string_view purpose = model::info(effect.kind).name;
      jitters_.push_back(
          {effect.parameters[0], NoiseSource(settings.seed, sender, purpose, ordinal++)});
    }
  }

  double next(double t_s) {
    double stamp_s = equation_.stamp_s(t_s);
    for (Jitter& jitter : jitters_)
      stamp_s += std::abs(jitter.sigma_s * jitter.source.normal());
    last_s_ = std::max(stamp_s, last_s_ + kStampStep_s);
    return last_s_;
  }

 private:
  struct Jitter {
    double sigma_s;
    NoiseSource source;
  };
  model::Equation equation_;
  std::vector<Jitter> jitters_;
  double last_s_ = -1.0;
};

// Each effect dropped_frames loses its own share.
class Losses {
 public:
  Losses(std::span<const Effect> effects, std::uint64_t seed) {
    for (const Effect& effect : effects) {
      if (effect.kind != Kind::kDroppedFrames) continue;
      losses_.push_back({effect.parameters[0],
                         NoiseSource(seed, kGyroSenders[effect.gyro], model::info(effect.kind).name,
                                     static_cast<std::uint32_t>(losses_.size()))});
    }
  }

  bool next() {
    bool lost = false;
    for (Loss& loss : losses_)
      lost = loss.source.uniform() < loss.fraction || lost;
    return lost;
  }

 private:
  struct Loss {
    double fraction;
    NoiseSource source;
  };
  std::vector<Loss> losses_;
};

std::vector<Effect> effects_of(const model::Model& model, std::size_t gyro) {
  std::vector<Effect> effects;
  std::copy_if(model.effects.begin(), model.effects.end(), std::back_inserter(effects),
               [&](const Effect& effect) { return effect.gyro == gyro; });
  return effects;
}

std::string missing_temperature(const Effect& /*effect*/, const Profile& profile) {
  return profile.temperature_c ? "" : "temperature_c";
}

// Checks the axis of a kind that has one, or any axis.
std::string missing_acceleration(const Effect& effect, const Profile& profile) {
  const std::span<const model::Parameter> parameters = model::info(effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].form != model::Parameter::Form::kAxis) continue;
    const auto axis = static_cast<std::size_t>(effect.parameters[i]);
    return profile.acceleration_g[axis] ? "" : fmt::format("acc_{}_g", "xyz"[axis]);
  }
  return profile.has_acceleration() ? "" : "acc_x_g, acc_y_g, acc_z_g";
}

std::string missing_supply(const Effect& /*effect*/, const Profile& profile) {
  return profile.supply_v ? "" : "supply_v";
}

std::string missing_other_rate(const Effect& effect, const Profile& profile) {
  const auto axis = static_cast<std::size_t>(effect.parameters[0]);
  return profile.other_rate_dps[axis] ? "" : fmt::format("rate_{}_dps", "xyz"[axis]);
}

struct InputColumn {
  model::Need need;
  /// Returns the missing column; empty if it is present.
  std::string (*missing)(const Effect& effect, const Profile& profile);
};
constexpr InputColumn kInputColumns[] = {{model::kNeedsTemperature, missing_temperature},
                                         {model::kNeedsAcceleration, missing_acceleration},
                                         {model::kNeedsSupply, missing_supply},
                                         {model::kNeedsOtherAxes, missing_other_rate}};
static_assert(model::answers_each_need(kInputColumns));

std::string missing_column(const Effect& effect, const Profile& profile) {
  for (const InputColumn& input : kInputColumns) {
    if ((model::info(effect.kind).needs & input.need) == 0) continue;
    std::string missing = input.missing(effect, profile);
    if (!missing.empty()) return missing;
  }
  return {};
}

Expected<void> check_columns(const model::Model& model, const Profile& profile) {
  for (const Effect& effect : model.effects) {
    const std::string column = missing_column(effect, profile);
    if (column.empty()) continue;
    return fail(at_line(model.file, effect.line),
                fmt::format("{} needs what {} does not contain", model::info(effect.kind).name,
                            profile.file),
                "a profile with the column " + column);
  }
  return {};
}

}  // namespace

Expected<Simulator> Simulator::make(model::Model model, Profile profile, const Settings& settings) {
  if (const auto good = check_columns(model, profile); !good) return tl::unexpected(good.error());
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::size_t count = LowPass::stages_of(model::Equation(effects_of(model, gyro)));
    if (count <= LowPass::kStagesMax) continue;
    return fail(model.file,
                fmt::format("the low-passes of gyro {} are of order {} in all", gyro + 1, count),
                fmt::format("at most {}", LowPass::kStagesMax));
  }
  for (const Timing& timing :
       {settings.gyros[0], settings.gyros[1], settings.reference, settings.accelerometer}) {
    assert(timing.rate_hz > 0.0 && timing.offset_s >= 0.0);
    if (profile.length_s * timing.rate_hz <= kSamplesMax) continue;
    return fail(profile.file,
                fmt::format("{:g} s at {:g} Hz are more samples than are simulated at once",
                            profile.length_s, timing.rate_hz),
                fmt::format("at most {:g}", kSamplesMax));
  }
  Simulator simulator(std::move(model), std::move(profile), settings);
  simulator.measure_vibration();
  return simulator;
}

Simulator::Simulator(model::Model model, Profile profile, const Settings& settings)
    : model_(std::move(model)), profile_(std::move(profile)), settings_(settings) {}

std::array<double, 3> Simulator::acceleration_at(double t_s) const {
  std::array<double, 3> acceleration_g{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto& curve = profile_.acceleration_g[axis];
    if (curve) acceleration_g[axis] = curve->value(t_s);
  }
  return acceleration_g;
}

// Measured as the gateway does: the variance of the accelerometer's samples in the second that ends
// with the newest. Sums are relative to the first value to keep their digits.
void Simulator::measure_vibration() {
  if (!profile_.has_acceleration()) return;
  const Timing& timing = settings_.accelerometer;
  const std::size_t count = sample_count(timing, profile_.length_s);
  const auto window =
      static_cast<std::size_t>(std::max(1.0, std::round(kVibrationWindow_s * timing.rate_hz)));
  std::vector<double> sums(count + 1, 0.0);
  std::vector<double> squares(count + 1, 0.0);
  double pivot_g = 0.0;
  for (std::size_t n = 0; n < count; ++n) {
    const auto a = acceleration_at(sample_time_s(timing, n));
    const double size_g = std::hypot(a[0], a[1], a[2]);
    if (n == 0) pivot_g = size_g;
    sums[n + 1] = sums[n] + (size_g - pivot_g);
    squares[n + 1] = squares[n] + (size_g - pivot_g) * (size_g - pivot_g);
  }
  for (std::size_t n = 1; n <= count; ++n) {
    const std::size_t first = n > window ? n - window : 0;
    const auto size = static_cast<double>(n - first);
    const double mean = (sums[n] - sums[first]) / size;
    vibration_g2_.push_back(std::max(0.0, (squares[n] - squares[first]) / size - mean * mean));
  }
}

double Simulator::temperature_c(double t_s) const {
  return profile_.temperature_c ? profile_.temperature_c->value(t_s) : kTemperature_c;
}

double Simulator::supply_v(double t_s) const {
  return profile_.supply_v ? profile_.supply_v->value(t_s) : kSupply_v;
}

model::Surroundings Simulator::surroundings(double t_s) const {
  model::Surroundings s{.t_s = t_s, .angle_rad = profile_.rate_dps.integral(t_s) * kRadPerDeg};
  if (profile_.temperature_c) {
    s.temperature_c = profile_.temperature_c->value(t_s);
    s.temperature_slope_c_s = profile_.temperature_c->slope(t_s);
  }
  if (profile_.supply_v) s.supply_v = profile_.supply_v->value(t_s);
  if (!profile_.has_acceleration()) return s;
  s.acceleration_g = acceleration_at(t_s);
  const Timing& timing = settings_.accelerometer;
  const double sample = std::floor((t_s - timing.offset_s) * timing.rate_hz + 1e-6);
  s.vibration_g2 =
      sample < 0.0 || vibration_g2_.empty()
          ? 0.0
          : vibration_g2_[std::min(static_cast<std::size_t>(sample), vibration_g2_.size() - 1)];
  return s;
}

namespace {

// The rates about other axes after one gyro's delays and low-passes.
class OtherAxes {
 public:
  OtherAxes(const Profile& profile, const model::Equation& equation) : equation_(equation) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& curve = profile.other_rate_dps[axis];
      if (curve) low_passes_[axis].emplace(*curve, equation);
    }
  }

  /// Unknown if the profile lacks the axis. Precondition: t never decreases.
  std::array<double, 3> at(double t_s) {
    std::array<double, 3> rate_dps{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      rate_dps[axis] = low_passes_[axis] ? low_passes_[axis]->at(equation_.felt_at_s(t_s))
                                         : model::Surroundings::kUnknown;
    }
    return rate_dps;
  }

 private:
  const model::Equation& equation_;
  std::array<std::optional<LowPass>, 3> low_passes_;
};

std::array<double, 3> known_or_0(std::array<double, 3> rate_dps) {
  for (double& rate : rate_dps)
    rate = std::isnan(rate) ? 0.0 : rate;
  return rate_dps;
}

}  // namespace

std::vector<GyroSample> Simulator::gyro(std::size_t index) const {
  const std::vector<Effect> effects = effects_of(model_, index);
  const Timing& timing = settings_.gyros[index];
  const model::Equation equation(effects);
  LowPass low_pass(profile_.rate_dps, equation);
  const auto low_passed = [&](double t_s) { return low_pass.at(t_s); };
  GyroChain chain(effects, 1.0 / timing.rate_hz, settings_.seed);
  Stamps stamps(effects, settings_, kGyroSenders[index]);
  Losses losses(effects, settings_.seed);
  OtherAxes other_axes(profile_, equation);
  model::TemperaturePast past;
  std::vector<GyroSample> samples(sample_count(timing, profile_.length_s));
  for (std::size_t n = 0; n < samples.size(); ++n) {
    const double t_s = sample_time_s(timing, n);
    const double late_dps = equation.late_rate_dps(low_passed, t_s);
    model::Surroundings around = surroundings(t_s);
    if (profile_.temperature_c) {
      past.add(around.temperature_c);
      around.temperature_past = &past;
    }
    around.other_rate_dps = other_axes.at(t_s);
    samples[n] = {.t_s = t_s,
                  .stamp_s = stamps.next(t_s),
                  .reading_dps = chain.next(late_dps, around),
                  .other_rate_dps = known_or_0(around.other_rate_dps),
                  .lost = losses.next()};
  }
  return samples;
}

std::vector<RateSample> Simulator::reference(std::optional<std::size_t> axis) const {
  const Curve* rate_dps = &profile_.rate_dps;
  if (axis) rate_dps = profile_.other_rate_dps[*axis] ? &*profile_.other_rate_dps[*axis] : nullptr;
  Stamps stamps({}, settings_, kReferenceSender);
  std::vector<RateSample> samples(sample_count(settings_.reference, profile_.length_s));
  for (std::size_t n = 0; n < samples.size(); ++n) {
    const double t_s = sample_time_s(settings_.reference, n);
    samples[n] = {stamps.next(t_s), rate_dps == nullptr ? 0.0 : rate_dps->value(t_s)};
  }
  return samples;
}

std::vector<AccelerationSample> Simulator::acceleration() const {
  Stamps stamps({}, settings_, kAccelerometerSender);
  std::vector<AccelerationSample> samples(sample_count(settings_.accelerometer, profile_.length_s));
  for (std::size_t n = 0; n < samples.size(); ++n) {
    const double t_s = sample_time_s(settings_.accelerometer, n);
    samples[n] = {stamps.next(t_s), acceleration_at(t_s)};
  }
  return samples;
}

}  // namespace vgyro::simulation
