#pragma once

// The state of the pipeline: state, biases, and a counter for every cause for which a frame
// was not used. Read by the daemon's STATUS line, the replay's summary and the tests.

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include "base/time.h"
#include "fusion/corrector.h"
#include "fusion/pair_relation.h"

namespace vgyro::gateway {

/// VG_State on the wire; the transition table is in ARCHITECTURE.md.
enum class State : std::uint8_t {
  kWaiting = 0,      ///< no pair yet; or not calibrated, and a gyro is not in use
  kCalibrating = 1,  ///< both in use, initial calibration not complete
  kRunning = 2,      ///< both gyros in use
  kDegraded = 3,     ///< one gyro in use, the other timed out or was set aside
  kLost = 4,         ///< calibrated, but no gyro is in use
  kContradicted = 5  ///< both gyros in use, but not of one platform, as they are configured
};
inline constexpr int kStateCount = 6;
std::string_view to_string(State state);

/// VG_Quality on the wire.
enum class Quality : std::uint8_t {
  kUnusable = 0,
  kOneGyro = 4,
  kDisagree = 6,              ///< both in use, but they contradict each other
  kAmbiguous = 7,             ///< two hypotheses are likely, and σ covers both
  kCalibrationUncertain = 8,  ///< the platform moved while it should have rested
  kRestored = 12,             ///< biases of an earlier run, not confirmed yet
  kTwoGyros = 15
};
std::string_view to_string(Quality quality);

/// Why a frame of a configured identifier was not used.
enum class Reject : std::uint8_t {
  kNotData,          ///< remote frame with the gyro's identifier; error frames get no role
  kOtherPage,        ///< multiplexed message on a page without the rate
  kTruncated,        ///< payload shorter than the signal
  kFlaggedInvalid,   ///< the `valid` comparison is false
  kNotFinite,        ///< NaN or infinity
  kOutOfRange,       ///< outside the DBC's range, or no rate that a gyro can have
  kCounterRepeated,  ///< the alive counter did not move
  kWrongSequence,    ///< the alive counter moved further than it may
  kCrcWrong,         ///< the check value is not that of this payload
  kStampRepeated,    ///< same stamp as the sample before
  kLate,             ///< older than a sample already used
  kStampJump,        ///< stamp far from its neighbours, not confirmed by the following ones
  kSaturated,        ///< at the end of the sensor's range
  kStuck,            ///< the value stands still and should not
  kDeadBand,         ///< 0 of a sensor with a dead band, while the other gyro carries on
  kRecovering,       ///< good again, but not for long enough after a fault
  kNoMeasurement,    ///< J1939's or NMEA 2000's code for "error", "not available" and the like
  kOtherAxis         ///< of a unit that is turned: an axis with a share in this one is missing
};
inline constexpr std::size_t kRejectCount = 18;
std::string_view to_string(Reject reject);

/// The use of the biases that an earlier run had saved.
enum class Restored : std::uint8_t {
  kNothing,   ///< there was nothing to take up
  kOffered,   ///< waits for the first pair
  kRefused,   ///< the corrector refused it: calibrates
  kTakenUp,   ///< in use instead of a calibration, VG_Quality says `restored`
  kConfirmed  ///< in use, and a stop has been learned from since
};
std::string_view to_string(Restored restored);

/// What can be wrong with a gyro. What is neither silence nor a dead band makes it "suspect" in
/// VB_Health; a noisy or blind gyro stays in use.
enum class Fault : std::uint8_t {
  kSilent,          ///< no frame within the time-out
  kFlaggedInvalid,  ///< it says so itself
  kUnreadable,      ///< one frame after the other is no rate
  kCounterStuck,    ///< one frame after the other repeats the alive counter
  kSaturated,
  kStuck,
  kDeadBand,
  kNoisy,  ///< far noisier than it was
  kBlind   ///< it does not feel the rotation that the other one feels
};
inline constexpr std::size_t kFaultCount = 9;
std::string_view to_string(Fault fault);

/// "none", "sign", "scale", "lag", "unrelated", "erratic".
std::string_view to_string(fusion::Contradiction contradiction);

/// For people: "standing", "turning", …
std::string_view to_string(fusion::Hypothesis hypothesis);

struct FaultRecord {
  std::uint64_t times = 0;  ///< that it began
  TimePoint last;           ///< newest instant at which it was so, on the stamps' clock
};

struct GyroStatus {
  std::uint64_t frames = 0;   ///< received with the gyro's identifier
  std::uint64_t samples = 0;  ///< of these, handed to the alignment
  std::uint64_t missing = 0;  ///< frames lost on the way, by the alive counter
  /// From here its counter always goes back to 0, earlier than the configuration says.
  std::optional<std::uint32_t> counter_turns_at;
  std::array<std::uint64_t, kRejectCount> rejected{};
  std::uint64_t unpaired = 0;  ///< samples that found no partner: the other gyro had a gap
  bool heard = false;          ///< in use: a sample that may be used arrived within the time-out
  std::optional<Fault> fault;  ///< at present; never kSilent, which `heard` shows
  std::array<FaultRecord, kFaultCount> faults{};
  double last_rate_dps = 0.0;
  double bias_dps = 0.0;       ///< NaN until calibrated, and for `mean`, which has none
  double temperature_c = 0.0;  ///< NaN when there is none
  double supply_v = 0.0;       ///< NaN when there is none
  /// Inputs of the model (model::Need) not received yet: their effects are not corrected yet.
  std::uint8_t waits_for = 0;
};

/// Layouts beside each other: more are a mistake, and the status has room for each.
inline constexpr std::size_t kOutputLayoutsMost = 8;

/// Frames of one [[output.layout]].
struct LayoutCounts {
  std::uint64_t frames = 0;
  std::uint64_t valid = 0;  ///< of these, with a valid rate
  std::uint64_t out_of_range =
      0;                       ///< valid rates that the signal cannot carry, or whose σ it cannot
  std::uint64_t withheld = 0;  ///< not sent: the layout cannot say that no rate is valid

