#include "cli/pair_recording.h"

#include <algorithm>
#include <array>

#include <fmt/core.h>

#include "can/candump.h"
#include "can/log_source.h"
#include "cli/progress.h"
#include "fusion/alignment.h"
#include "fusion/stamp_guard.h"
#include "gateway/gyro_input.h"
#include "gateway/router.h"
#include "gateway/status.h"

namespace vgyro::cli {

namespace {

constexpr std::uint64_t kFramesPerProgress = 1U << 16U;

class Gatherer {
 public:
  explicit Gatherer(const gateway::Plan& plan)
      : plan_(plan),
        router_(plan),
        inputs_{gateway::GyroInput(plan.gyros[0]), gateway::GyroInput(plan.gyros[1])} {}

  Expected<void> read(const std::string& log) {
    auto source = can::open_log(log);
    if (!source) return tl::unexpected(source.error());
    const can::LogSource* bytes = source->get();
    can::LogReader reader(std::move(*source));
    Progress progress("allan " + log);
    can::LogRecord record;
    std::uint64_t until_progress = kFramesPerProgress;
    while (reader.next(record)) {
      if (record.is_xl) continue;
      take(record, reader.interfaces());
      if (--until_progress > 0) continue;
      until_progress = kFramesPerProgress;
      progress.update(bytes->bytes_read(), bytes->bytes_total(), reader.counts().frames);
    }
    if (reader.error()) return tl::unexpected(*reader.error());
    interfaces_ = reader.interfaces().names();
    return {};
  }

  [[nodiscard]] std::optional<Error> complaint(const std::string& log) const {
    for (std::size_t i = 0; i < 2; ++i) {
      if (samples_[i] > 0) continue;
      const gateway::GyroPlan& gyro = plan_.gyros[i];
      if (frames_[i] > 0) {
        return Error{
            log,
            fmt::format("none of the {} frames of gyro {} could be used", frames_[i], gyro.name),
            "`vgyro replay` tells the causes, `vgyro check` which bits are read"};
      }
      std::string names;
      for (const std::string& name : interfaces_)
        names += (names.empty() ? "" : ", ") + name;
      return Error{
          log,
          fmt::format("no frame of gyro {} ({} {:X} on {})", gyro.name, gyro.message, gyro.match.id,
                      gyro.bus),
          names.empty() ? "the log holds no CAN frame" : "the log's interfaces are: " + names};
    }
    if (pairs_ > 0) return std::nullopt;
    return Error{log,
                 fmt::format("the gyros {} and {} never spoke at the same time, or too shortly",
                             plan_.gyros[0].name, plan_.gyros[1].name),
                 "a recording in which both are there is needed"};
  }

  analysis::PairRecording finish() {
    analysis::PairRecording recording;
    for (std::size_t i = 0; i < 2; ++i)
      recording.own[i] = own_[i].finish()[0];
    recording.paired = paired_.finish();
    // Averaging a faster gyro leaves white noise white.
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
  void take(const can::LogRecord& record, const can::InterfaceTable& interfaces) {
    while (buses_.size() <= record.bus) {
      const std::string& name = interfaces.name(static_cast<can::BusIndex>(buses_.size()));
      const auto found = std::find(plan_.buses.begin(), plan_.buses.end(), name);
      buses_.push_back(static_cast<can::BusIndex>(found - plan_.buses.begin()));
    }
    const std::uint8_t roles = router_.roles(buses_[record.bus], record.frame);
    if ((roles & gateway::kGyro1) != 0) take_gyro(0, record);
    if ((roles & gateway::kGyro2) != 0) take_gyro(1, record);
  }

  void take_gyro(std::size_t gyro, const can::LogRecord& record) {
    ++frames_[gyro];
    const gateway::GyroInput::Result input = inputs_[gyro].decode(record.frame);
    if (input.reject) return;
    TimePoint t;
    switch (guard_.check(gyro, record.stamp, t)) {
      case fusion::StampGuard::Verdict::kRepeated:
      case fusion::StampGuard::Verdict::kUnconfirmed:
        return;
      case fusion::StampGuard::Verdict::kClockStep:
        aligner_.clear();
        break;
      case fusion::StampGuard::Verdict::kAccepted:
        break;
    }
    if (!aligner_.push(gyro, t, input.rate_dps)) return;
    if (samples_[0] + samples_[1] == 0) origin_ = t;
    ++samples_[gyro];
    own_[gyro].add(to_seconds(t - origin_), {input.rate_dps, 0.0});
    fusion::AlignedPair pair;
    while (aligner_.pop(pair)) {
      ++pairs_;
      noise_gain_sum_ += std::min(pair.noise_gain[0], pair.noise_gain[1]);
      paired_.add(to_seconds(pair.t - origin_), pair.rate_dps);
    }
  }

  const gateway::Plan& plan_;
  gateway::Router router_;
  std::array<gateway::GyroInput, 2> inputs_;
  fusion::StampGuard guard_;
  fusion::Aligner aligner_;
  std::array<analysis::SeriesBuilder, 2> own_;
  analysis::SeriesBuilder paired_;
  std::vector<can::BusIndex> buses_;  ///< by the log's own index; beyond the plan's: foreign
  std::vector<std::string> interfaces_;
  std::array<std::uint64_t, 2> frames_{};
  std::array<std::uint64_t, 2> samples_{};
  std::uint64_t pairs_ = 0;
  double noise_gain_sum_ = 0.0;
  TimePoint origin_;
};

}  // namespace

Expected<analysis::PairRecording> read_pair_recording(const std::string& log,
                                                      const gateway::Plan& plan) {
  Gatherer gatherer(plan);
  if (auto done = gatherer.read(log); !done) return tl::unexpected(done.error());
  if (const auto complaint = gatherer.complaint(log)) return tl::unexpected(*complaint);
  return gatherer.finish();
}

}  // namespace vgyro::cli
