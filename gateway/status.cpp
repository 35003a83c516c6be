#include "gateway/status.h"

#include <array>

namespace vgyro::gateway {

std::string_view to_string(State state) {
  constexpr std::array<std::string_view, 5> kNames{"waiting", "calibrating", "running", "degraded",
                                                   "lost"};
  return kNames[static_cast<std::size_t>(state)];
}

std::string_view to_string(Quality quality) {
  switch (quality) {
    case Quality::kUnusable:
      return "unusable";
    case Quality::kOneGyro:
      return "one_gyro";
    case Quality::kDisagree:
      return "disagree";
    case Quality::kCalibrationUncertain:
      return "calibration_uncertain";
    case Quality::kRestored:
      return "restored";
    case Quality::kTwoGyros:
      return "two_gyros";
  }
  return {};
}

std::string_view to_string(Reject reject) {
  constexpr std::array<std::string_view, kRejectCount> kNames{
      "not_data",     "other_page",       "truncated",      "flagged_invalid", "not_finite",
      "out_of_range", "counter_repeated", "wrong_sequence", "crc_wrong",       "stamp_repeated",
      "late",         "stamp_jump",       "saturated",      "stuck",           "dead_band",
      "recovering"};
  return kNames[static_cast<std::size_t>(reject)];
}

std::string_view to_string(Restored restored) {
  constexpr std::array<std::string_view, 5> kNames{"nothing", "offered", "refused", "taken_up",
                                                   "confirmed"};
  return kNames[static_cast<std::size_t>(restored)];
}

std::string_view to_string(Fault fault) {
  constexpr std::array<std::string_view, kFaultCount> kNames{
      "silent",    "flagged_invalid", "unreadable", "counter_stuck",
      "saturated", "stuck",           "dead_band",  "noisy"};
  return kNames[static_cast<std::size_t>(fault)];
}

}  // namespace vgyro::gateway
