#include "gateway/reference_calibration.h"

namespace vgyro::gateway {

void ReferenceCalibration::add_pair(const fusion::AlignedPair& pair) {
  if (size_ == kPendingMax) {
    head_ = (head_ + 1) % kPendingMax;
    --size_;
  }
  pending_[(head_ + size_) % kPendingMax] = pair;
  ++size_;
}

void ReferenceCalibration::add_reference(TimePoint t, double rate_dps) {
  const bool set_back = newest_ && newest_->t - t > kGapMax;
  if (newest_ && t <= newest_->t && !set_back) return;
  before_ = set_back ? std::nullopt : newest_;
  newest_ = ReferenceSample{t, rate_dps};
}

std::optional<ReferenceCalibration::Ready> ReferenceCalibration::next() {
  while (size_ > 0 && newest_) {
    const fusion::AlignedPair& pair = pending_[head_];
    if (pair.t > newest_->t) return std::nullopt;
    head_ = (head_ + 1) % kPendingMax;
    --size_;
    const bool covered = before_ && pair.t >= before_->t && newest_->t - before_->t <= kGapMax;
    if (!covered) continue;
    const double share = static_cast<double>((pair.t - before_->t).count()) /
                         static_cast<double>((newest_->t - before_->t).count());
    return Ready{pair, before_->rate_dps + share * (newest_->rate_dps - before_->rate_dps)};
  }
  return std::nullopt;
}

}  // namespace vgyro::gateway
