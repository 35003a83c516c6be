#pragma once

// Which signals a frame carries. Multiplexed signals are present only while their multiplexor,
// itself perhaps multiplexed, has one of certain values. Everything is resolved once: checking a
// frame allocates nothing and reads nothing beyond the payload.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "dbc/codec.h"
#include "dbc/database.h"

namespace vgyro::dbc {

/// Decides from the payload whether a signal is present. Without conditions it always is.
class Presence {
 public:
  /// Limit of nested multiplexors; more, or a circle, is an error.
  static constexpr std::size_t kDepthMax = 16;

  /// Error if a multiplexor is missing, cannot be decoded, or depends on itself. `where` names the
  /// place in the error.
  static Expected<Presence> make(const Message& message, const Signal& signal,
                                 const std::string& where);

  [[nodiscard]] [[gnu::noinline]] bool holds(std::span<const std::uint8_t> payload) const;
  /// Writes the multiplexors so that holds(). Precondition: they fit.
  void arrange(std::span<std::uint8_t> payload) const;
  [[nodiscard]] bool always() const { return last_ == nullptr; }

  /// True for equal conditions, from whatever file.
  friend bool operator==(const Presence& a, const Presence& b);

 private:
  friend class PresenceBuilder;
  /// One condition; signals of the same message share the conditions they have in common.
  struct Step {
    SignalCodec multiplexor;
    std::uint64_t mask;  ///< a multiplexor declared signed still counts its bit pattern
    std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges;
    std::shared_ptr<const Step> above;
    std::size_t depth;
  };
  std::shared_ptr<const Step> last_;
};

/// All signals of a message. Refers to the message, which must outlive it.
class MessageCodec {
 public:
  explicit MessageCodec(const Message& message, const std::string& path = {});

  /// Calls `use(const Signal&, const Reading&)` for every signal present, in file order.
  template <class Use>
  void for_each(std::span<const std::uint8_t> payload, Use&& use) const {
    for (const Entry& entry : entries_) {
      if (!entry.codec.fits(payload.size()) || !entry.presence.holds(payload)) continue;
      use(*entry.signal, entry.codec.decode(payload));
    }
  }

  [[nodiscard]] const Message& message() const { return *message_; }
  /// The reasons why some signals of the message are never read.
  [[nodiscard]] const std::vector<Error>& left_out() const { return left_out_; }

 private:
  struct Entry {
    const Signal* signal;
    SignalCodec codec;
    Presence presence;
  };
  const Message* message_;
  std::vector<Entry> entries_;
  std::vector<Error> left_out_;
};

}  // namespace vgyro::dbc
