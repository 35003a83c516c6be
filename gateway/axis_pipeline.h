#pragma once

// One axis of the platform: two gyros about it, frames and time in, virtual rate out. Of a pair of
// single gyros it is the whole pipeline, and receive() is all that is asked of it. Of two whole
// units there is one for each axis; gateway/unit_pipeline.h then takes its steps one by one, and
// between them does what needs all axes. Opens nothing, reads no clock, allocates nothing once it
// is constructed. The states and their transitions are in ARCHITECTURE.md.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "base/error.h"
#include "base/time.h"
#include "can/frame.h"
#include "fusion/alignment.h"
#include "fusion/corrector.h"
#include "fusion/stamp_guard.h"
#include "gateway/attendance.h"
#include "gateway/estimator.h"
#include "gateway/frame_sink.h"
#include "gateway/intake.h"
#include "gateway/known_effects.h"
#include "gateway/observers.h"
#include "gateway/plan.h"
#include "gateway/router.h"
#include "gateway/saved_state.h"
#include "gateway/sender.h"
#include "gateway/status.h"
#include "gateway/surroundings.h"

namespace vgyro::gateway {

class AxisPipeline {
 public:
  AxisPipeline(const Plan& the_plan, std::unique_ptr<fusion::Corrector> corrector);
  /// Its parts refer to each other.
  AxisPipeline(const AxisPipeline&) = delete;
  AxisPipeline& operator=(const AxisPipeline&) = delete;

  // As of Pipeline.

  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void advance(TimePoint now, FrameSink& sink);
  [[nodiscard]] TimePoint next_deadline() const {
    // Time passes in whole microseconds: due a fraction earlier it would be due and not done.
    return std::chrono::ceil<std::chrono::microseconds>(deadline_ - guard_.offset());
  }
  const Status& refreshed_status();
  [[nodiscard]] std::uint64_t spoken() const { return sender_.spoken(); }
  [[nodiscard]] std::optional<SavedState> memory() const;
  Expected<void> resume(const SavedState& state);
  void count_on_from(const AxisPipeline& before) { sender_.count_on_from(before.sender_); }
  /// Its plan is the same as `output`'s but for the output.
  void change_output(const OutputPlan& output);
  void observe(RateObserver* observer) { observer_ = observer; }
  void observe_output(OutputObserver* observer) { output_observer_ = observer; }
  [[nodiscard]] const Plan& plan() const { return plan_; }

  // Step by step, for a platform of several axes. Precondition of all: a Turn.

  using Turn = Sender::Turn;
  [[nodiscard]] Sender& sender() { return sender_; }
  [[nodiscard]] std::uint8_t roles(can::BusIndex bus, const can::Frame& frame) const {
    return router_.roles(bus, frame);
  }
  /// Nothing is due before this stamp's time, and it is one.
  [[nodiscard]] bool nothing_due(TimePoint stamp) const {
    return guard_.can_be_time(stamp) && stamp + guard_.offset() < deadline_;
  }
  /// What is not a gyro's: reference, accelerometer, speed; and time.
  void receive_besides(std::uint8_t roles, const can::Frame& frame, TimePoint stamp);

  /// A usable reading, less the known effects, in the sensor's own axis.
  struct Reading {
    TimePoint t;
    double raw_dps = 0.0;
    double rate_dps = 0.0;
  };
  /// False where the frame gives none; that is dealt with then.
  bool admit(std::size_t gyro, const can::Frame& frame, TimePoint stamp, Reading& reading);
  /// No rate about this axis, because another axis of its unit is missing: that one is faulty, or
  /// its last reading is too old.
  void go_without(std::size_t gyro, TimePoint t, bool other_is_sick);
  /// The reading, turned into the vehicle's axes. False where it comes too late to be used.
  bool offer(std::size_t gyro, const Reading& reading, double rate_dps);
  /// The next pair; to be followed by take_pair().
  bool pop(fusion::AlignedPair& pair) { return aligner_.pop(pair); }
  void take_pair(const fusion::AlignedPair& pair);
  /// Another axis's calibration was ended by motion at `t`.
  void end_calibration(TimePoint t, TimePoint still_until);
  /// An offered reading arrives: first what is due, then …
  void arrive(std::size_t gyro, TimePoint t);
  /// … the pairs that came of it, and this, where none does because the other gyro is not there.
  void speak_alone(std::size_t gyro, TimePoint t, double rate_dps);

