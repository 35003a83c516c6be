#pragma once

// Which reading of an ambiguous effect the caller takes for the right one: who drives the vehicle
// may know what the recording cannot show.

#include <cstddef>
#include <optional>
#include <vector>

#include "gap/found.h"
#include "model/effect.h"

namespace vgyro::gap {

/// Readings that meet all that is said; the likeliest where several do. Nothing said: the
/// likeliest.
struct Acceptance {
  std::optional<std::size_t> gyro;
  std::optional<model::Kind> kind;

  [[nodiscard]] bool meets(const Reading& reading) const {
    return (!gyro || *gyro == reading.gyro) && (!kind || *kind == reading.kind);
  }
};

/// Chooses for every ambiguous name: the first reading that any of `accept` meets is accepted, and
/// changes places with the likeliest. Those that nothing meets stay as they are. True when a name
/// has changed, so that values and errors are another fit's.
bool accept_readings(const std::vector<Acceptance>& accept, std::vector<Found>& found);

}  // namespace vgyro::gap
