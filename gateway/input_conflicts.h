#pragma once

// Checks across tables of a configuration: inputs that take each other's frames, names and
// identifiers that are used twice.

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/toml_reader.h"
#include "gateway/plan.h"
#include "gateway/signal_resolver.h"

namespace vgyro::gateway {

/// J1939: the last byte of an identifier is the sender's address.
inline constexpr std::uint32_t kSourceMask = 0xFF;

/// Can one frame match both?
bool may_share_frames(const FrameMatch& a, const FrameMatch& b);

/// Reports an error for each input besides the gyros that cannot be distinguished from another
/// input. Signals of one message may serve several inputs.
void check_apart(TomlReader& root, const Plan& plan);

/// A bus and the path of a DBC file that describes it.
using BusFile = std::pair<std::string, std::string>;

/// Warns of what is usable but misleading: one name for both gyros; a message on the bus that has
/// an identifier of the gateway's own output.
void warn_of_conflicts(TomlReader& root, const Plan& plan, const DatabaseCache& cache,
                       const std::set<BusFile>& files, std::vector<Error>& warnings);

}  // namespace vgyro::gateway
