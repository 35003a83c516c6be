#include "gateway/e2e_check.h"

#include <bit>

namespace vgyro::gateway {

const E2ePlan E2eCheck::kNothing;

std::optional<Reject> E2eCheck::verify_check_value(const can::Frame& frame) const {
  const dbc::E2eProtection& protection = plan_->crc->protection;
  if (frame.length < protection.bytes()) return Reject::kTruncated;
  if (!protection.check(frame.payload())) return Reject::kCrcWrong;
  return std::nullopt;
}

bool E2eCheck::is_beyond(std::span<const std::uint8_t> payload) const {
  return bits(payload) >= plan_->counter->modulus;
}

std::uint32_t E2eCheck::read(std::span<const std::uint8_t> payload) const {
  const std::uint32_t modulus = plan_->counter->modulus;
  const auto now = static_cast<std::uint32_t>(bits(payload)) & (std::bit_ceil(modulus) - 1);
  return now >= modulus ? now - modulus : now;
}

std::uint32_t E2eCheck::step(std::uint32_t from, std::uint32_t to) const {
  return to >= from ? to - from : to + plan_->counter->modulus - from;
}

// The counter did not move: is it another page of the same round, or a repeated frame?
bool E2eCheck::is_new_round(std::uint32_t now, Page page) const {
  if (page == Page::kOther) return true;  // another page matters only for its number
  return page_ == Page::kOther && own_counter_ != now;
}

// A sender that counts by two, or that loses frames there, reaches its last value by a jump.
void E2eCheck::note_early_turn() {
  if (jumped_to_ == counter_) return;
  if (counter_ != early_turn_) early_turns_ = 0;
  early_turn_ = counter_;
  ++early_turns_;
}

std::optional<Reject> E2eCheck::follow(std::uint32_t now, std::uint32_t& missing) {
  const std::uint32_t most = plan_->counter->max_delta;
  const std::uint32_t moved = step(counter_, now);
  if (known_ && counts_missing_ && moved > 0) {
    if (now == 0 && moved > 1) note_early_turn();
    if (most == 0 || moved <= most) {
      missing = moved - 1;
    } else {
      // Two refused frames in sequence are a sender that restarted. Frames of a foreign sender
      // alternate with the true sender's own and never form such a sequence.
      const std::uint32_t since = out_of_sequence_ ? step(*out_of_sequence_, now) : 0;
      out_of_sequence_ = now;
      if (since == 0 || since > most) return Reject::kWrongSequence;
    }
  }
  if (moved != 1) jumped_to_ = now;
  counter_ = now;
  known_ = true;
  counts_missing_ = true;
  out_of_sequence_.reset();
  return std::nullopt;
}

std::optional<Reject> E2eCheck::count_any(std::span<const std::uint8_t> payload,
                                          std::uint32_t& missing, Page page) {
  const AliveCounter& counter = *plan_->counter;
  const bool is_there = counter.codec.fits(payload.size()) &&
                        (counter.presence.always() || counter.presence.holds(payload));
  if (!is_there) return std::nullopt;
  if (counter.strict && is_beyond(payload)) return Reject::kWrongSequence;
  const std::uint32_t now = read(payload);
  if (known_ && now == counter_ && !is_new_round(now, page)) return Reject::kCounterRepeated;
  if (const auto reject = follow(now, missing)) return reject;
  page_ = page;
  if (page == Page::kOwn) own_counter_ = now;
  return std::nullopt;
}

std::optional<Reject> E2eCheck::judge(const can::Frame& frame, Page page) {
  if (const auto reject = verify(frame)) return reject;
  const bool own = page == Page::kOwn;
  if (own && plan_->counter && !plan_->counter->codec.fits(frame.length)) return Reject::kTruncated;
  std::uint32_t missing = 0;
  return count(frame.payload(), missing, page);
}

void E2eCheck::fall_silent() {
  counts_missing_ = false;
  out_of_sequence_.reset();
}

}  // namespace vgyro::gateway
