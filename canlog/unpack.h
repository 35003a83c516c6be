#pragma once

// Packed logs: gzip, xz, zstd and bzip2, recognised by their first bytes, not by the file's name;
// also several members in sequence. Bytes unpacked before damage, or before the end of a file whose
// writer was killed, are returned first; the next read reports the problem and a remedy. Memory is
// bounded: 256 MiB for a dictionary, whatever the file requests.

#include <memory>

#include "base/error.h"
#include "canlog/byte_source.h"

namespace vgyro::canlog {

/// `packed` itself if it is not packed. Error if its packing is unknown, or if it cannot be read at
/// all.
Expected<std::unique_ptr<ByteSource>> unpacked(std::unique_ptr<ByteSource> packed);

}  // namespace vgyro::canlog
