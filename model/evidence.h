#pragma once

// What a recording must hold for an effect to show, and what the effect may be mistaken for if it
// does not hold enough.

#include <string_view>

#include "model/effect.h"

namespace vgyro::model {

struct Evidence {
  Kind kind;
  std::string_view shown_by;   ///< the excitation or the trace that reveals the effect
  std::string_view taken_for;  ///< names of kinds, separated by ", "; empty: for none
};

const Evidence& evidence(Kind kind);

}  // namespace vgyro::model
