#include "gateway/pipeline.h"

#include <cassert>
#include <utility>

#include "gateway/axis_pipeline.h"
#include "gateway/unit_pipeline.h"

namespace vgyro::gateway {

Pipeline::Pipeline(const Plan& plan) {
  if (plan.axes.empty()) {
    single_ = std::make_unique<AxisPipeline>(plan, make_corrector(plan));
  } else {
    units_ = std::make_unique<UnitPipeline>(plan);
  }
}

Pipeline::Pipeline(const Plan& plan, std::unique_ptr<fusion::Corrector> corrector)
    : single_(std::make_unique<AxisPipeline>(plan, std::move(corrector))) {
  assert(plan.axes.empty());
}

Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;
Pipeline::~Pipeline() = default;

void Pipeline::receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp,
                       FrameSink& out) {
  if (single_) [[likely]] {
    single_->receive(bus, frame, stamp, out);
  } else {
    units_->receive(bus, frame, stamp, out);
  }
}

void Pipeline::advance(TimePoint now, FrameSink& out) {
  if (single_) {
    single_->advance(now, out);
  } else {
    units_->advance(now, out);
  }
}

TimePoint Pipeline::next_deadline() const {
  return single_ ? single_->next_deadline() : units_->next_deadline();
}

const Status& Pipeline::status() const {
  return single_ ? single_->refreshed_status() : units_->refreshed_status();
}

std::size_t Pipeline::axis_count() const {
  return units_ ? units_->axis_count() : 0;
}

const Status& Pipeline::axis_status(std::size_t place) const {
  assert(place < axis_count());
  return units_->axis_status(place);
}

std::uint64_t Pipeline::spoken() const {
  return single_ ? single_->spoken() : units_->spoken();
}

std::optional<SavedState> Pipeline::memory() const {
  return single_ ? single_->memory() : units_->memory();
}

Expected<void> Pipeline::resume(const SavedState& state) {
  return single_ ? single_->resume(state) : units_->resume(state);
}

void Pipeline::count_on_from(const Pipeline& before) {
  if (single_ && before.single_) single_->count_on_from(*before.single_);
  if (units_ && before.units_) units_->count_on_from(*before.units_);
}

void Pipeline::take_over(Pipeline&& before) {
  if (single_) {
    assert(before.single_ && same_but_output(single_->plan(), before.single_->plan()));
    before.single_->change_output(single_->plan().output);
    single_ = std::move(before.single_);
  } else {
    assert(before.units_ && same_but_output(units_->plan(), before.units_->plan()));
    before.units_->change_output(units_->plan());
    units_ = std::move(before.units_);
  }
}

void Pipeline::observe(RateObserver* observer, std::size_t place) {
  if (single_) {
    single_->observe(observer);
  } else {
    units_->observe(place, observer);
  }
}

void Pipeline::observe_output(OutputObserver* observer, std::size_t place) {
  if (single_) {
    single_->observe_output(observer);
  } else {
    units_->observe_output(place, observer);
  }
}

}  // namespace vgyro::gateway
