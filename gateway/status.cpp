#include "gateway/status.h"

#include <array>

namespace vgyro::gateway {

std::string_view to_string(State state) {
  constexpr std::array<std::string_view, kStateCount> kNames{
      "waiting", "calibrating", "running", "degraded", "lost", "contradicted"};
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
    case Quality::kAmbiguous:
      return "ambiguous";
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
      "recovering",   "no_measurement",   "other_axis"};
  return kNames[static_cast<std::size_t>(reject)];
}

std::string_view to_string(Restored restored) {
  constexpr std::array<std::string_view, 5> kNames{"nothing", "offered", "refused", "taken_up",
                                                   "confirmed"};
  return kNames[static_cast<std::size_t>(restored)];
}

std::string_view to_string(Fault fault) {
  constexpr std::array<std::string_view, kFaultCount> kNames{
      "silent", "flagged_invalid", "unreadable", "counter_stuck", "saturated",
      "stuck",  "dead_band",       "noisy",      "blind"};
  return kNames[static_cast<std::size_t>(fault)];
}

std::string_view to_string(fusion::Contradiction contradiction) {
  constexpr std::array<std::string_view, fusion::kContradictions> kNames{
      "none", "sign", "scale", "lag", "unrelated", "erratic"};
  return kNames[static_cast<std::size_t>(contradiction)];
}

std::string_view to_string(fusion::Hypothesis hypothesis) {
  constexpr std::array<std::string_view, fusion::kHypotheses> kNames{
      "standing",     "turning",    "gyro_1_stepped", "gyro_2_stepped", "gyro_1_blind",
      "gyro_2_blind", "warming_up", "own_slopes",     "alike_slopes"};
  return kNames[static_cast<std::size_t>(hypothesis)];
}

LayoutCounts& LayoutCounts::operator+=(const LayoutCounts& other) {
  frames += other.frames;
  valid += other.valid;
  out_of_range += other.out_of_range;
  withheld += other.withheld;
  return *this;
}

LayoutCounts Status::layouts_total() const {
  LayoutCounts total;
  for (const LayoutCounts& layout : layouts_out)
    total += layout;
  return total;
}

}  // namespace vgyro::gateway
