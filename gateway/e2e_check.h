#pragma once

// Checks whether a frame is complete, from its sender and new, by check value and alive counter as
// far as the configuration names them. Handles one message; checks nothing else.

#include <cstdint>
#include <optional>
#include <span>

#include "can/frame.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class E2eCheck {
 public:
  /// For a message without E2E: every data frame passes.
  E2eCheck() : plan_(&kNothing) {}
  explicit E2eCheck(const E2ePlan& plan) : plan_(&plan) {}

  /// Checks that it is a data frame with the right check value. Returns nothing when it is,
  /// otherwise the cause; then do not pass the frame to count().
  [[nodiscard]] std::optional<Reject> verify(const can::Frame& frame) const {
    if (!frame.is_data()) return Reject::kNotData;
    return plan_->crc ? verify_check_value(frame) : std::nullopt;
  }

  /// Which page of a multiplexed message the frame carries: the one that is read, or another one.
  enum class Page : std::uint8_t { kOwn, kOther };

  /// Checks the alive counter of a complete frame; `missing` of them were lost before it. Returns
  /// nothing when the frame is new, otherwise the cause. A counter that stands on all pages is
  /// followed over all of them, since it counts the frames of the message. If it counts rounds of
  /// pages, a frame of the own page is new when its counter differs from the one before.
  /// Precondition: on the own page the counter fits the payload.
  std::optional<Reject> count(std::span<const std::uint8_t> payload, std::uint32_t& missing,
                              Page page = Page::kOwn) {
    missing = 0;
    if (!plan_->counter || (page == Page::kOwn && takes_as_next(payload))) return std::nullopt;
    return count_any(payload, missing, page);
  }

  /// verify() and count() together, for messages without other checks between them.
  std::optional<Reject> judge(const can::Frame& frame, Page page = Page::kOwn);

  /// After a silence the counter cannot show how many frames are missing. A repetition of the last
  /// frame is still refused as not new; with a healthy sender that costs one frame now and then.
  void fall_silent();

  /// The counter in the newest accepted frame.
  [[nodiscard]] std::uint32_t counter() const { return counter_; }

  /// The value from which the sender's counter always wraps to 0 although the configuration says
  /// that it counts further: what `counter_max` should be.
  [[nodiscard]] std::optional<std::uint32_t> early_turn() const {
    return early_turns_ < kTurnsToTell ? std::nullopt : std::optional(early_turn_);
  }

 private:
  [[nodiscard]] [[gnu::noinline]] std::optional<Reject> verify_check_value(
      const can::Frame& frame) const;
  /// The usual case: the counter stands on every page and is one more than in the frame before,
  /// which was in order.
  bool takes_as_next(std::span<const std::uint8_t> payload) {
    const AliveCounter& counter = *plan_->counter;
    const bool in_order =
        known_ && counts_missing_ && page_ == Page::kOwn && !out_of_sequence_.has_value();
    if (!in_order || !counter.presence.always() || !counter.codec.fits(payload.size()))
      return false;
    const std::uint32_t next = counter_ + 1 == counter.modulus ? 0 : counter_ + 1;
    if (next == counter_ || bits(payload) != next) return false;
    if (next == 0) early_turns_ = 0;  // the counter does reach its configured end
    counter_ = next;
    own_counter_ = next;
    return true;
  }
  [[gnu::cold, gnu::noinline]] std::optional<Reject> count_any(
      std::span<const std::uint8_t> payload, std::uint32_t& missing, Page page);
  /// A signed counter is read as the unsigned number with the same bits.
  [[nodiscard]] std::uint64_t bits(std::span<const std::uint8_t> payload) const {
    const dbc::SignalCodec& codec = plan_->counter->codec;
    return static_cast<std::uint64_t>(codec.decode_raw(payload)) & codec.raw_mask();
  }
  [[nodiscard]] bool is_beyond(std::span<const std::uint8_t> payload) const;
  [[nodiscard]] std::uint32_t read(std::span<const std::uint8_t> payload) const;
  [[nodiscard]] std::uint32_t step(std::uint32_t from, std::uint32_t to) const;
  void note_early_turn();
  std::optional<Reject> follow(std::uint32_t now, std::uint32_t& missing);
  [[nodiscard]] bool is_new_round(std::uint32_t now, Page page) const;

  static const E2ePlan kNothing;
  // This many wraps at one value without a full turn in between are not lost frames.
  static constexpr std::uint32_t kTurnsToTell = 20;

  const E2ePlan* plan_;
  std::uint32_t counter_ = 0;  ///< in the newest frame of any page
  bool known_ = false;
  Page page_ = Page::kOwn;                        ///< of that frame
  std::optional<std::uint32_t> own_counter_;      ///< in the newest frame of the own page
  bool counts_missing_ = false;                   ///< the counter is uninterrupted since
  std::optional<std::uint32_t> out_of_sequence_;  ///< counter of the frame before, which was
                                                  ///< refused
  std::optional<std::uint32_t> jumped_to_;        ///< the newest value that was not a step of one
  std::uint32_t early_turn_ = 0;   ///< the value from which the counter went to 0 …
  std::uint32_t early_turns_ = 0;  ///< … so many times one after the other
};

}  // namespace vgyro::gateway
