#pragma once

// One axis of the platform: frames of two gyros and time in, virtual rate out. With two single
// gyros it is the whole pipeline, and only receive() and advance() are called. With two whole units
// there is one for each axis; gateway/unit_pipeline.h then calls its steps one by one and does
// between them what needs all axes. Opens nothing, reads no clock, allocates nothing after
// construction. ARCHITECTURE.md lists the states and their transitions.

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

  // As in Pipeline.

  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void advance(TimePoint now, FrameSink& sink);
  [[nodiscard]] TimePoint next_deadline() const {
    // Time advances in whole microseconds: rounded down, the deadline would pass with nothing done.
    return std::chrono::ceil<std::chrono::microseconds>(deadline_ - guard_.offset());
  }
  const Status& refreshed_status();
  [[nodiscard]] std::uint64_t spoken() const { return sender_.spoken(); }
  [[nodiscard]] std::optional<SavedState> memory() const;
  Expected<void> resume(const SavedState& state);
  void count_on_from(const AxisPipeline& before) { sender_.count_on_from(before.sender_); }
  /// Precondition: the own plan differs from the new one in the output alone.
  void change_output(const OutputPlan& output);
  void observe(RateObserver* observer) { observer_ = observer; }
  void observe_output(OutputObserver* observer) { output_observer_ = observer; }
  [[nodiscard]] const Plan& plan() const { return plan_; }

  // Step by step, for a platform of several axes. Precondition of all steps: a Turn.

  using Turn = Sender::Turn;
  [[nodiscard]] Sender& sender() { return sender_; }
  [[nodiscard]] std::uint8_t roles(can::BusIndex bus, const can::Frame& frame) const {
    return router_.roles(bus, frame);
  }
  /// The stamp is valid, and nothing is due before its time.
  [[nodiscard]] bool nothing_due(TimePoint stamp) const {
    return guard_.can_be_time(stamp) && stamp + guard_.offset() < deadline_;
  }
  /// Inputs other than the gyros (reference, accelerometer, speed), and passing time.
  void receive_besides(std::uint8_t roles, const can::Frame& frame, TimePoint stamp);

  /// A usable reading, less the known effects, in the sensor's own axis.
  struct Reading {
    TimePoint t;
    double raw_dps = 0.0;
    double rate_dps = 0.0;
  };
  /// False when the frame holds no usable reading; admit() has then handled it.
  bool admit(std::size_t gyro, const can::Frame& frame, TimePoint stamp, Reading& reading);
  /// This axis gets no rate, because another axis of its unit is missing: either faulty
  /// (`other_is_sick`), or its last reading is too old.
  void go_without(std::size_t gyro, TimePoint t, bool other_is_sick);
  /// Takes the reading, turned into the vehicle's axes. False when it is too late to be used.
  bool offer(std::size_t gyro, const Reading& reading, double rate_dps);
  /// The next pair. The caller then passes it to take_pair().
  bool pop(fusion::AlignedPair& pair) { return aligner_.pop(pair); }
  void take_pair(const fusion::AlignedPair& pair);
  /// Motion ended the calibration of another axis at `t`.
  void end_calibration(TimePoint t, TimePoint still_until);
  /// Handles an offered reading: first what is due, then …
  void arrive(std::size_t gyro, TimePoint t);
  /// … the caller takes the pairs, and calls this for a rate of one gyro alone if the other is
  /// missing.
  void speak_alone(std::size_t gyro, TimePoint t, double rate_dps);

  /// Set for the rates to come: the part of gyro 2's reading that comes from other axes because it
  /// is not quite parallel to gyro 1, and the remaining variance of that estimate.
  void set_cross(double rate_dps, double variance_dps2);
  [[nodiscard]] Estimator& estimator() { return estimator_; }
  [[nodiscard]] const Estimator& estimator() const { return estimator_; }
  /// The newest virtual rate; NaN if that was not valid.
  [[nodiscard]] double rate_dps() const { return sender_.rate_dps(); }
  /// 1σ of the error in the Earth's rate that was assumed while the biases were learned.
  void set_earth_doubt(double doubt_dps) { earth_doubt_dps_ = doubt_dps; }
  [[nodiscard]] double earth_doubt_dps() const { return earth_doubt_dps_; }
  /// σ of the newest rate, and σ of its bias at the last window; NaN where none is stated.
  [[nodiscard]] double sigma_dps() const { return sender_.sigma_dps(); }
  [[nodiscard]] double bias_sigma_dps() {
    (void)bias_dps();
    return bias_sigma_dps_;
  }
  /// Biases of both gyros at the last window; 0 before the first.
  [[nodiscard]] const std::array<double, 2>& bias_dps();
  /// Converts a time of the pairs to the clock of the frames.
  [[nodiscard]] TimePoint stamp_of(TimePoint t) const { return t - guard_.offset(); }
  [[nodiscard]] const Status& status() const { return status_; }
  [[nodiscard]] bool in_use(std::size_t gyro) const { return attendance_.in_use(gyro); }
  [[nodiscard]] bool pairing() const { return attendance_.pairing(); }
  /// The gyro's own sensor axis may not be used for now.
  [[nodiscard]] bool set_aside(std::size_t gyro) const { return attendance_.set_aside(gyro); }
  /// Usual interval between samples of this gyro; 0 while unknown.
  [[nodiscard]] Duration interval(std::size_t gyro) const {
    return aligner_.chosen() ? attendance_.usual_interval(gyro) : guard_.interval(gyro);
  }

 private:
  /// Instantiated for each gyro and inlined completely, so that addresses of its members are
  /// constants: some twenty calls for each frame would cost a fifth of its time. Rare paths are
  /// marked noinline.
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
  TimePoint suspect_{};               ///< stamp far ahead that no other has confirmed yet
  std::array<double, 2> bias_dps_{};  ///< for bias_dps()
  double bias_sigma_dps_;             ///< for bias_sigma_dps()
  std::uint64_t bias_windows_ = 0;    ///< Estimator::windows() at the last bias_dps()
  bool has_cross_ = false;
  double cross_dps_ = 0.0;            ///< part of gyro 2's rate that comes from the other axes
  double cross_variance_dps2_ = 0.0;  ///< and its variance
  double earth_doubt_dps_;            ///< for add_cross_doubt()
};

}  // namespace vgyro::gateway
