#pragma once

// A configuration with everything in it resolved: which bits of which frame on which bus are which
// quantity. Built from files by gateway/config.h, or by hand in tests.

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "can/frame.h"
#include "dbc/codec.h"
#include "dbc/codes.h"
#include "dbc/e2e.h"
#include "dbc/multiplex.h"
#include "fusion/calibration.h"
#include "fusion/gyro_parameters.h"
#include "model/file.h"

namespace vgyro::gateway {

enum class Method : std::uint8_t { kMean, kMutual, kOptimal };

/// A frame identifier on a bus. Matches when (id & mask) == (frame.id & mask) and the format
/// agrees, unless the identifier is that of another message: an exact identifier takes precedence
/// over a PGN.
struct FrameMatch {
  can::BusIndex bus = 0;
  std::uint32_t id = 0;
  std::uint32_t mask = 0;
  bool extended = false;
  std::uint8_t bytes = can::kClassicBytesMax;  ///< length of the payload in the DBC file
  /// For J1939 without a source address: identifiers that the DBC file assigns to other messages of
  /// the same PGN.
  std::vector<std::uint32_t> others = {};

  /// Does a frame of this identifier carry the message? The caller checks the bus.
  [[nodiscard]] bool carries(std::uint32_t frame_id, bool frame_extended) const;

  friend bool operator==(const FrameMatch&, const FrameMatch&) = default;
};

/// A physical quantity in a frame.
struct Quantity {
  std::string name;  ///< name of the signal
  std::string unit;  ///< as in the DBC file
  dbc::SignalCodec codec;
  dbc::Presence presence;  ///< for a multiplexed signal: the page that it is on
  double scale = 1.0;  ///< value · scale + shift is in the product's unit: deg/s, degC, g, m/s, V;
  double shift = 0.0;  ///< the sign of the configuration is part of the scale
  double minimum = 0.0;  ///< accepted values, in the DBC's unit
  double maximum = 0.0;
  std::string layout;     ///< for people: "32 bits from bit 0, Intel, signed, x 1e-06"
  double step = 0.0;      ///< between neighbouring values, in the product's unit; 0 for floats
  dbc::Codes codes = {};  ///< raw values that are no measurement; outside minimum and maximum
  bool codes_in_range = false;  ///< the DBC file's range includes codes

  /// The lowest and highest measurement that the bits can hold, in the DBC's unit.
  [[nodiscard]] double sendable_lowest() const;
  [[nodiscard]] double sendable_highest() const;

  /// The lowest and highest accepted value that can be sent, in the DBC's unit.
  [[nodiscard]] double lowest() const { return std::max(minimum, sendable_lowest()); }
  [[nodiscard]] double highest() const { return std::min(maximum, sendable_highest()); }

  friend bool operator==(const Quantity&, const Quantity&) = default;
};

enum class Comparison : std::uint8_t {
  kEqual,
  kNotEqual,
  kLess,
  kLessEqual,
  kGreater,
  kGreaterEqual
};

/// `valid = "Status == 0"`
struct ValidCondition {
  dbc::SignalCodec codec;
  Comparison comparison = Comparison::kEqual;
  double value = 0.0;
  std::string text;  ///< as configured

  friend bool operator==(const ValidCondition&, const ValidCondition&) = default;
};

struct AliveCounter {
  std::string name;
  dbc::SignalCodec codec;
  std::uint32_t modulus = 256;  ///< number of values: 0 … modulus − 1
  std::uint32_t max_delta = 0;  ///< a longer step is a wrong sequence; 0: any step is allowed
  bool strict = false;          ///< a value beyond the modulus is a wrong sequence
  dbc::Presence presence = {};  ///< for a multiplexed counter: the pages that carry it

  friend bool operator==(const AliveCounter&, const AliveCounter&) = default;
};

struct CheckValue {
  std::string name;  ///< name of the signal
  std::string kind;  ///< as configured: "profile_11c"
  dbc::E2eProtection protection;

  friend bool operator==(const CheckValue&, const CheckValue&) = default;
};

/// How a message can be checked to be complete, from its sender and new, as far as it has the
/// signals.
struct E2ePlan {
  std::optional<CheckValue> crc;
  std::optional<AliveCounter> counter;

