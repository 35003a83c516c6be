#pragma once

// Exit codes of `vgyro`.

namespace vgyro::cli {

inline constexpr int kDone = 0;
inline constexpr int kBadInput = 1;  ///< reported on stderr
inline constexpr int kWrongUsage = 2;

}  // namespace vgyro::cli
