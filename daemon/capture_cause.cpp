#include "daemon/capture_cause.h"

#include <algorithm>
#include <utility>

#include "gateway/condition_text.h"

namespace vgyro::daemon {
namespace {

constexpr std::array<std::string_view, kCaptureCauses> kNames{"contradicted", "disagree",
                                                              "stops_refused", "asked"};

bool has_grown(std::uint64_t& seen, std::uint64_t now) {
  return now > std::exchange(seen, now);
}

}  // namespace

std::string_view to_string(CaptureCause cause) {
  return kNames[static_cast<std::size_t>(cause)];
}

std::optional<CaptureCause> capture_cause_from(std::string_view name) {
  const auto* const found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<CaptureCause>(found - kNames.begin());
}

// A single refused stop is no cause: it may have been a turn. Once most steady stretches have
// taught little, each further one is a cause: the ring holds its frames, and no longer those of the
// earlier stretches.
CaptureTriggers::Causes CaptureTriggers::look(const gateway::Status& status) {
  const gateway::SteadyStretches stretches = gateway::steady_stretches(status);
  const auto place = [](CaptureCause cause) { return static_cast<std::size_t>(cause); };
  Causes causes{};
  causes[place(CaptureCause::kContradicted)] = has_grown(contradictions_, status.contradictions);
  causes[place(CaptureCause::kDisagree)] = has_grown(disagreements_, status.disagreements);
  const bool one_more = has_grown(fruitless_, stretches.refused + stretches.open);
  causes[place(CaptureCause::kStopsRefused)] =
      one_more && !gateway::stretches_advice(stretches).empty();
  return causes;
}

}  // namespace vgyro::daemon