  friend bool operator==(const E2ePlan&, const E2ePlan&) = default;
};

/// The vehicle's axes: x forward, y to the left, z up. A sensor's own axes are numbered in the same
/// order.
inline constexpr std::size_t kAxes = 3;
inline constexpr std::array<char, kAxes> kAxisNames{'x', 'y', 'z'};

/// Row by row: the rate about the vehicle's axis i is the sum over s of matrix[3·i + s] times the
/// rate about the sensor's axis s. A rotation, within the rounding of a double.
struct Mount {
  std::array<double, kAxes * kAxes> matrix{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  double corrected = 0.0;  ///< largest change of a configured element to make it a rotation

  [[nodiscard]] double at(std::size_t axis, std::size_t sensor_axis) const {
    return matrix[kAxes * axis + sensor_axis];
  }
  [[nodiscard]] bool turns() const { return matrix != Mount{}.matrix; }
  friend bool operator==(const Mount&, const Mount&) = default;
};

struct GyroPlan {
  std::string name;
  std::string type = {};    ///< the make and model; empty: not stated
  std::string serial = {};  ///< identifies one of that type; empty: not stated
  std::string bus;
  std::string message;
  FrameMatch match;
  Quantity rate;
  std::optional<dbc::SignalCodec> sign;  ///< separate sign bit: 1 means negative
  std::optional<Quantity> temperature;
  std::optional<Quantity> supply_voltage = {};
  std::optional<Quantity> rate_x = {};  ///< about other axes of the same unit, in the same message
  std::optional<Quantity> rate_y = {};
  std::optional<Quantity> rate_z = {};
  E2ePlan e2e = {};
  std::optional<ValidCondition> valid;
  std::optional<double> saturation_dps = {};  ///< from the model file: it clips at ± this
  double dead_band_dps = 0.0;                 ///< from the model file: it reads 0 below; 0: none
  std::optional<double> max_bias_dps = {};    ///< no bias of this gyro is larger
  std::string taken_back = {};                ///< digest of the subtracted effects; empty: none
  /// For a whole unit: its sensor axes, each as a gyro; the members above are those of the first.
  std::vector<GyroPlan> axes = {};
  std::size_t sensor_axis = 0;  ///< in an element of `axes`: which axis it is
  bool flipped = false;         ///< in the pair about an axis: `rate` is opposite to the sensor's
                                ///< sign
  Mount mount = {};             ///< mount of the unit in the vehicle

  friend bool operator==(const GyroPlan&, const GyroPlan&) = default;
};

/// The quantities that a gyro's message may hold besides its rate.
inline constexpr std::array kOtherAxes{&GyroPlan::rate_x, &GyroPlan::rate_y, &GyroPlan::rate_z};
inline constexpr std::array kBesides{&GyroPlan::temperature, &GyroPlan::supply_voltage,
                                     &GyroPlan::rate_x, &GyroPlan::rate_y, &GyroPlan::rate_z};

struct ReferencePlan {
  std::string bus;
  std::string message;
  FrameMatch match;
  Quantity rate;  ///< with several axes: the last of those below
  E2ePlan e2e = {};
  /// With several axes: the rates about the vehicle's axes that it measures.
  std::array<std::optional<Quantity>, kAxes> axes = {};

  friend bool operator==(const ReferencePlan&, const ReferencePlan&) = default;
};

struct AccelerometerPlan {
  std::string bus;
  std::string message;
  FrameMatch match;
  std::array<Quantity, 3> axes;  ///< x, y, z
  E2ePlan e2e = {};

  friend bool operator==(const AccelerometerPlan&, const AccelerometerPlan&) = default;
};

struct SpeedPlan {
  std::string bus;
  std::string message;
  FrameMatch match;
  Quantity speed;
  E2ePlan e2e = {};

  friend bool operator==(const SpeedPlan&, const SpeedPlan&) = default;
};

struct CalibrationPlan {
  double rest_s = 60.0;
  double rate_dps = 0.0;        ///< true rate about the axis while calibrating at rest
  bool from_reference = false;  ///< calibrate against [reference] instead
  std::optional<double> stop_rate_dps = 0.0;  ///< true rate at a stop, if it is known
  double doubt_dps = 0.0;  ///< 1σ of rate_dps, which stays in every rate: the Earth's rate at an
                           ///< unknown heading
  /// As configured for all axes of a platform: [calibration] rate_dps, latitude_deg, heading_deg.
  std::vector<double> axis_rate_dps = {};
  std::optional<double> latitude_deg = {};
  std::optional<double> heading_deg = {};
  fusion::WhenMoving when_moving = fusion::WhenMoving::kWait;

  friend bool operator==(const CalibrationPlan&, const CalibrationPlan&) = default;
};

struct CorrectorPlan {
  Method method = Method::kOptimal;
  double window_s = 10.0;
  int order = 1;                                ///< of `mutual`
  std::array<fusion::GyroParameters, 2> gyros;  ///< noise from the model file

  friend bool operator==(const CorrectorPlan&, const CorrectorPlan&) = default;
};

/// A quantity to be sent: which values the signal can carry, and which code replaces the others.
struct OutputField {
  std::string name;       ///< name of the signal
  std::string unit = {};  ///< as in the DBC file
  dbc::SignalCodec codec;
  double scale = 1.0;  ///< value · scale + shift is in the product's unit, as in Quantity
  double shift = 0.0;
  double minimum = 0.0;          ///< range of values in the DBC's unit;
  double maximum = 0.0;          ///< excludes codes
  std::uint64_t none_raw = 0;    ///< code for a value that is not available
  std::uint64_t beyond_raw = 0;  ///< code for a value outside the range
  bool has_code = false;         ///< none_raw and beyond_raw cannot be mistaken for measurements
  std::string code = {};         ///< for people: "0xFFFF, not available"
  std::string layout = {};       ///< for people, as in Quantity
  double step = 0.0;             ///< as in Quantity

