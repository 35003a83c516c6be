#pragma once

// Is a frame complete, from its sender and new? By its check value and its alive
// counter, where the configuration names them. For one message; the rest is not checked.

#include <cstdint>
#include <optional>
#include <span>

#include "can/frame.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class E2eCheck {
 public:
  /// Of a message that is not configured: asks nothing.
  E2eCheck() : plan_(&kNothing) {}
  explicit E2eCheck(const E2ePlan& plan) : plan_(&plan) {}

  /// Is it a data frame with the right check value? Nothing when it is, else the cause. A frame
  /// that fails must not be counted.
  [[nodiscard]] std::optional<Reject> verify(const can::Frame& frame) const {
    if (!frame.is_data()) return Reject::kNotData;
    return plan_->crc ? verify_check_value(frame) : std::nullopt;
  }

  /// Whose frame of a multiplexed message it is: of the page that is read, or of another one.
  enum class Page : std::uint8_t { kOwn, kOther };

  /// The alive counter of a frame that is whole; `missing` of them were lost before it. Nothing
  /// when it is new, else the cause. A counter that stands on all pages is followed over all of
  /// them, for it counts the frames of the message; where it counts rounds of the pages, a frame
  /// of the own page is new when it differs from the one before. Precondition: on the own page the
  /// counter fits the payload.
  std::optional<Reject> count(std::span<const std::uint8_t> payload, std::uint32_t& missing,
                              Page page = Page::kOwn) {
    missing = 0;
    if (!plan_->counter || (page == Page::kOwn && takes_as_next(payload))) return std::nullopt;
    return count_any(payload, missing, page);
  }

  /// Both, for a message of which only that is asked.
  std::optional<Reject> judge(const can::Frame& frame, Page page = Page::kOwn);

  /// After a silence the counter says nothing about how many frames are missing. The last frame
  /// sent once more is still none that is new; of a healthy sender that costs one frame now and
  /// then.
  void fall_silent();

  /// As the newest frame that was accepted carried it.
  [[nodiscard]] std::uint32_t counter() const { return counter_; }

  /// The value from which the sender's counter always goes back to 0, where the configuration says
  /// that it goes on: what `counter_max` should be.
  [[nodiscard]] std::optional<std::uint32_t> early_turn() const {
    return early_turns_ < kTurnsToTell ? std::nullopt : std::optional(early_turn_);
  }

 private:
  [[nodiscard]] [[gnu::noinline]] std::optional<Reject> verify_check_value(
      const can::Frame& frame) const;
  /// The usual frame: the counter stands on every page and is one more than that of the frame
  /// before, which was in order.
  bool takes_as_next(std::span<const std::uint8_t> payload) {
    const AliveCounter& counter = *plan_->counter;
    const bool in_order =
        known_ && counts_missing_ && page_ == Page::kOwn && !out_of_sequence_.has_value();
    if (!in_order || !counter.presence.always() || !counter.codec.fits(payload.size()))
      return false;
    const std::uint32_t next = counter_ + 1 == counter.modulus ? 0 : counter_ + 1;
    if (next == counter_ || bits(payload) != next) return false;
    if (next == 0) early_turns_ = 0;  // it does reach its end
    counter_ = next;
    own_counter_ = next;
    return true;
  }
  [[gnu::cold, gnu::noinline]] std::optional<Reject> count_any(
      std::span<const std::uint8_t> payload, std::uint32_t& missing, Page page);
  /// The bits of a signed signal are a number without sign, too.
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
  // Frames lost just there, so many times without one full turn between, are no chance.
  static constexpr std::uint32_t kTurnsToTell = 20;

  const E2ePlan* plan_;
  std::uint32_t counter_ = 0;  ///< of the newest frame of any page
  bool known_ = false;
  Page page_ = Page::kOwn;                        ///< of that frame
  std::optional<std::uint32_t> own_counter_;      ///< of the newest frame of the own page
  bool counts_missing_ = false;                   ///< the counter has not been interrupted since
  std::optional<std::uint32_t> out_of_sequence_;  ///< of the frame before, refused
  std::optional<std::uint32_t> jumped_to_;        ///< the newest value that was not one more
  std::uint32_t early_turn_ = 0;   ///< the value from which the counter went to 0 …
  std::uint32_t early_turns_ = 0;  ///< … so many times one after the other
};

}  // namespace vgyro::gateway
