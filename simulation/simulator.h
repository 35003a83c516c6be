#pragma once

// A motion through the model of two gyros → what each of them, a reference and an accelerometer
// say, and when. Values and stamps only: no frame, no bus. The same seed gives the same samples,
// and each effect has its own random numbers: adding one leaves the others' as they are.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/error.h"
#include "model/file.h"
#include "simulation/profile.h"

namespace vgyro::simulation {

/// Samples of one stream at most.
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
  double t_s = 0.0;      ///< when it was taken, from the beginning of the motion
  double stamp_s = 0.0;  ///< what the log says of it; grows from sample to sample
  double reading_dps = 0.0;
  /// About the other axes of the unit, as it feels them: as late as the reading, without its
  /// errors. An axis that the profile does not have is 0.
  std::array<double, 3> other_rate_dps{};
  bool lost = false;  ///< taken and counted, but its frame is not there
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
  /// An error when an effect needs what the profile does not have, or when there would be too many
  /// samples.
  static Expected<Simulator> make(model::Model model, Profile profile, const Settings& settings);

  /// 0 or 1.
  [[nodiscard]] std::vector<GyroSample> gyro(std::size_t index) const;
  /// The true rate; with `axis` that about x, y or z, which is 0 where the profile does not have
  /// it.
  [[nodiscard]] std::vector<RateSample> reference(std::optional<std::size_t> axis = {}) const;
  /// An axis that the profile does not have is 0.
  [[nodiscard]] std::vector<AccelerationSample> acceleration() const;

  [[nodiscard]] const Profile& profile() const { return profile_; }
  /// Without the gyros' effects, at any time of the motion. Where the profile says nothing of it,
  /// the temperature is kTemperature_c.
  [[nodiscard]] double temperature_c(double t_s) const;
  static constexpr double kTemperature_c = 25.0;
  /// At any time of the motion. Where the profile says nothing of it, the supply is kSupply_v.
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
