#pragma once

// The bytes of a log, whatever form they have: a file, standard input, text in memory; unpacked on
// the way where the content is packed (canlog/unpack.h). Memory stays the same however long the log
// is. No line and no frame is known here.

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

  /// Up to `size` bytes into `to`, `size` > 0; 0 at the end and only there. After an error nothing
  /// more comes. What was read before damage is handed out first, the next call reports it.
  virtual Expected<std::size_t> read(char* to, std::size_t size) = 0;

  /// The path, or "standard input", as messages name it.
  [[nodiscard]] virtual const std::string& name() const = 0;
  /// Bytes taken in so far and in total, of the packed file where it is packed; 0 when unknown.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;

  /// Called before bytes are fetched, which may wait for a live source: the moment to flush output.
  virtual void before_wait(std::function<void()> callback) = 0;

  /// Whether seek() works: a plain file. See seekable() below for the others.
  [[nodiscard]] virtual bool can_seek() const { return false; }
  /// The next read() begins at `offset`, counted from the beginning; beyond the end it reads 0.
  virtual Expected<void> seek(std::uint64_t offset);
};

/// The file as it is, packed or not; "-" is standard input.
Expected<std::unique_ptr<ByteSource>> open_raw_bytes(const std::string& path);

/// The file, unpacked where its content is packed.
Expected<std::unique_ptr<ByteSource>> open_bytes(const std::string& path);

/// Text in memory, for tests; `chunk` bytes at a time. It can be sought in.
std::unique_ptr<ByteSource> bytes_from_text(std::string text, std::size_t chunk = SIZE_MAX);

/// The same bytes from a source that can seek: `source` itself, or what is left of it copied into a
/// file without a name in $TMPDIR (else /var/tmp), which vanishes with the source. For forms that
/// cannot be read from front to back.
Expected<std::unique_ptr<ByteSource>> seekable(std::unique_ptr<ByteSource> source);

/// A source whose first bytes can be looked at before they are read.
class HeadedSource final : public ByteSource {
 public:
  /// No form needs to see more than this to be known.
  static constexpr std::size_t kHeadBytesMax = 65'536;

  explicit HeadedSource(std::unique_ptr<ByteSource> source);

  /// What is known of the first bytes.
  [[nodiscard]] std::string_view head() const { return {head_.get(), size_}; }
  /// Nothing follows the head: the end, or an error, which read() will report behind the head.
  [[nodiscard]] bool is_whole() const { return ended_; }
  /// Why nothing follows, where that is an error.
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  /// One read more into the head, which may wait. False when it is full or whole. Only before the
  /// first read().
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
  std::size_t size_ = 0;  ///< of the head
  std::size_t at_ = 0;    ///< of the head, handed out
  bool ended_ = false;
  std::optional<Error> error_;
};

}  // namespace vgyro::canlog
