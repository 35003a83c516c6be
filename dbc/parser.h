#pragma once

// Reads DBC text as real tools write it. Never rejects a file for an odd line: the line gets a
// diagnostic and the rest is kept. Hostile text costs time and memory linear in its size.

#include <string>
#include <string_view>

#include "dbc/database.h"

namespace vgyro::dbc {

/// `path` is used in errors only.
Database parse(std::string_view text, std::string path);

/// The networks of a whole car take a megabyte or two; a larger file costs memory and is probably a
/// mistake.
inline constexpr std::size_t kFileBytesMax = std::size_t{16} << 20U;

/// Error if the file cannot be read or holds no message.
Expected<Database> load(const std::string& path);

}  // namespace vgyro::dbc
