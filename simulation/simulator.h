#pragma once

// Applies the model of two gyros to a motion: the values and stamps of each gyro, a reference and
// an accelerometer. No frames, no bus. The same seed gives the same samples, and each effect has
// its own random numbers: adding one leaves those of the others unchanged.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/error.h"
#include "model/file.h"
#include "simulation/profile.h"

namespace vgyro::simulation {

/// Limit of samples in one stream.
inline constexpr double kSamplesMax = 1e7;

struct Timing {
  double rate_hz = 100.0;
  double offset_s = 0.0;  ///< of the first sample
};

struct Settings {
  std::array<Timing, 2> gyros{};
  Timing reference{};
  Timing accelerometer{};
  /// Every frame is late by |N(0, jitter_s)|, in addition to the model's timestamp_jitter.
  double jitter_s = 0.0;
  std::uint64_t seed = 1;
};

struct GyroSample {
  double t_s = 0.0;      ///< time of the sample since the beginning of the motion
  double stamp_s = 0.0;  ///< its stamp in the log; increases from sample to sample
  double reading_dps = 0.0;
  /// About the unit's other axes as the gyro senses them: with the same lag as the reading, without
  /// its errors. 0 for an axis that the profile lacks.
  std::array<double, 3> other_rate_dps{};
  bool lost = false;  ///< the sample was taken and counted, but its frame is lost
};

struct RateSample {
  double stamp_s = 0.0;
  double rate_dps = 0.0;
};

struct AccelerationSample {
  double stamp_s = 0.0;
  std::array<double, 3> acceleration_g{};
};

class Simulator {
 public:
  /// Error if an effect needs a column that the profile lacks, or if there would be too many
  /// samples.
  static Expected<Simulator> make(model::Model model, Profile profile, const Settings& settings);

  /// 0 or 1.
  [[nodiscard]] std::vector<GyroSample> gyro(std::size_t index) const;
  /// The true rate; with `axis` that about x, y or z, which is 0 if the profile lacks it.
  [[nodiscard]] std::vector<RateSample> reference(std::optional<std::size_t> axis = {}) const;
  /// 0 for an axis that the profile lacks.
  [[nodiscard]] std::vector<AccelerationSample> acceleration() const;

  [[nodiscard]] const Profile& profile() const { return profile_; }
  /// Without the gyros' effects, at any time of the motion; kTemperature_c if the profile has no
  /// temperature.
  [[nodiscard]] double temperature_c(double t_s) const;
  static constexpr double kTemperature_c = 25.0;
  /// At any time of the motion; kSupply_v if the profile has no supply voltage.
  [[nodiscard]] double supply_v(double t_s) const;
  static constexpr double kSupply_v = 5.0;

 private:
  Simulator(model::Model model, Profile profile, const Settings& settings);

  [[nodiscard]] model::Surroundings surroundings(double t_s) const;
  [[nodiscard]] std::array<double, 3> acceleration_at(double t_s) const;
  void measure_vibration();

  model::Model model_;
  Profile profile_;
  Settings settings_;
  std::vector<double> vibration_g2_;  ///< after each sample of the accelerometer
};

}  // namespace vgyro::simulation
