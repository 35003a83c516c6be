#pragma once

// One gyro's frames → rates in deg/s, or the cause why a frame cannot be used. Checks the
// frame itself: check value, length, alive counter, `valid` comparison, finite and in range.
// Stamps are judged elsewhere.

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "can/frame.h"
#include "gateway/e2e_check.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

/// Another quantity in a gyro's message, perhaps on a page of its own. Holds the value of the
/// newest frame that carried it.
class Beside {
 public:
  /// `quantity` must outlive this object.
  explicit Beside(const std::optional<Quantity>& quantity) : quantity_(quantity) {}
  [[nodiscard]] bool wanted() const { return quantity_.has_value(); }
  /// Precondition: wanted(); a data frame.
  void keep(const can::Frame& frame);
  /// In the product's unit; NaN before any value.
  [[nodiscard]] double value() const { return value_; }

 private:
  const std::optional<Quantity>& quantity_;
  double value_ = std::numeric_limits<double>::quiet_NaN();
};

class GyroInput {
 public:
  explicit GyroInput(const GyroPlan& plan);

  struct Result {
    std::optional<Reject> reject;  ///< set: the frame is not used
    double rate_dps = 0.0;
    std::uint32_t missing = 0;  ///< frames lost before this one, by the alive counter
  };
  /// `result` must be freshly constructed.
  void decode(const can::Frame& frame, Result& result);
  Result decode(const can::Frame& frame) {
    Result result;
    decode(frame, result);
    return result;
  }

  /// Restarts the check of the alive counter.
  void fall_silent() { e2e_.fall_silent(); }

  /// The alive counter in the newest frame that was used.
  [[nodiscard]] std::uint32_t counter() const { return e2e_.counter(); }
  [[nodiscard]] std::optional<std::uint32_t> early_turn() const { return e2e_.early_turn(); }

  /// From the newest frame that was used or that held no rate; NaN before one.
  [[nodiscard]] double temperature_c() const { return temperature_.value(); }
  [[nodiscard]] double supply_v() const { return supply_voltage_.value(); }
  /// Rates about the sensor axes x, y and z.
  [[nodiscard]] std::array<double, 3> other_rate_dps() const {
    return {other_axes_[0].value(), other_axes_[1].value(), other_axes_[2].value()};
  }

 private:
  void keep_besides(const can::Frame& frame);

  const GyroPlan& plan_;
  std::size_t bytes_needed_;
  Beside temperature_;
  Beside supply_voltage_;
  std::array<Beside, 3> other_axes_;
  bool has_other_axes_;
  E2eCheck e2e_;
};

/// Does the comparison hold for this value?
bool holds(const ValidCondition& condition, double value);

/// A quantity's value in the product's unit, or the cause why it has none.
std::optional<Reject> decode_quantity(const Quantity& quantity, const can::Frame& frame,
                                      double& value);

}  // namespace vgyro::gateway
