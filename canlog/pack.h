#pragma once

// Packs bytes on their way into another sink: gzip, xz or zstd, by the ending of a name.

#include <memory>
#include <string_view>

#include "canlog/writer.h"

namespace vgyro::canlog {

/// A sink that must be told the end of the data.
class PackingSink : public ByteSink {
 public:
  void rewrite(std::uint64_t /*offset*/, std::string_view /*bytes*/) final {}
  [[nodiscard]] bool can_rewrite() const final { return false; }
  /// Call once, after the last write().
  virtual void finish() = 0;
};

/// The ending of `path` that names a packing (".gz", ".xz", ".zst"), or an empty one.
std::string_view packing_ending(std::string_view path);

/// `ending` is from packing_ending(), not empty. The packed bytes go into `to`.
std::unique_ptr<PackingSink> packing_sink(std::string_view ending, ByteSink& to);

}  // namespace vgyro::canlog
