#pragma once

// Packed logs: gzip, xz, zstd and bzip2, known by their first bytes and not by the file's name,
// also several members one behind the other. What comes out before damage, or before the end of a
// file whose writer was killed, is handed on first; the next read says what is wrong and where to
// go. Memory is bounded: 256 MiB for a dictionary, whatever the file asks for.

#include <memory>

#include "base/error.h"
#include "canlog/byte_source.h"

namespace vgyro::canlog {

/// `packed` itself where it is not packed. Error where it is packed in a way that is not known, or
/// cannot be read at all.
Expected<std::unique_ptr<ByteSource>> unpacked(std::unique_ptr<ByteSource> packed);

}  // namespace vgyro::canlog
