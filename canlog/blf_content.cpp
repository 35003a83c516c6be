#include "canlog/blf_content.h"

#include <algorithm>
#include <cstring>

#include <zlib.h>

#include "canlog/blf_layout.h"
#include "canlog/byte_order.h"

namespace vgyro::canlog {

BlfContent::BlfContent(std::unique_ptr<ByteWindow> bytes)
    : bytes_(std::move(bytes)), stream_(std::make_unique<z_stream_s>()) {
  // Fails only without memory; inflate() then reports it for each container.
  ::inflateInit(stream_.get());
}

BlfContent::~BlfContent() {
  ::inflateEnd(stream_.get());
}

BlfContent::Piece BlfContent::read(char* to, std::size_t size) {
  while (true) {
    if (torn_ != nullptr) return {0, std::exchange(torn_, nullptr), false};
    if (place_ == Place::kBetween) {
      if (ended_) return {0, nullptr, true};
      enter_object();
      continue;
    }
    const std::size_t got = place_ == Place::kDeflated ? inflate(to, size) : copy(to, size);
    if (got > 0) return {got, nullptr, false};
  }
}

void BlfContent::enter_object() {
  if (!find_object()) return;
  const std::string_view head = bytes_->peek(blf::object::kBaseBytes);
  if (head.size() < blf::object::kBaseBytes) return meet_end();
  const std::size_t head_bytes = load_little<std::uint16_t>(&head[blf::object::kHeadBytes]);
  left_ = load_little<std::uint32_t>(&head[blf::object::kBytes]);
  if (head_bytes < blf::object::kBaseBytes || left_ < head_bytes) {
    left_ = blf::kObjectMark.size();
    return leave("impossible sizes in the head of an object");
  }
  if (load_little<std::uint32_t>(&head[blf::object::kType]) == blf::kContainer) {
    return enter_container(head_bytes);
  }
  lost_ = false;
  place_ = Place::kOutside;
}

// Moves to the mark of the next object; false if it does not follow at once. Some padding is part
// of the form; more is damage.
bool BlfContent::find_object() {
  const std::string_view near = bytes_->peek(blf::kPaddingOf + blf::kObjectMark.size());
  const std::size_t padding = near.find(blf::kObjectMark);
  if (padding != near.npos) {
    bytes_->take(padding);
    return true;
  }
  const std::uint64_t skipped = bytes_->pass_until(blf::kObjectMark);
  ended_ = bytes_->peek(1).empty();
  if (ended_ && skipped < blf::kPaddingOf) return false;
  skipped_bytes_ += skipped;
  if (!lost_) torn_ = "data between containers are not an object";
  lost_ = true;
  return false;
}

void BlfContent::enter_container(std::size_t head_bytes) {
  const std::string_view head = bytes_->peek(head_bytes + blf::container::kHeadBytes);
  if (left_ < head_bytes + blf::container::kHeadBytes) return leave("container: too short");
  if (head.size() < head_bytes + blf::container::kHeadBytes) return meet_end();
  const auto* fields = &head[head_bytes];
  const auto packing = load_little<std::uint16_t>(&fields[blf::container::kPacking]);
  const auto plain = load_little<std::uint32_t>(&fields[blf::container::kPlainBytes]);
  bytes_->take(head.size());
  left_ -= head.size();
  produced_ = 0;
  lost_ = false;
  if (plain > kContainerBytesMax || left_ > kContainerBytesMax) {
    return leave("container: claims to hold more than 256 MiB");
  }
  if (packing == blf::container::kStored) {
    place_ = Place::kStored;
  } else if (packing == blf::container::kDeflated) {
    ::inflateReset(stream_.get());
    place_ = Place::kDeflated;
  } else {
    leave("container: packed in a way that is not known");
  }
}

std::size_t BlfContent::copy(char* to, std::size_t size) {
  if (left_ == 0) {
    place_ = Place::kBetween;
    return 0;
  }
  const std::string_view there = bytes_->peek_some();
  if (there.empty()) {
    meet_end();
    return 0;
  }
  const std::size_t count =
      static_cast<std::size_t>(std::min<std::uint64_t>({there.size(), size, left_}));
  std::memcpy(to, there.data(), count);
  bytes_->take(count);
  left_ -= count;
  return count;
}

std::size_t BlfContent::inflate(char* to, std::size_t size) {
  const std::string_view there = left_ > 0 ? bytes_->peek_some() : std::string_view();
  const std::size_t given = static_cast<std::size_t>(std::min<std::uint64_t>(there.size(), left_));
  stream_->next_in = reinterpret_cast<Bytef*>(const_cast<char*>(there.data()));
  stream_->avail_in = static_cast<uInt>(given);
  stream_->next_out = reinterpret_cast<Bytef*>(to);
  stream_->avail_out = static_cast<uInt>(size);
  const int result = ::inflate(stream_.get(), Z_NO_FLUSH);
  const std::size_t used = given - stream_->avail_in;
  const std::size_t got = size - stream_->avail_out;
  bytes_->take(used);
  left_ -= used;
  produced_ += got;
  if (result == Z_STREAM_END) {
    bytes_->pass(std::exchange(left_, 0));
    place_ = Place::kBetween;
  } else if (result != Z_OK && result != Z_BUF_ERROR) {
    leave("container: its packed content is damaged");
  } else if (produced_ > kContainerBytesMax) {
    leave("container: holds more than 256 MiB");
  } else if (got == 0 && used == 0 && left_ == 0) {
    leave("container: its packed content ends too early");
  } else if (got == 0 && used == 0) {
    meet_end();
  }
  return got;
}

// Skips the rest of the object.
void BlfContent::leave(const char* why) {
  torn_ = why;
  lost_ = true;
  place_ = Place::kBetween;
  if (!bytes_->pass(std::exchange(left_, 0))) meet_end();
}

void BlfContent::meet_end() {
  bytes_->pass(bytes_->peek_some().size());
  cut_off_ = ended_ = true;
  left_ = 0;
  place_ = Place::kBetween;
}

}  // namespace vgyro::canlog
