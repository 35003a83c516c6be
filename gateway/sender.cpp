#include "gateway/sender.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace vgyro::gateway {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

TimePoint next_on_grid(TimePoint t) {
  const std::int64_t period = Sender::kBiasPeriod.count();
  return TimePoint{Duration{to_ns(t) / period * period + period}};
}

}  // namespace

Sender::Turn::Turn(Sender& sender, FrameSink& sink, TimePoint stamp) : sender_(sender) {
  assert(sender.sink_ == nullptr);
  sender.sink_ = &sink;
  sender.stamp_ = stamp;
}

Sender::Sender(const OutputPlan& plan)
    : encoder_(plan),
      layouts_(plan),
      vgyro_frames_(plan.vgyro_frames),
      rate_dps_(kNone),
      sigma_dps_(kNone) {}

bool Sender::send_rate(const RateOutput& output) {
  assert(sink_ != nullptr);
  const bool in_range =
      vgyro_frames_ ? encoder_.can_carry(output.rate_dps) : std::isfinite(output.rate_dps);
  const bool valid = output.valid && in_range;
  ++rates_;
  if (valid) ++rates_valid_;
  if (output.valid && !in_range) ++rates_out_of_range_;
  rate_dps_ = valid ? output.rate_dps : kNone;
  sigma_dps_ = valid ? output.sigma_dps : kNone;
  quality_ = valid ? output.quality : Quality::kUnusable;
  // The encoder also marks a rate that it cannot carry as invalid.
  if (vgyro_frames_ && collector_ != nullptr) {
    collector_->collect(axis_, output);
  } else if (vgyro_frames_) {
    sink_->put(encoder_.rate(output), stamp_);
  }
  if (shared_layouts_ != nullptr || !layouts_.empty()) send_layouts(output);
  return valid;
}

void Sender::send_layouts(const RateOutput& output) {
  LayoutSet& layouts = shared_layouts_ != nullptr ? *shared_layouts_ : layouts_;
  layouts.take(axis_, output, stamp_, *sink_);
}

void Sender::send_bias(const BiasOutput& bias, const ModelOutput& model) {
  assert(sink_ != nullptr);
  ++bias_times_;
  if (!vgyro_frames_) return;
  ++biases_;
  sink_->put(encoder_.bias(bias), stamp_);
  sink_->put(encoder_.model(model), stamp_);
}

bool Sender::reach_grid(TimePoint t) {
  const bool clock_set_back = next_bias_ - t > kGridAheadMax;
  if (t < next_bias_ && !clock_set_back) return false;
  next_bias_ = next_on_grid(t);
  return true;
}

bool Sender::miss_grid(TimePoint t, Duration sample_interval) {
  if (t < grid_missed_at(sample_interval)) return false;
  next_bias_ = next_on_grid(t);
  return true;
}

TimePoint Sender::grid_missed_at(Duration sample_interval) const {
  return next_bias_ + std::max<Duration>(kBiasGrace, 2 * sample_interval);
}

void Sender::count_on_from(const Sender& before) {
  encoder_.count_on_from(before.encoder_);
  layouts_.count_on_from(before.layouts_);
}

void Sender::change_plan(const OutputPlan& plan) {
  Sender changed(plan);
  changed.count_on_from(*this);
  encoder_ = changed.encoder_;
  layouts_.change_plan(plan);
  vgyro_frames_ = changed.vgyro_frames_;
}

void Sender::tell(Status& status) const {
  status.rates_out = rates_;
  status.rates_out_valid = rates_valid_;
  status.rates_out_of_range = rates_out_of_range_;
  status.biases_out = biases_;
  layouts_.tell(status);
  status.rate_dps = rate_dps_;
  status.sigma_dps = sigma_dps_;
  status.quality = quality_;
}

}  // namespace vgyro::gateway
