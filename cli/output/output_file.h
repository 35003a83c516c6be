#pragma once

// Writes bytes to a file or to standard output through one buffer. The first failure is kept and
// reported at the end; later writes are dropped. A named file appears whole or not at all: it gets
// its name when it is closed without a failure (cli/output/unfinished). Devices and pipes are
// written to directly, and so is a file in a folder in which none can be created.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "cli/output/unfinished.h"

namespace vgyro::cli {

class OutputFile {
 public:
  /// "-" is standard output; an empty path discards.
  static Expected<OutputFile> open(const std::string& path);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  /// Without close() the output is discarded.
  ~OutputFile();

  /// Returns room for at least `size` bytes; commit() the part used. size ≤ kRoomMax.
  static constexpr std::size_t kRoomMax = 16'384;
  char* room(std::size_t size) {
    if (kBufferBytes - used_ < size) flush();
    return buffer_.get() + used_;
  }
  void commit(std::size_t size) { used_ += size; }
  void write(std::string_view text);
  void flush();
  /// Overwrites bytes written earlier. Precondition: can_rewrite(), which holds for a file.
  void rewrite(std::uint64_t offset, std::string_view text);
  [[nodiscard]] bool can_rewrite() const;
  /// Flushes, closes, and gives the file its name; the error names the file and the reason.
  Expected<void> close();

 private:
  OutputFile(int fd, std::string name, bool owned);
  OutputFile(Unfinished unfinished, std::string name);
  static constexpr std::size_t kBufferBytes = 131'072;
  int fd_;
  std::string name_;
  bool owned_;
  std::unique_ptr<char[]> buffer_;
  std::size_t used_ = 0;
  std::optional<Error> error_;
  std::optional<Unfinished> unfinished_;
};

}  // namespace vgyro::cli
