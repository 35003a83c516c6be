#pragma once

// Finds the roles of a received frame: one table look-up for standard identifiers, a short list for
// extended ones. Built once from the plan.

#include <array>
#include <cstdint>
#include <vector>

#include "can/frame.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// Bit mask: a frame may carry a gyro and the reference at once.
enum Role : std::uint8_t {
  kGyro1 = 1U << 0U,
  kGyro2 = 1U << 1U,
  kReference = 1U << 2U,
  kAccelerometer = 1U << 3U,
  kSpeed = 1U << 4U
};

class Router {
 public:
  explicit Router(const Plan& plan);

  [[nodiscard]] std::uint8_t roles(can::BusIndex bus, const can::Frame& frame) const {
    if (bus >= standard_.size()) return 0;
    if (frame.has(can::kError)) return 0;
    if (!frame.has(can::kExtended)) return standard_[bus][frame.id & can::kStandardIdMax];
    return extended_.empty() ? std::uint8_t{0} : extended_roles(bus, frame.id);
  }

 private:
  struct Entry {
    FrameMatch match;
    std::uint8_t role = 0;
  };
  void add(const FrameMatch& match, std::uint8_t role);
  [[nodiscard]] std::uint8_t extended_roles(can::BusIndex bus, std::uint32_t id) const;

  std::vector<std::array<std::uint8_t, can::kStandardIdMax + 1>> standard_;
  std::vector<Entry> extended_;
};

}  // namespace vgyro::gateway
