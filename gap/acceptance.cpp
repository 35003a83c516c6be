#include "gap/acceptance.h"

#include <algorithm>
#include <utility>

namespace vgyro::gap {

namespace {

bool is_accepted(const std::vector<Acceptance>& accept, const Reading& reading) {
  return std::any_of(accept.begin(), accept.end(),
                     [&](const Acceptance& one) { return one.meets(reading); });
}

// The name takes the reading's place and the reading the name's.
void exchange(Found& found, Reading& reading) {
  const Reading mine = reading_of(found.effect);
  // What is not fitted again, as noise, is as sure with the one name as with the other.
  if (reading.kind != mine.kind) found.sigma = {};
  found.effect.kind = reading.kind;
  found.effect.gyro = reading.gyro;
  found.effect.parameters = reading.parameters;
  reading = mine;
}

}  // namespace

bool accept_readings(const std::vector<Acceptance>& accept, std::vector<Found>& found) {
  bool changed = false;
  for (Found& one : found) {
    if (one.ambiguous_with.empty()) continue;
    one.accepted = is_accepted(accept, reading_of(one.effect));
    if (one.accepted) continue;
    const auto other = std::find_if(one.ambiguous_with.begin(), one.ambiguous_with.end(),
                                    [&](const Reading& reading) {
                                      return reading.is_fitted() && is_accepted(accept, reading);
                                    });
    if (other == one.ambiguous_with.end()) continue;
    exchange(one, *other);
    one.accepted = changed = true;
  }
  return changed;
}

}  // namespace vgyro::gap
