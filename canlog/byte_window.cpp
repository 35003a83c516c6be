#include "canlog/byte_window.h"

#include <algorithm>
#include <cstring>

namespace vgyro::canlog {

ByteWindow::ByteWindow(std::unique_ptr<ByteSource> bytes)
    : bytes_(std::move(bytes)), buffer_(std::make_unique<char[]>(kBytes)) {}

void ByteWindow::fetch(std::size_t size) {
  std::memmove(buffer_.get(), buffer_.get() + at_, end_ - at_);
  end_ -= at_;
  at_ = 0;
  while (!ended_ && end_ < size) {
    const auto got = bytes_->read(buffer_.get() + end_, kBytes - end_);
    if (!got) error_ = got.error();
    ended_ = !got || *got == 0;
    if (!ended_) end_ += *got;
  }
}

bool ByteWindow::pass(std::uint64_t size) {
  while (size > 0) {
    const std::size_t some =
        static_cast<std::size_t>(std::min<std::uint64_t>(peek_some().size(), size));
    if (some == 0) return false;
    take(some);
    size -= some;
  }
  return true;
}

std::uint64_t ByteWindow::pass_until(std::string_view mark) {
  std::uint64_t passed = 0;
  while (true) {
    peek(mark.size());
    const std::string_view there = peek_some();
    const std::size_t found = there.find(mark);
    if (found != there.npos) {
      take(found);
      return passed + found;
    }
    // The mark may begin in the last bytes of the window.
    const bool is_end = there.size() < mark.size();
    const std::size_t step = is_end ? there.size() : there.size() - (mark.size() - 1);
    take(step);
    passed += step;
    if (is_end) return passed;
  }
}

}  // namespace vgyro::canlog
