#pragma once

// The bytes of a log of any form: a file, standard input, text in memory; unpacked on the way if
// the content is packed (canlog/unpack.h). Memory does not grow with the log. Lines and frames are
// not known here.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro::canlog {

class ByteSource {
 public:
  ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;
  virtual ~ByteSource() = default;

  /// Reads up to `size` bytes into `to`, `size` > 0; returns 0 at the end and only there. After an
  /// error no more bytes come. Bytes read before damage are returned first; the next call reports
  /// the damage.
  virtual Expected<std::size_t> read(char* to, std::size_t size) = 0;

  /// The path, or "standard input", for errors.
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Bytes read so far and in total, of the packed file if it is packed; 0 if unknown.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;

  /// Sets a function to call before a read that may wait for a live source, so that output can be
  /// flushed.
  virtual void before_wait(std::function<void()> callback) = 0;

  /// Whether seek() works: for a plain file. seekable() below handles the others.
  [[nodiscard]] virtual bool can_seek() const { return false; }
  /// Lets the next read() begin at `offset`, counted from the beginning; beyond the end it reads 0.
  virtual Expected<void> seek(std::uint64_t offset);
};

/// The file's own bytes, packed or not; "-" is standard input.
Expected<std::unique_ptr<ByteSource>> open_raw_bytes(const std::string& path);

/// The file's bytes, unpacked if its content is packed.
Expected<std::unique_ptr<ByteSource>> open_bytes(const std::string& path);

/// Text in memory, for tests; `chunk` bytes at a time. It can seek.
std::unique_ptr<ByteSource> bytes_from_text(std::string text, std::size_t chunk = SIZE_MAX);

/// The same bytes as a source that can seek: `source` itself, or the rest of it copied into a
/// nameless file in $TMPDIR (else /var/tmp), which vanishes with the source. For forms that cannot
/// be read from front to back.
Expected<std::unique_ptr<ByteSource>> seekable(std::unique_ptr<ByteSource> source);

/// A source whose first bytes can be examined before they are read.
class HeadedSource final : public ByteSource {
 public:
  /// Every form can be recognised by this many bytes.
  static constexpr std::size_t kHeadBytesMax = 65'536;

  explicit HeadedSource(std::unique_ptr<ByteSource> source);

  /// The first bytes read so far.
  [[nodiscard]] std::string_view head() const { return {head_.get(), size_}; }
  /// Nothing follows the head: the end, or an error, which read() reports after the head.
  [[nodiscard]] bool is_whole() const { return ended_; }
  /// The error after which nothing follows, if it is one.
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  /// Reads once more into the head, which may wait. False if the head is full or whole. Only before
  /// the first read().
  bool grow();

  Expected<std::size_t> read(char* to, std::size_t size) override;
  [[nodiscard]] const std::string& name() const override { return source_->name(); }
  [[nodiscard]] std::uint64_t bytes_read() const override { return source_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return source_->bytes_total(); }
  void before_wait(std::function<void()> callback) override {
    source_->before_wait(std::move(callback));
  }
  [[nodiscard]] bool can_seek() const override { return source_->can_seek(); }
  Expected<void> seek(std::uint64_t offset) override;

 private:
  std::unique_ptr<ByteSource> source_;
  std::unique_ptr<char[]> head_;
  std::size_t size_ = 0;  ///< bytes in the head
  std::size_t at_ = 0;    ///< bytes of the head returned so far
  bool ended_ = false;
  std::optional<Error> error_;
};

}  // namespace vgyro::canlog
