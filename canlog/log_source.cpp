#include "canlog/log_source.h"

#include <cstring>

namespace vgyro::canlog {

LogSource::LogSource(std::unique_ptr<ByteSource> bytes)
    : bytes_(std::move(bytes)), buffer_(std::make_unique<char[]>(kBufferBytes)) {}

Expected<LogBlock> LogSource::next() {
  std::memmove(buffer_.get(), buffer_.get() + handed_, used_ - handed_);
  used_ -= handed_;
  handed_ = 0;
  LogBlock block;
  while (true) {
    const auto got = bytes_->read(buffer_.get() + used_, kBufferBytes - used_);
    if (!got) return tl::unexpected(got.error());
    const std::size_t searched = used_;
    used_ += *got;
    block.end = *got == 0;
    if (skipping_) {
      const void* newline = std::memchr(buffer_.get(), '\n', used_);
      const std::size_t dropped =
          newline ? static_cast<std::size_t>(static_cast<const char*>(newline) - buffer_.get()) + 1
                  : used_;
      skipping_ = newline == nullptr && !block.end;
      block.overlong = block.overlong || !skipping_;
      std::memmove(buffer_.get(), buffer_.get() + dropped, used_ - dropped);
      used_ -= dropped;
      if (skipping_) continue;
    }
    const std::size_t from = searched > used_ ? 0 : searched;
    const void* last = memrchr(buffer_.get() + from, '\n', used_ - from);
    if (last != nullptr) {
      handed_ = static_cast<std::size_t>(static_cast<const char*>(last) - buffer_.get()) + 1;
    }
    if (block.end) block.cut_off = used_ > handed_;
    if (last != nullptr || block.end || block.overlong) {
      block.text = {buffer_.get(), handed_};
      return block;
    }
    if (used_ == kBufferBytes) {
      skipping_ = true;
      used_ = 0;
    }
  }
}

std::string_view LineBlocks::next(LogCounts& counts) {
  while (source_ != nullptr) {
    const Expected<LogBlock> block = source_->next();
    bytes_read_ = source_->bytes_read();
    if (!block) {
      error_ = block.error();
      source_.reset();
      break;
    }
    if (block->overlong) {
      ++counts.lines;
      counts.add_malformed("the line is longer than any frame");
    }
    if (block->cut_off) ++counts.cut_off_lines;
    if (!block->text.empty()) return block->text;  // remains valid in the source's buffer
    if (block->end) source_.reset();
  }
  return {};
}

void LineBlocks::before_wait(std::function<void()> callback) {
  if (source_ != nullptr) source_->before_wait(std::move(callback));
}

Expected<std::unique_ptr<LogSource>> open_source(const std::string& path) {
  auto bytes = open_bytes(path);
  if (!bytes) return tl::unexpected(bytes.error());
  return std::make_unique<LogSource>(std::move(*bytes));
}

std::unique_ptr<LogSource> log_from_text(std::string text, std::size_t chunk) {
  return std::make_unique<LogSource>(bytes_from_text(std::move(text), chunk));
}

}  // namespace vgyro::canlog
