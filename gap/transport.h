#pragma once

// What goes wrong between the sensor and the log, found on raw frames before anything is regressed:
// lost frames, late stamps, values that freeze, clip, vanish around zero or lie on a lattice. What
// is found is masked or repaired, so that it cannot look like something else.

#include <cstdint>
#include <string>
#include <vector>

#include "gap/recording.h"
#include "gap/result.h"
#include "model/effect.h"

namespace vgyro::gap {

/// What a sample that a model calls impossible costs at most, in nats: the gap stays readable.
inline constexpr double kImpossibleNats = 50.0;
/// No finding is told as less sure: the frames show it by themselves.
inline constexpr double kFoundPValue = 1e-6;

/// An effect that the raw frames show by themselves.
struct Finding {
  model::Effect effect;
  model::Parameters sigma{};
  double p_value = 0.0;
  double statistic = 0.0;  ///< 2·ΔlogL, or what stands for it
  /// What it costs, over the whole recording, a model that knows nothing of it.
  double cost_nats = 0.0;
  Where where;
  std::vector<Reading> ambiguous_with;
  std::string evidence;
  Figure figure;
};

/// Why a sample is not to be used: the other reasons than a spike are the frame's or the value's.
inline constexpr std::uint8_t kSetAside = 1;
inline constexpr std::uint8_t kSpike = 2;

struct Transport {
  std::vector<double> t_s;           ///< instants of the samples, lateness taken out where found
  std::vector<std::uint8_t> masked;  ///< not to be used: kSetAside, kSpike; 0: to be used
  std::vector<double> late_s;        ///< of each stamp behind the even clock
  double interval_s = 0.0;           ///< of the even clock
  double lattice_dps = 0.0;          ///< least distance of the values
  double repeats = 0.0;              ///< share of the samples to be used that repeat the last
  double lost_share = 0.0;           ///< frames that never came
  std::vector<Finding> findings;     ///< beyond what `known` says
  std::vector<std::string> notes;
};

/// `known`: this gyro's effects in the model; what they explain is masked but not found again.
Transport check_transport(const GyroSeries& series, std::size_t gyro,
                          const std::vector<model::Effect>& known);

/// Its samples that are to be used, at their instants.
ScalarSeries usable(const GyroSeries& series, const Transport& transport);

/// What clips, or vanishes in a dead band, costs what all masked samples of its gyro cost: counts
/// them. To be called again when something else has masked more.
void count_masked(Transport& transport);

}  // namespace vgyro::gap
