#pragma once

// A window that moves over the bytes of a binary log from front to back. Memory does not grow with
// the log or with the sizes that it claims.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "canlog/byte_source.h"

namespace vgyro::canlog {

class ByteWindow {
 public:
  static constexpr std::size_t kBytes = 262'144;

  explicit ByteWindow(std::unique_ptr<ByteSource> bytes);

  /// The next `size` bytes (at most kBytes), fewer only if the log ends. Valid until the next call.
  std::string_view peek(std::size_t size) {
    if (end_ - at_ < size) fetch(size);
    return {buffer_.get() + at_, end_ - at_ < size ? end_ - at_ : size};
  }
  /// The bytes available, at least one; none only at the end.
  std::string_view peek_some() {
    if (at_ == end_) fetch(1);
    return {buffer_.get() + at_, end_ - at_};
  }
  /// Moves on by at most what the last peek() returned.
  void take(std::size_t size) { at_ += size; }
  /// Moves on; false if the log ends before that.
  bool pass(std::uint64_t size);
  /// Moves on to `mark`, or to the end if there is none; returns the number of bytes skipped.
  std::uint64_t pass_until(std::string_view mark);

  /// Why no more bytes come, unless it is the end.
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  [[nodiscard]] const std::string& name() const { return bytes_->name(); }
  [[nodiscard]] std::uint64_t bytes_read() const { return bytes_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const { return bytes_->bytes_total(); }
  void before_wait(std::function<void()> callback) { bytes_->before_wait(std::move(callback)); }

 private:
  void fetch(std::size_t size);

  std::unique_ptr<ByteSource> bytes_;
  std::unique_ptr<char[]> buffer_;
  std::size_t at_ = 0;
  std::size_t end_ = 0;
  bool ended_ = false;
  std::optional<Error> error_;
};

}  // namespace vgyro::canlog
