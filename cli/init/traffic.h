#pragma once

// The frames of a log by bus and identifier, within a limit of memory: of a longer log every
// second, fourth … block of seconds is kept. Counts cover the whole log.

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "canlog/record.h"

namespace vgyro::cli {

struct Stream {
  std::string bus;
  std::uint32_t id = 0;
  bool extended = false;
  std::uint64_t frames = 0;  ///< in the whole log
  std::int64_t first_ns = 0;
  std::int64_t last_ns = 0;  ///< stamp of its last frame

  struct Kept {
    std::int64_t t_ns = 0;
    std::size_t at = 0;
    std::uint8_t length = 0;
  };
  std::vector<Kept> kept;  ///< in the order of the log
  std::vector<std::uint8_t> bytes;

  [[nodiscard]] std::span<const std::uint8_t> payload(const Kept& frame) const {
    return {bytes.data() + frame.at, frame.length};
  }
  [[nodiscard]] double frames_per_s() const;
};

class Traffic {
 public:
  static constexpr std::size_t kBytesMost = std::size_t{96} << 20U;
  static constexpr std::size_t kStreamsMost = 4096;
  static constexpr std::int64_t kBlock_ns = 20'000'000'000;

  explicit Traffic(std::size_t bytes_most = kBytesMost) : bytes_most_(bytes_most) {}

  /// From now on, frames of other identifiers are counted but not kept; empty: all are kept.
  void only(const std::vector<std::uint32_t>& ids) { only_ = {ids.begin(), ids.end()}; }
  /// Merges several logs by stamp. Error if one cannot be read, or if none holds a frame.
  Expected<void> read(const std::vector<std::string>& logs);
  void add(const std::string& bus, const canlog::LogRecord& record);

  [[nodiscard]] std::vector<const Stream*> streams() const;
  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] bool thinned() const { return every_ > 1; }
  [[nodiscard]] double seconds() const;
  [[nodiscard]] double begin_s() const { return static_cast<double>(begin_ns_) * 1e-9; }
  /// Text about what in the logs was not a frame; empty if everything was.
  [[nodiscard]] const std::string& notes() const { return notes_; }
  [[nodiscard]] bool has(const std::string& bus, std::uint32_t id) const;

 private:
  using Key = std::tuple<std::string, bool, std::uint32_t>;
  [[nodiscard]] bool wanted(std::int64_t t_ns) const;
  void thin();

  std::size_t bytes_most_;
  std::size_t bytes_ = 0;
  std::int64_t every_ = 1;
  std::int64_t begin_ns_ = 0;
  std::uint64_t frames_ = 0;
  std::set<std::uint32_t> only_;
  std::map<Key, Stream> streams_;
  std::string notes_;
};

}  // namespace vgyro::cli
