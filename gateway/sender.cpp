#include "gateway/sender.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

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
      layouts_(plan.layouts.begin(), plan.layouts.end()),
      bus_(plan.bus),
      vgyro_frames_(plan.vgyro_frames),
      rate_dps_(kNone),
      sigma_dps_(kNone) {
  assert(layouts_.size() <= kOutputLayoutsMost);
}

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
  // The encoder, too, makes one that it cannot carry invalid.
  if (vgyro_frames_ && collector_ != nullptr) {
    collector_->collect(axis_, output);
  } else if (vgyro_frames_) {
    sink_->put(encoder_.rate(output), stamp_);
  }
  if (!layouts_.empty()) send_layouts(output);
  return valid;
}

void Sender::send_layouts(const RateOutput& output) {
  for (LayoutEncoder& layout : layouts_) {
    const can::Frame* frame = layout.rate(output, stamp_);
    if (frame == nullptr) continue;
    if (layout.bus() == bus_) {
      sink_->put(*frame, stamp_);
    } else {
      sink_->put_on(layout.bus(), *frame, stamp_);
    }
  }
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

// One identifier may go out on several buses: the first of them goes on from the first, and so on.
const LayoutEncoder* Sender::predecessor(std::size_t index, const Sender& before) const {
  const LayoutEncoder& layout = layouts_[index];
  const auto is_same = [&](const LayoutEncoder& other) { return layout.sends_same_frame(other); };
  auto left = std::count_if(layouts_.begin(), layouts_.begin() + static_cast<std::ptrdiff_t>(index),
                            is_same);
  for (const LayoutEncoder& other : before.layouts_) {
    if (is_same(other) && left-- == 0) return &other;
  }
  return nullptr;
}

void Sender::count_on_from(const Sender& before) {
  encoder_.count_on_from(before.encoder_);
  for (std::size_t i = 0; i < layouts_.size(); ++i) {
    if (const LayoutEncoder* other = predecessor(i, before)) layouts_[i].go_on_from(*other);
  }
}

void Sender::change_plan(const OutputPlan& plan) {
  Sender changed(plan);
  changed.count_on_from(*this);
  for (std::size_t i = 0; i < changed.layouts_.size(); ++i) {
    if (const LayoutEncoder* other = changed.predecessor(i, *this))
      changed.layouts_[i].take_books_of(*other);
  }
  encoder_ = changed.encoder_;
  layouts_ = std::move(changed.layouts_);
  bus_ = changed.bus_;
  vgyro_frames_ = changed.vgyro_frames_;
}

void Sender::tell(Status& status) const {
  status.rates_out = rates_;
  status.rates_out_valid = rates_valid_;
  status.rates_out_of_range = rates_out_of_range_;
  status.biases_out = biases_;
  status.layouts_out = {};
  for (std::size_t i = 0; i < layouts_.size(); ++i)
    status.layouts_out[i] = layouts_[i].counts();
  status.rate_dps = rate_dps_;
  status.sigma_dps = sigma_dps_;
  status.quality = quality_;
}

}  // namespace vgyro::gateway
