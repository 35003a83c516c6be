#include "canlog/mdf_file.h"

#include <algorithm>
#include <cstring>

#include <fmt/core.h>
#include <zlib.h>

#include "canlog/byte_order.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

constexpr std::size_t kFileHeadBytes = 64;
constexpr std::size_t kVersionAt = 28;
constexpr std::size_t kUnfinishedAt = 60;
constexpr unsigned kVersionMin = 400;
constexpr unsigned kVersionMax = 499;

constexpr std::size_t kBlockHeadBytes = 24;  // mark, reserved, size, links
constexpr std::size_t kMarkBytes = 4;
constexpr std::size_t kLinkBytes = 8;
// Lists of data blocks may be long: 4 MiB each make 256 GiB.
constexpr std::uint64_t kLinksMax = 65'536;
constexpr std::size_t kBlocksMax = 1'000'000;
// The standard's limit is 4 MiB.
constexpr std::uint64_t kPackedBytesMax = 16ULL << 20U;

constexpr const char* kWayOut =
    "`can_logconvert FILE.mf4 OUT.log` of python-can with asammdf converts it";

// Undoes packing by columns: the first bytes of all records, then the second ones …
std::string by_rows(const std::string& columns, std::size_t width) {
  if (width <= 1) return columns;
  std::string rows = columns;
  const std::size_t height = columns.size() / width;
  for (std::size_t column = 0; column < width; ++column) {
    for (std::size_t row = 0; row < height; ++row)
      rows[row * width + column] = columns[column * height + row];
  }
  return rows;
}

}  // namespace

Expected<std::shared_ptr<MdfFile>> MdfFile::open(std::unique_ptr<ByteSource> bytes) {
  std::shared_ptr<MdfFile> file(new MdfFile(std::move(bytes)));
  char head[kFileHeadBytes];
  const auto got = file->read(0, head, sizeof head);
  if (!got) return tl::unexpected(got.error());
  if (*got < sizeof head)
    return fail(file->name(), "begins like an MDF file, but its head is cut off");
  const unsigned version = load_little<std::uint16_t>(head + kVersionAt);
  if (version < kVersionMin || version > kVersionMax) {
    return fail(file->name(),
                fmt::format("is an MDF file of version {}.{:02}, which is not read here",
                            version / 100, version % 100),
                "asammdf converts it to version 4; frames are needed, not decoded signals");
  }
  if (std::string_view(head, 8) == "UnFinMF ") {
    file->unfinished_ = load_little<std::uint16_t>(head + kUnfinishedAt);
  }
  return file;
}

Error MdfFile::damage(std::uint64_t at, std::string_view what) const {
  return {name(),
          fmt::format("{} (at byte {}): damaged, or in a form that is not read here", what, at),
          kWayOut};
}

Expected<std::size_t> MdfFile::read(std::uint64_t at, char* to, std::size_t size) {
  if (at != at_) {
    if (auto done = bytes_->seek(at); !done) return tl::unexpected(done.error());
    at_ = at;
  }
  std::size_t done = 0;
  while (done < size) {
    const auto got = bytes_->read(to + done, size - done);
    if (!got) return tl::unexpected(got.error());
    if (*got == 0) break;
    done += *got;
    at_ += *got;
  }
  return done;
}

Expected<MdfBlock> MdfFile::block(std::uint64_t at, std::string_view kind, std::size_t data_bytes) {
  const auto none = [&] {
    return tl::unexpected(
        damage(at, kind.empty() ? "a block" : fmt::format("a block of kind {}", kind.substr(2))));
  };
  char head[kBlockHeadBytes];
  const auto got = read(at, head, sizeof head);
  if (!got) return tl::unexpected(got.error());
  MdfBlock block;
  block.at = at;
  block.kind = std::string(head, kMarkBytes);
  const auto bytes = load_little<std::uint64_t>(head + 8);
  const auto links = load_little<std::uint64_t>(head + 16);
  if (*got < sizeof head || !block.kind.starts_with("##") || links > kLinksMax ||
      bytes < kBlockHeadBytes + links * kLinkBytes || ++blocks_read_ > kBlocksMax ||
      (!kind.empty() && block.kind != kind)) {
    return none();
  }
  block.data_at = at + kBlockHeadBytes + links * kLinkBytes;
  block.data_bytes = bytes - kBlockHeadBytes - links * kLinkBytes;
  std::string text(links * kLinkBytes + std::min<std::uint64_t>(block.data_bytes, data_bytes),
                   '\0');
  const auto rest = read(at + kBlockHeadBytes, text.data(), text.size());
  if (!rest) return tl::unexpected(rest.error());
  if (*rest < text.size()) return none();
  for (std::size_t i = 0; i < links; ++i)
    block.links.push_back(load_little<std::uint64_t>(&text[i * kLinkBytes]));
  block.data = text.substr(links * kLinkBytes);
  return block;
}

