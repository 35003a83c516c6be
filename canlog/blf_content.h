#pragma once

// The contents of the containers of a BLF file in sequence, unpacked; objects outside of containers
// come unchanged. Nothing has to fit into memory, however large a container claims to be.

#include <cstdint>
#include <memory>

#include "canlog/byte_window.h"

struct z_stream_s;

namespace vgyro::canlog {

class BlfContent {
 public:
  /// A container that holds more is damaged or malicious. Vector's tools and python-can fill them
  /// with 128 KiB.
  static constexpr std::uint64_t kContainerBytesMax = 256ULL << 20U;

  /// `bytes` begin after the file's head.
  explicit BlfContent(std::unique_ptr<ByteWindow> bytes);
  ~BlfContent();
  BlfContent(const BlfContent&) = delete;
  BlfContent& operator=(const BlfContent&) = delete;

  struct Piece {
    std::size_t size = 0;
    const char* torn = nullptr;  ///< why bytes are missing here; the next ones may begin inside an
                                 ///< object; size is 0
    bool end = false;            ///< nothing follows; size is 0
  };
  /// Reads up to `size` bytes into `to`.
  Piece read(char* to, std::size_t size);

  /// Bytes so far that belong to no object.
  [[nodiscard]] std::uint64_t skipped_bytes() const { return skipped_bytes_; }
  /// The file ended inside a container.
  [[nodiscard]] bool is_cut_off() const { return cut_off_; }
  [[nodiscard]] ByteWindow& bytes() { return *bytes_; }
  [[nodiscard]] const ByteWindow& bytes() const { return *bytes_; }

 private:
  enum class Place : std::uint8_t { kBetween, kStored, kDeflated, kOutside };

  void enter_object();
  bool find_object();
  void enter_container(std::size_t head_bytes);
  std::size_t copy(char* to, std::size_t size);
  std::size_t inflate(char* to, std::size_t size);
  void leave(const char* why);
  void meet_end();

  std::unique_ptr<ByteWindow> bytes_;
  Place place_ = Place::kBetween;
  std::uint64_t left_ = 0;      ///< bytes of the object that remain in the file
  std::uint64_t produced_ = 0;  ///< bytes unpacked from the container
  const char* torn_ = nullptr;  ///< not reported yet
  bool lost_ = false;           ///< no object was found since then
  bool ended_ = false;
  bool cut_off_ = false;
  std::uint64_t skipped_bytes_ = 0;
  std::unique_ptr<z_stream_s> stream_;
};

}  // namespace vgyro::canlog
