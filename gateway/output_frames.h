#pragma once

// The frames that the gateway sends, bit by bit as dbc/vgyro.dbc (and, for FD, dbc/vgyro_fd.dbc)
// describes them, with their E2E headers. A value that a field cannot carry is sent as "invalid" or
// "not available", never clipped to look like a measurement.

#include <array>
#include <cstdint>

#include "base/time.h"
#include "can/frame.h"
#include "dbc/e2e.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

/// VB_Mode on the wire.
enum class BiasMode : std::uint8_t {
  kNone = 0,
  kCalibrating = 1,
  kTracking = 2,
  kHold = 3,
  kStop = 4,      ///< standing still: both biases are being learned
  kAmbiguous = 5  ///< two explanations of the data are likely: both are carried on
};

/// VB_Health on the wire, a bit field.
enum HealthBit : std::uint8_t {
  kGyro1Missing = 1U << 0U,
  kGyro2Missing = 1U << 1U,
  kGyro1Suspect = 1U << 2U,
  kGyro2Suspect = 1U << 3U,
  kGyrosDisagree = 1U << 4U
};

struct RateOutput {
  bool valid = false;
  double rate_dps = 0.0;
  double sigma_dps = 0.0;                 ///< NaN: not available
  std::array<double, 2> corrected_dps{};  ///< NaN: not available; FD only
  State state = State::kWaiting;
  Quality quality = Quality::kUnusable;
  std::uint8_t health = 0;
  Duration age{0};    ///< from the instant of the rate to the stamp of the causing frame
  TimePoint instant;  ///< the instant that the rate belongs to; FD only
};

struct BiasOutput {
  std::array<double, 2> bias_dps{};  ///< NaN: not available
  BiasMode mode = BiasMode::kNone;
  std::uint8_t health = 0;
};

struct ModelOutput {
  double slope_dps_s = 0.0;  ///< NaN: not available, as in the next two
  double bias_sigma_dps = 0.0;
  double slope_sigma_dps_s = 0.0;
};

class OutputEncoder {
 public:
  explicit OutputEncoder(const OutputPlan& plan);

  /// Continues the counters of the frames that both encoders send.
  void count_on_from(const OutputEncoder& before);

  /// Can VG_Rate carry this rate in the chosen format?
  [[nodiscard]] bool can_carry(double rate_dps) const;

  /// An invalid output carries 0x800000 and quality 0, whatever its other members hold.
  const can::Frame& rate(const RateOutput& output);
  const can::Frame& bias(const BiasOutput& output);
  const can::Frame& model(const ModelOutput& output);

 private:
  void put_classic_rate(const RateOutput& output);
  void put_fd_rate(const RateOutput& output);

  bool fd_;
  can::Frame rate_;
  can::Frame bias_;
  can::Frame model_;
  dbc::E2eProfile11C rate_protection_;
  dbc::E2eProfile5 fd_rate_protection_;
  dbc::E2eProfile11C bias_protection_;
  dbc::E2eProfile11C model_protection_;
};

/// VG_Rates: the rates of all axes of a platform in one FD frame.
class AxesEncoder {
 public:
  explicit AxesEncoder(const OutputPlan& plan);

  /// Continues the counter of the other encoder if the identifier is the same.
  void count_on_from(const AxesEncoder& before);

  /// The rates about x, y and z of one instant; null: no rate. Precondition: at least one is not
  /// null.
  const can::Frame& rates(const std::array<const RateOutput*, kAxes>& axes);

 private:
  can::Frame frame_;
  dbc::E2eProfile5 protection_;
};

}  // namespace vgyro::gateway
