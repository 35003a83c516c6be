#include "dbc/multiplex.h"

#include <algorithm>
#include <map>
#include <string>
#include <string_view>

#include <fmt/core.h>

namespace vgyro::dbc {

/// Builds the conditions of a message's signals, each condition once.
class PresenceBuilder {
 public:
  explicit PresenceBuilder(const Message& message) : message_(message) {
    for (const Signal& signal : message.signals)
      by_name_.try_emplace(signal.name, &signal);
  }

  Expected<Presence> make(const Signal& signal, const std::string& where) {
    const Expected<StepPtr> last = step_of(signal, where, 1);
    if (!last) return tl::unexpected(last.error());
    Presence presence;
    presence.last_ = *last;
    return presence;
  }

 private:
  using StepPtr = std::shared_ptr<const Presence::Step>;

  Expected<StepPtr> step_of(const Signal& signal, const std::string& where, std::size_t walked);
  Expected<StepPtr> new_step(const Signal& signal, const Signal& multiplexor,
                             const std::string& where, StepPtr above);

  const Message& message_;
  std::map<std::string_view, const Signal*> by_name_;
  std::map<const Signal*, StepPtr> made_;
};

Expected<PresenceBuilder::StepPtr> PresenceBuilder::step_of(const Signal& signal,
                                                            const std::string& where,
                                                            std::size_t walked) {
  if (!signal.condition) return StepPtr{};
  const auto made = made_.find(&signal);
  if (made != made_.end()) return made->second;
  const auto multiplexor = by_name_.find(signal.condition->multiplexor);
  if (multiplexor == by_name_.end()) {
    return fail(where, fmt::format("message {} has no multiplexor {} for signal {}", message_.name,
                                   signal.condition->multiplexor, signal.name));
  }
  Expected<StepPtr> above = StepPtr{};
  if (walked <= Presence::kDepthMax) above = step_of(*multiplexor->second, where, walked + 1);
  if (!above) return above;
  const std::size_t depth = *above == nullptr ? 1 : (*above)->depth + 1;
  if (walked > Presence::kDepthMax || depth > Presence::kDepthMax) {
    return fail(where, fmt::format("the multiplexors of signal {} go in a circle", signal.name),
                fmt::format("at most {} one above the other", Presence::kDepthMax));
  }
  return new_step(signal, *multiplexor->second, where, *above);
}

Expected<PresenceBuilder::StepPtr> PresenceBuilder::new_step(const Signal& signal,
                                                             const Signal& multiplexor,
                                                             const std::string& where,
                                                             StepPtr above) {
  const Expected<SignalCodec> codec = SignalCodec::make(multiplexor, message_.size_bytes, where);
  if (!codec) return tl::unexpected(codec.error());
  const std::uint64_t mask = ~std::uint64_t{0} >> (64U - multiplexor.length_bits);
  const std::size_t depth = above == nullptr ? 1 : above->depth + 1;
  auto step = std::make_shared<const Presence::Step>(
      Presence::Step{*codec, mask, signal.condition->ranges, std::move(above), depth});
  made_.emplace(&signal, step);
  return step;
}

Expected<Presence> Presence::make(const Message& message, const Signal& signal,
                                  const std::string& where) {
  return PresenceBuilder(message).make(signal, where);
}

bool operator==(const Presence& a, const Presence& b) {
  const Presence::Step* one = a.last_.get();
  const Presence::Step* other = b.last_.get();
  while (one != other && one != nullptr && other != nullptr) {
    if (one->multiplexor != other->multiplexor || one->mask != other->mask ||
        one->ranges != other->ranges)
      return false;
    one = one->above.get();
    other = other->above.get();
  }
  return one == other;
}

bool Presence::holds(std::span<const std::uint8_t> payload) const {
  for (const Step* step = last_.get(); step != nullptr; step = step->above.get()) {
    if (!step->multiplexor.fits(payload.size())) return false;
    const auto raw = static_cast<std::uint64_t>(step->multiplexor.decode(payload).raw) & step->mask;
    const bool matches =
        std::any_of(step->ranges.begin(), step->ranges.end(),
                    [raw](const auto& range) { return range.first <= raw && raw <= range.second; });
    if (!matches) return false;
  }
  return true;
}

void Presence::arrange(std::span<std::uint8_t> payload) const {
  for (const Step* step = last_.get(); step != nullptr; step = step->above.get()) {
    if (!step->ranges.empty()) step->multiplexor.encode_raw(step->ranges.front().first, payload);
  }
}

MessageCodec::MessageCodec(const Message& message, const std::string& path) : message_(&message) {
  PresenceBuilder presences(message);
  for (const Signal& signal : message.signals) {
    const std::string where = path.empty() ? message.name : at_line(path, signal.line);
    Expected<SignalCodec> codec = SignalCodec::make(signal, message.size_bytes, where);
    Expected<Presence> presence = presences.make(signal, where);
    if (codec && presence) {
      entries_.push_back({&signal, *codec, std::move(*presence)});
    } else {
      left_out_.push_back(codec ? presence.error() : codec.error());
    }
  }
}

}  // namespace vgyro::dbc