  LayoutCounts& operator+=(const LayoutCounts& other);
  friend bool operator==(const LayoutCounts&, const LayoutCounts&) = default;
};

struct Status {
  State state = State::kWaiting;
  std::array<GyroStatus, 2> gyros;
  std::uint64_t reference_frames = 0;
  std::uint64_t reference_rejected = 0;
  std::uint64_t accelerometer_frames = 0;
  std::uint64_t accelerometer_rejected = 0;
  std::uint64_t speed_frames = 0;
  std::uint64_t speed_rejected = 0;
  std::uint64_t pairs = 0;
  bool rates_too_far_apart = false;  ///< of the gyros: no buffer reaches from sample to sample
  std::uint64_t clock_steps = 0;     ///< times the stamps were set back, or years ahead
  std::uint64_t rates_out = 0;
  std::uint64_t rates_out_valid = 0;
  std::uint64_t rates_out_of_range = 0;  ///< virtual rate beyond what VG_Rate can carry
  std::uint64_t biases_out = 0;
  std::array<LayoutCounts, kOutputLayoutsMost> layouts_out{};  ///< in the order of the plan
  std::uint64_t windows = 0;                                   ///< corrector windows completed
  std::uint64_t windows_skipped = 0;       ///< too few pairs in the window: drift held
  double rate_dps = 0.0;                   ///< last virtual rate; NaN when invalid
  double sigma_dps = 0.0;                  ///< its σ; NaN when invalid or not stated
  Quality quality = Quality::kUnusable;    ///< of it
  double bias_sigma_dps = 0.0;             ///< of what is taken off it; NaN when not stated
  double calibrated_s = 0.0;               ///< calibration progress
  std::uint64_t calibration_restarts = 0;  ///< the platform moved, or the stream had holes
  bool moved_in_calibration = false;       ///< and that was accepted
  Restored restored = Restored::kNothing;
  double restored_age_s = 0.0;           ///< of what was taken up; NaN: a clock was set back
  double restored_bias_sigma_dps = 0.0;  ///< of what was taken off the rate at first
  bool disagree = false;                 ///< the gyros contradict each other
  std::uint64_t disagreements = 0;       ///< times that this began
  fusion::PairVerdict pair;              ///< whether the gyros can be of one platform
  std::uint64_t contradictions = 0;      ///< times that this was found not to be so
  std::uint64_t stops = 0;               ///< stops learned from
  std::uint64_t stops_refused = 0;       ///< steady, but a turn was likelier
  std::uint64_t stops_open = 0;          ///< steady, and which of the two is open
  bool ambiguous = false;                ///< two hypotheses are likely, and far apart
  /// Of the hypotheses, by fusion::Hypothesis.
  std::array<double, fusion::kHypotheses> probability{};
  std::uint64_t estimate_restarts = 0;  ///< times that the estimate was lost and restarted
  /// fusion::Condition::normalized_innovation.
  double normalized_innovation = std::numeric_limits<double>::quiet_NaN();

  /// Of a platform of several axes: the rotation between its units, and its evidence.
  std::uint64_t misalignment_segments = 0;
  std::array<double, 3> misalignment_deg{};
  std::array<double, 3> misalignment_sigma_deg{};

  /// Of all layouts.
  [[nodiscard]] LayoutCounts layouts_total() const;
};

}  // namespace vgyro::gateway