  /// What gyro 2 reads too much for it is not quite parallel to gyro 1, and the variance that is
  /// left of it; of the rates to come.
  void set_cross(double rate_dps, double variance_dps2);
  [[nodiscard]] Estimator& estimator() { return estimator_; }
  [[nodiscard]] const Estimator& estimator() const { return estimator_; }
  /// The newest virtual rate; NaN where that is not valid.
  [[nodiscard]] double rate_dps() const { return sender_.rate_dps(); }
  /// 1σ of what the Earth's rate may have been instead while the biases were learned.
  void set_earth_doubt(double doubt_dps) { earth_doubt_dps_ = doubt_dps; }
  [[nodiscard]] double earth_doubt_dps() const { return earth_doubt_dps_; }
  /// Its σ, and that of the bias in it as of the last window; NaN where none is stated.
  [[nodiscard]] double sigma_dps() const { return sender_.sigma_dps(); }
  [[nodiscard]] double bias_sigma_dps() {
    (void)bias_dps();
    return bias_sigma_dps_;
  }
  /// Of both gyros, as of the last window; 0 before there are any.
  [[nodiscard]] const std::array<double, 2>& bias_dps();
  /// A time of the pairs on the clock of the frames.
  [[nodiscard]] TimePoint stamp_of(TimePoint t) const { return t - guard_.offset(); }
  [[nodiscard]] const Status& status() const { return status_; }
  [[nodiscard]] bool in_use(std::size_t gyro) const { return attendance_.in_use(gyro); }
  [[nodiscard]] bool pairing() const { return attendance_.pairing(); }
  /// Its own sensor axis may not be used for now.
  [[nodiscard]] bool set_aside(std::size_t gyro) const { return attendance_.set_aside(gyro); }
  /// Between its samples; 0 while unknown.
  [[nodiscard]] Duration interval(std::size_t gyro) const {
    return aligner_.chosen() ? attendance_.usual_interval(gyro) : guard_.interval(gyro);
  }

 private:
  /// Code of its own for each gyro, to which the places of all that belongs to it are constants,
  /// and in one piece: some twenty calls a frame would cost a fifth of it. What is rare says so.
  template <std::size_t gyro>
  [[gnu::flatten]] void receive_gyro(const can::Frame& frame, TimePoint stamp);
  template <std::size_t gyro>
  bool admit_of(const can::Frame& frame, TimePoint stamp, Reading& reading);
  [[gnu::noinline]] void receive_reference(const can::Frame& frame, TimePoint stamp);
  [[gnu::noinline]] void receive_surroundings(std::uint8_t roles, const can::Frame& frame,
                                              TimePoint stamp);
  template <std::size_t gyro>
  [[nodiscard]] double take_back(TimePoint t, double reading_dps);
  [[gnu::cold, gnu::noinline]] void step_clock();
  [[gnu::cold, gnu::noinline]] void pass_over(std::size_t gyro, const GyroIntake::Result& taken,
                                              TimePoint stamp);
  [[gnu::cold, gnu::noinline]] void refuse(std::size_t gyro, Reject cause, TimePoint t);
  void carry_on_without(std::size_t gyro, TimePoint t);

  void take_sample(std::size_t gyro, TimePoint t, double rate_dps);
  [[gnu::noinline]] void take_single(std::size_t gyro, TimePoint t, double rate_dps, Duration age);
  void tell_estimator(TimePoint t);
  void tell_surroundings(TimePoint t, double rate_dps, bool valid);
  void note_condition(TimePoint t);
  [[gnu::cold, gnu::noinline]] void add_doubt(fusion::VirtualRate& rate, TimePoint t);
  void add_cross_doubt(fusion::VirtualRate& rate) const;
  [[nodiscard]] bool is_parallel_enough(const fusion::AlignedPair& pair) const;

  [[nodiscard]] TimePoint on_axis(TimePoint stamp) const;
  void let_time_pass(TimePoint stamp);
  [[gnu::cold, gnu::noinline]] void do_what_is_due(TimePoint t);
  void enter_state();
  [[nodiscard]] State present_state() const;

  void publish(const fusion::VirtualRate& rate, bool valid, TimePoint t, Duration age);
  [[gnu::cold, gnu::noinline]] void send_bias();
  [[nodiscard]] fusion::Drift present_drift() const;
  [[nodiscard]] std::uint8_t health() const;

  Plan plan_;
  Router router_;
  std::array<GyroIntake, 2> inputs_;
  std::optional<ScalarIntake> reference_input_;
  Surroundings surroundings_;
  KnownEffects known_effects_;
  fusion::StampGuard guard_;
  fusion::Aligner aligner_;
  Attendance attendance_;
  Estimator estimator_;
  Sender sender_;
  RateObserver* observer_ = nullptr;
  OutputObserver* output_observer_ = nullptr;
  Status status_;

  TimePoint newest_;                  ///< newest instant given to the output
  TimePoint deadline_{};              ///< nothing is due before; may be too early, never too late
  TimePoint reached_{};               ///< newest accepted time
  TimePoint suspect_{};               ///< stamp far ahead, not confirmed yet
  std::array<double, 2> bias_dps_{};  ///< for bias_dps()
  double bias_sigma_dps_;             ///< for bias_sigma_dps()
  std::uint64_t bias_windows_ = 0;    ///< when that was asked for last
  bool has_cross_ = false;
  double cross_dps_ = 0.0;            ///< what gyro 2 reads of the other axes
  double cross_variance_dps2_ = 0.0;  ///< and how far that may be wrong
  double earth_doubt_dps_;            ///< for add_cross_doubt()
};

}  // namespace vgyro::gateway