std::string MdfFile::text(std::uint64_t at) {
  constexpr std::size_t kLettersMax = 255;
  if (at == 0) return {};
  const auto block = this->block(at, "##TX", kLettersMax);
  return block ? block->data.substr(0, block->data.find('\0')) : std::string();
}

Expected<std::size_t> MdfData::read(char* to, std::size_t size) {
  while (true) {
    if (plain_at_ < plain_.size()) {
      const std::size_t count = std::min(size, plain_.size() - plain_at_);
      std::memcpy(to, plain_.data() + plain_at_, count);
      plain_at_ += count;
      return count;
    }
    if (left_ > 0) {
      auto got = file_->read(at_, to, std::min<std::uint64_t>(size, left_));
      if (!got) return got;
      at_ += *got;
      left_ -= *got;
      if (*got > 0) return *got;
      cut_off_ = left_ <= static_cast<std::uint64_t>(kStampMax_ns);
      left_ = 0;
      return 0;
    }
    const auto more = next_part();
    if (!more) return tl::unexpected(more.error());
    if (!*more) return 0;
  }
}

// False if no part follows.
Expected<bool> MdfData::next_part() {
  constexpr std::size_t kHeadBytes = 24;
  if (part_ < parts_.size()) {
    const std::uint64_t at = parts_[part_++];
    if (at == 0) return true;
    const auto block = file_->block(at, {}, kHeadBytes);
    if (!block) return tl::unexpected(block.error());
    if (auto done = open_part(*block); !done) return tl::unexpected(done.error());
    return true;
  }
  if (list_ == 0) return false;
  auto block = file_->block(std::exchange(list_, 0), {}, kHeadBytes);
  if (!block) return tl::unexpected(block.error());
  if (block->kind == "##HL") {
    list_ = block->link(0);
  } else if (block->kind == "##DL") {
    list_ = block->link(0);
    parts_.assign(block->links.begin() + (block->links.empty() ? 0 : 1), block->links.end());
    part_ = 0;
  } else if (auto done = open_part(*block); !done) {
    return tl::unexpected(done.error());
  }
  return true;
}

Expected<void> MdfData::open_part(const MdfBlock& block) {
  if (block.kind == "##DZ") return unpack(block);
  if (block.kind != "##DT" && block.kind != "##SD") {
    return tl::unexpected(
        file_->damage(block.at, fmt::format("data in a block of kind {}", block.kind.substr(2))));
  }
  at_ = block.data_at;
  left_ = block.data_bytes;
  // The writer fills in the size at the end.
  if (left_ == 0 && file_->lacks_data_size() && list_ == 0 && part_ == parts_.size()) {
    left_ = UINT64_MAX;
  }
  return {};
}

Expected<void> MdfData::unpack(const MdfBlock& block) {
  constexpr std::size_t kHeadBytes = 24;
  if (block.data.size() < kHeadBytes) return tl::unexpected(file_->damage(block.at, "packed data"));
  const unsigned packing = load_byte(&block.data[2]);
  const std::size_t width = load_little<std::uint32_t>(&block.data[4]);
  const auto plain_bytes = load_little<std::uint64_t>(&block.data[8]);
  const auto packed_bytes = load_little<std::uint64_t>(&block.data[16]);
  constexpr unsigned kDeflated = 0;
  constexpr unsigned kDeflatedColumns = 1;
  if ((packing != kDeflated && packing != kDeflatedColumns) || plain_bytes > kPackedBytesMax ||
      packed_bytes > kPackedBytesMax) {
    return tl::unexpected(file_->damage(block.at, "data packed in an unknown way, or too much"));
  }
  std::string packed(packed_bytes, '\0');
  const auto got = file_->read(block.data_at + kHeadBytes, packed.data(), packed.size());
  if (!got) return tl::unexpected(got.error());
  if (*got < packed.size()) {
    cut_off_ = true;
    return {};
  }
  plain_.assign(plain_bytes, '\0');
  plain_at_ = 0;
  uLongf size = plain_.size();
  const int result = ::uncompress(reinterpret_cast<Bytef*>(plain_.data()), &size,
                                  reinterpret_cast<const Bytef*>(packed.data()), packed.size());
  if (result != Z_OK || size != plain_.size()) {
    plain_.clear();
    return tl::unexpected(file_->damage(block.at, "packed data"));
  }
  if (packing == kDeflatedColumns) plain_ = by_rows(plain_, width);
  return {};
}

}  // namespace vgyro::canlog
