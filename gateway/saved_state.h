#pragma once

// The pipeline's learned state of its gyros, to be kept across a restart, and its form as text:
// TOML that people can read, with a checksum over every byte of it. Reading trusts nothing: a text
// that is cut, changed, or holds an impossible number is refused. The driver keeps the
// text.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "fusion/drift_memory.h"
#include "fusion/misalignment.h"
#include "fusion/pair_relation.h"
#include "gateway/heading.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// Longer texts are not looked at; a saved state takes about 3 kB.
inline constexpr std::size_t kSavedStateBytesMax = 16U << 10U;

struct SavedState {
  fusion::DriftMemory drift;
  TimePoint rate_stamp;  ///< of the last rate, on the clock of the frames
  std::array<std::optional<double>, 2> temperature_c;  ///< of the gyros, if they send it
  std::array<std::string, 2> devices;                  ///< device_of() the gyros
  double rest_rate_dps = 0.0;                          ///< what the biases were learned against
  fusion::PairVerdict pair;  ///< a contradiction, which only motion can take back
  /// Of a platform of several axes: a state of each that has one; what stands above is the first's.
  std::vector<SavedState> axes = {};
  std::size_t axis = 0;                        ///< of one of these: which
  std::optional<double> earth_doubt_dps = {};  ///< of one of these: AxisPipeline::earth_doubt_dps()
  std::optional<fusion::MisalignmentMemory> misalignment = {};
  std::optional<HeadingMemory> heading = {};
};

/// What must be the same for the biases of a gyro to mean the same: bus, identifier, signal, scale,
/// sign, its name and what the model file takes off it. For people too; what is not printable ASCII
/// stands there as %C3%B6.
std::string device_of(const GyroPlan& gyro);

/// Error when the state is of other gyros than the plan's.
Expected<void> check_devices(const SavedState& state, const Plan& plan);

std::string to_text(const SavedState& state);

/// Every number comes back as it was. `where` names the text in the error.
Expected<SavedState> saved_state_from(std::string_view text, const std::string& where);

}  // namespace vgyro::gateway
