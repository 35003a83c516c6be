#pragma once

// Does a frame prove that it is whole, from its sender and new? Its check value and its alive
// counter, where the configuration names them. Of one message; what nobody named is not asked.

#include <cstdint>
#include <optional>
#include <span>

#include "can/frame.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class E2eCheck {
 public:
  /// Of a message that is not configured: asks nothing.
  E2eCheck() : plan_(&kNothing) {}
  explicit E2eCheck(const E2ePlan& plan) : plan_(&plan) {}

  /// Is it a data frame with the right check value? Nothing when it is, else the cause. A frame
  /// that fails must not be counted.
  [[nodiscard]] std::optional<Reject> verify(const can::Frame& frame) const;

  /// The alive counter of a frame that is whole; `missing` of them were lost before it. Nothing
  /// when it is new, else the cause. Precondition: the counter fits the payload.
  std::optional<Reject> count(std::span<const std::uint8_t> payload, std::uint32_t& missing);

  /// Both, for a message of which only that is asked.
  std::optional<Reject> judge(const can::Frame& frame);

  /// After a silence the counter says nothing about how many frames are missing. The last frame
  /// sent once more is still none that is new; of a healthy sender that costs one frame now and
  /// then.
  void fall_silent();

  /// As the newest frame that was accepted carried it.
  [[nodiscard]] std::uint32_t counter() const { return counter_; }

 private:
  [[nodiscard]] std::uint32_t read(std::span<const std::uint8_t> payload) const;
  [[nodiscard]] std::uint32_t step(std::uint32_t from, std::uint32_t to) const;

  static const E2ePlan kNothing;

  const E2ePlan* plan_;
  std::uint32_t counter_ = 0;
  bool known_ = false;
  bool counts_missing_ = false;                   ///< the counter has not been interrupted since
  std::optional<std::uint32_t> out_of_sequence_;  ///< of the frame before, refused
};

}  // namespace vgyro::gateway