  friend bool operator==(const OutputField&, const OutputField&) = default;
};

/// The signal of `valid = "Status == 0"`, to be sent.
struct OutputFlag {
  std::string name;
  dbc::SignalCodec codec;
  std::uint64_t valid_raw = 0;
  std::uint64_t invalid_raw = 0;
  std::string text = {};  ///< as configured

  friend bool operator==(const OutputFlag&, const OutputFlag&) = default;
};

/// A signal that gets no value, as text: "AccX", "0xFFFF, not available".
struct RestingSignal {
  std::string name;
  std::string says = {};

  friend bool operator==(const RestingSignal&, const RestingSignal&) = default;
};

/// One rate in a message that a vehicle already reads.
struct LayoutRate {
  OutputField rate;                           ///< the configured sign is part of the scale
  std::optional<dbc::SignalCodec> sign = {};  ///< separate sign bit: 1 means negative
  std::optional<OutputField> sigma = {};
  std::optional<OutputFlag> valid = {};  ///< validity of this rate alone, among several
  std::size_t axis = 0;                  ///< with several axes: the axis of the rate

  friend bool operator==(const LayoutRate&, const LayoutRate&) = default;
};

/// The virtual rate, or those about several axes, in a message that a vehicle already reads.
struct OutputLayout {
  can::BusIndex bus = 0;
  std::string message = {};
  std::uint32_t id = 0;
  bool extended = false;
  bool fd = false;
  std::uint8_t bytes = can::kClassicBytesMax;          ///< length of the frame
  std::array<std::uint8_t, can::kFdBytesMax> blank{};  ///< the frame before the values are filled
                                                       ///< in
  std::vector<LayoutRate> rates = {};                  ///< one, or one for each axis
  std::optional<OutputFlag> valid = {};                ///< validity of all rates of the frame
  E2ePlan e2e = {};
  std::optional<Duration> every = {};  ///< at most one frame in this time; empty: one with every
                                       ///< rate
  std::vector<RestingSignal> resting = {};

  /// Can its frames mark each rate as not valid? If not, no frame is sent for an invalid rate.
  [[nodiscard]] bool can_say_invalid() const {
    return valid || std::all_of(rates.begin(), rates.end(), [](const LayoutRate& one) {
             return one.valid || one.rate.has_code;
           });
  }

  friend bool operator==(const OutputLayout&, const OutputLayout&) = default;
};

struct OutputPlan {
  can::BusIndex bus = 0;
  std::uint32_t rate_id = 0x610;
  std::uint32_t bias_id = 0x611;
  std::uint32_t model_id = 0x612;
  bool fd = false;
  bool vgyro_frames = true;  ///< VG_Rate, VG_Bias and VG_Model
  bool transmit = true;      ///< false: shadow mode, in which the live gateway sends nothing
  std::vector<OutputLayout> layouts = {};
  /// The axes of a platform of several; empty: a single axis. The identifiers above are those of
  /// axis 0, each further axis has them kAxisIdStep higher.
  std::vector<std::size_t> axes = {};
  bool rate_is_shared = false;  ///< one FD frame carries the rates of all axes
};

/// Distance between the identifiers of one axis and those of the next: VG_Rate, VG_Bias, VG_Model.
inline constexpr std::uint32_t kAxisIdStep = 3;

/// An identifier on a bus.
struct FrameId {
  std::uint32_t id = 0;
  bool extended = false;

  friend bool operator==(const FrameId&, const FrameId&) = default;
};

/// Formatted as by candump: "174", "0CF02A31".
std::string to_string(const FrameId& id);

/// Identifiers of all frames that the gateway sends on a bus.
std::vector<FrameId> output_ids(const OutputPlan& plan, can::BusIndex bus);

struct Plan {
  std::vector<std::string> buses;  ///< BusIndex → interface name, without repetition
  std::vector<GyroPlan> gyros;     ///< exactly two, once resolved
  std::optional<ReferencePlan> reference;
  std::optional<AccelerometerPlan> accelerometer;
  std::optional<SpeedPlan> speed;
  CalibrationPlan calibration;
  CorrectorPlan corrector;
  std::optional<model::Model> model;  ///< known effects, which are subtracted
  OutputPlan output;
  /// For a platform of several axes: the plan of the pair of gyros about each, in the order x, y,
  /// z, with the shared parts repeated in all of them. Empty: two single gyros.
  std::vector<Plan> axes = {};
  std::size_t axis = 0;  ///< in an element of `axes`: which of the vehicle's axes it is

  /// Every frame that the pipeline reads, for the kernel's filters.
  [[nodiscard]] std::vector<FrameMatch> inputs() const;
};

/// Do both plans differ in their output at most?
bool same_but_output(const Plan& a, const Plan& b);

}  // namespace vgyro::gateway
