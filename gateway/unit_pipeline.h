#pragma once

// Two whole units: an AxisPipeline for each axis of the vehicle, fed from the units' frames, and
// what needs all axes together: mounts, the misalignment of the units, stops, which are stops of
// all axes, and frames that carry all rates. Opens nothing, reads no clock, allocates nothing after
// construction.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "can/frame.h"
#include "fusion/misalignment.h"
#include "gateway/axis_pipeline.h"
#include "gateway/frame_sink.h"
#include "gateway/heading.h"
#include "gateway/output_frames.h"
#include "gateway/output_layout.h"
#include "gateway/plan.h"
#include "gateway/router.h"
#include "gateway/saved_state.h"
#include "gateway/status.h"

namespace vgyro::gateway {

/// One FD frame for all axes: collects the rates of one instant until they are complete.
class SharedRates final : public RateCollector {
 public:
  explicit SharedRates(const OutputPlan& plan) : encoder_(plan) {}

  void begin(FrameSink& sink, TimePoint stamp);
  /// Sends the collected rates.
  void flush();
  void end();
  void collect(std::size_t axis, const RateOutput& output) override;
  void count_on_from(const SharedRates& before) { encoder_.count_on_from(before.encoder_); }

 private:
  AxesEncoder encoder_;
  FrameSink* sink_ = nullptr;
  TimePoint stamp_;
  std::array<std::optional<RateOutput>, kAxes> rates_;
  bool any_ = false;
};

class UnitPipeline {
 public:
  /// Precondition: plan.axes is not empty.
  explicit UnitPipeline(const Plan& plan);

  // As in Pipeline.

  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void advance(TimePoint now, FrameSink& sink);
  [[nodiscard]] TimePoint next_deadline() const;
  /// The platform's status: sums, and the worst of its axes.
  const Status& refreshed_status();
  [[nodiscard]] std::size_t axis_count() const { return axes_.size(); }
  const Status& axis_status(std::size_t place) { return axes_[place]->refreshed_status(); }
  [[nodiscard]] std::uint64_t spoken() const;
  [[nodiscard]] std::optional<SavedState> memory() const;
  Expected<void> resume(const SavedState& state);
  void count_on_from(const UnitPipeline& before);
  void change_output(const Plan& plan);
  void observe(std::size_t place, RateObserver* observer) { axes_[place]->observe(observer); }
  void observe_output(std::size_t place, OutputObserver* observer) {
    axes_[place]->observe_output(observer);
  }
  [[nodiscard]] const Plan& plan() const { return plan_; }

 private:
  using Pairs = std::array<std::optional<fusion::AlignedPair>, kAxes>;
  /// The readings of a unit's sensor axes, and how they turn into the vehicle's. Both are in the
  /// order of `axes_`: a pair's own sensor axis has the same place.
  struct Unit {
    std::array<std::array<double, kAxes>, kAxes> share{};
    bool turns = false;
    /// Whether both axes are in one message.
    std::array<std::array<bool, kAxes>, kAxes> together{};
    std::array<double, kAxes> reading_dps{};
    std::array<TimePoint, kAxes> read_at{};  ///< stamp of the reading
  };
  /// Whether the reading of one axis can be used for another.
  enum class Worth : std::uint8_t { kNew, kOld, kSick };
  class Turn;

  /// Between these two calls, output that concerns all axes goes to this sink.
  void begin_output(FrameSink& sink, TimePoint stamp);
  void end_output();
  void share_output();
  void settle_output();
  [[nodiscard]] Unit unit_of(std::size_t gyro) const;
  [[nodiscard]] bool nothing_due(TimePoint stamp) const;
  void receive_unit(std::size_t gyro, std::uint8_t role,
                    const std::array<std::uint8_t, kAxes>& roles, const can::Frame& frame,
                    TimePoint stamp);
  [[nodiscard]] Worth worth(std::size_t gyro, std::size_t place, std::size_t other,
                            TimePoint stamp) const;
  /// Computes the rate about an axis of the vehicle. kOld or kSick if a sensor axis that matters
  /// there is missing.
  Worth turn(std::size_t gyro, std::size_t place, TimePoint stamp, double& rate_dps) const;
  void take_pairs();
  void take_round(Pairs& pairs);
  void note_rates(const Pairs& pairs);
  void learn_misalignment(const Pairs& pairs);
  void begin(TimePoint t);
  [[nodiscard]] double age_s(TimePoint t) const;
  [[nodiscard]] double doubt_of(const SavedState& state, const Plan& pair) const;
  void set_cross(std::size_t place);
  void note_single(std::size_t gyro, std::size_t place, double rate_dps);
  void share_motion();
  void share_calibrations(TimePoint t);
  void share_restarts();
  void follow_heading(TimePoint t);
  [[nodiscard]] std::optional<Heading::Turn> turn_about_z();
  void share_heading();

  Plan plan_;
  Router router_;
  std::vector<std::unique_ptr<AxisPipeline>> axes_;
  std::array<Unit, 2> units_;
  std::optional<SharedRates> shared_;
  LayoutSet layouts_;
  FrameSink* sink_ = nullptr;
  TimePoint stamp_;
  fusion::Misalignment misalignment_;
  bool learns_misalignment_ = false;
  fusion::AxisRates rate_dps_{};  ///< about x, y, z: the platform's newest rates, less biases
  TimePoint origin_;
  bool begun_ = false;
  std::optional<fusion::MisalignmentMemory> saved_;
  TimePoint saved_stamp_;
  bool resumed_ = false;
  Pairs waiting_;  ///< pairs that wait for those of the other axes

  std::array<fusion::Elsewhere, kAxes> told_{};
  std::array<std::uint64_t, kAxes> told_of_{};  ///< editions of the conditions that told_ was made
                                                ///< from
  std::array<std::uint64_t, kAxes> restarts_{};
  bool cut_short_ = false;  ///< motion seen by one axis has cut short the calibrations of all
  Heading heading_;
  Status status_;
};

}  // namespace vgyro::gateway
