#include "cli/pair_recording.h"

#include <algorithm>
#include <array>

#include <fmt/core.h>

#include "analysis/resolution.h"
#include "cli/axis_choice.h"
#include "cli/log_notes.h"
#include "cli/role_frames.h"
#include "fusion/alignment.h"
#include "fusion/stamp_guard.h"
#include "gateway/intake.h"

namespace vgyro::cli {

namespace {

class Gatherer {
 public:
  explicit Gatherer(const gateway::Plan& plan)
      : plan_(plan),
        inputs_{gateway::GyroIntake(0, gateway::GyroInput(plan.gyros[0])),
                gateway::GyroIntake(1, gateway::GyroInput(plan.gyros[1]))} {}

  void take(std::uint8_t roles, const canlog::LogRecord& record) {
    if ((roles & gateway::kGyro1) != 0) take_gyro(0, record);
    if ((roles & gateway::kGyro2) != 0) take_gyro(1, record);
  }

  [[nodiscard]] const std::array<std::uint64_t, 2>& used() const { return samples_; }

  [[nodiscard]] std::optional<Error> no_pair(const std::string& log) const {
    if (pairs_ > 0) return std::nullopt;
    return Error{log,
                 fmt::format("the gyros {} and {} never sent at the same time{}, or too briefly",
                             plan_.gyros[0].name, plan_.gyros[1].name, about_axis(plan_)),
                 "use a recording that contains both gyros"};
  }

  analysis::PairRecording finish() {
    analysis::PairRecording recording;
    for (std::size_t i = 0; i < 2; ++i) {
      recording.own[i] = own_[i].finish()[0];
      // The observed step is often coarser than that of the DBC file, which is used if the values
      // never changed.
      const double seen_dps = steps_[i].step_dps();
      recording.step_dps[i] = seen_dps > 0.0 ? seen_dps : plan_.gyros[i].rate.step;
    }
    recording.paired = paired_.finish();
    // Averaging a faster gyro keeps white noise white.
    const double ratio = to_seconds(aligner_.interval(aligner_.pacing_gyro())) /
                         to_seconds(aligner_.interval(1 - aligner_.pacing_gyro()));
    constexpr double kNextToNothing = 0.98;
    const double gain = noise_gain_sum_ / static_cast<double>(pairs_);
    if (ratio < fusion::Aligner::kAverageRatio && gain < kNextToNothing) {
      recording.interpolation_gain = gain;
    }
    return recording;
  }

 private:
  void take_gyro(std::size_t gyro, const canlog::LogRecord& record) {
    const gateway::GyroIntake::Result taken =
        inputs_[gyro].take(record.frame, record.stamp, guard_);
    if (taken.reject) return;
    if (taken.stamp.clock_step) aligner_.clear();
    const TimePoint t = taken.stamp.t;
    if (!aligner_.push(gyro, t, taken.rate_dps)) return;
    if (samples_[0] + samples_[1] == 0) origin_ = t;
    ++samples_[gyro];
    steps_[gyro].add(taken.rate_dps);
    own_[gyro].add(to_seconds(t - origin_), {taken.rate_dps, 0.0});
    fusion::AlignedPair pair;
    while (aligner_.pop(pair)) {
      ++pairs_;
      noise_gain_sum_ += std::min(pair.noise_gain[0], pair.noise_gain[1]);
      paired_.add(to_seconds(pair.t - origin_), pair.rate_dps);
    }
  }

  const gateway::Plan& plan_;
  std::array<gateway::GyroIntake, 2> inputs_;
  fusion::StampGuard guard_;
  fusion::Aligner aligner_;
  std::array<analysis::SeriesBuilder, 2> own_;
  std::array<analysis::StepFinder, 2> steps_;
  analysis::SeriesBuilder paired_;
  std::array<std::uint64_t, 2> samples_{};
  std::uint64_t pairs_ = 0;
  double noise_gain_sum_ = 0.0;
  TimePoint origin_;
};

}  // namespace

Expected<std::vector<analysis::PairRecording>> read_pair_recordings(
    const std::vector<std::string>& logs, std::span<const gateway::Plan> plans) {
  RoleFrames frames(plans);
  std::vector<Gatherer> gatherers;
  gatherers.reserve(plans.size());
  for (const gateway::Plan& plan : plans)
    gatherers.emplace_back(plan);
  const auto done = frames.read(
      logs, "allan", [&](std::size_t pair, std::uint8_t roles, const canlog::LogRecord& record) {
        gatherers[pair].take(roles, record);
      });
  if (!done) return tl::unexpected(done.error());
  std::vector<analysis::PairRecording> recordings;
  recordings.reserve(plans.size());
  for (std::size_t pair = 0; pair < plans.size(); ++pair) {
    Gatherer& gatherer = gatherers[pair];
    auto complaint = frames.missing_gyro(name_of(logs), pair, gatherer.used());
    if (!complaint) complaint = gatherer.no_pair(name_of(logs));
    if (complaint) return tl::unexpected(*std::move(complaint));
    recordings.push_back(gatherer.finish());
  }
  return recordings;
}

}  // namespace vgyro::cli
