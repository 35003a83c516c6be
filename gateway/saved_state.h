#pragma once

// The learned state of the gyros that is kept across a restart, and its text form: TOML that people
// can read, with a checksum over every byte. The reader trusts nothing: it refuses a text that is
// cut, changed, or holds an impossible number. The caller stores the text.

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

/// Longer texts are refused; a saved state takes about 3 kB.
inline constexpr std::size_t kSavedStateBytesMax = 16U << 10U;

struct SavedState {
  fusion::DriftMemory drift;
  TimePoint rate_stamp;  ///< stamp of the last rate, on the clock of the frames
  std::array<std::optional<double>, 2> temperature_c;  ///< of the gyros that send it
  std::array<std::string, 2> devices;                  ///< device_of() each gyro
  double rest_rate_dps = 0.0;                          ///< true rate at rest against which the
                                                       ///< biases were learned
  fusion::PairVerdict pair;  ///< a contradiction, which only motion can withdraw
  /// With several axes: the state of each axis that has one; the members above are the first one's.
  std::vector<SavedState> axes = {};
  std::size_t axis = 0;                        ///< in an element of `axes`: which axis it is
  std::optional<double> earth_doubt_dps = {};  ///< in an element of `axes`:
                                               ///< AxisPipeline::earth_doubt_dps()
  std::optional<fusion::MisalignmentMemory> misalignment = {};
  std::optional<HeadingMemory> heading = {};
};

/// Everything that must be unchanged for the biases of a gyro to keep their meaning: bus,
/// identifier, signal, scale, sign, name, and what the model file subtracts. Readable text;
/// characters other than printable ASCII are written as %C3%B6.
std::string device_of(const GyroPlan& gyro);

/// Error if the state belongs to other gyros than the plan's.
Expected<void> check_devices(const SavedState& state, const Plan& plan);

std::string to_text(const SavedState& state);

/// Restores every number exactly. `where` names the text in the error.
Expected<SavedState> saved_state_from(std::string_view text, const std::string& where);

}  // namespace vgyro::gateway
