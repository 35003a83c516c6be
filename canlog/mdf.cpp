#include "canlog/mdf.h"

#include <ctime>

#include "canlog/byte_order.h"
#include "canlog/text_line.h"
#include "canlog/wall_time.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::uint64_t kHeadAt = 64;
// Memory for each: a window onto its records, and one onto their payloads.
constexpr std::size_t kGroupsMax = 128;

// A date without a zone is in this machine's zone (canlog/wall_time.h).
std::int64_t from_local(std::int64_t wall_ns) {
  const std::time_t seconds = wall_ns / kSecond_ns;
  std::tm date{};
  ::gmtime_r(&seconds, &date);
  constexpr int kTmYearZero = 1900;
  const WallTime wall{kTmYearZero + date.tm_year,
                      static_cast<unsigned>(date.tm_mon) + 1,
                      static_cast<unsigned>(date.tm_mday),
                      static_cast<unsigned>(date.tm_hour),
                      static_cast<unsigned>(date.tm_min),
                      static_cast<unsigned>(date.tm_sec),
                      wall_ns % kSecond_ns};
  return local_to_epoch_ns(wall).value_or(wall_ns);
}

std::optional<std::int64_t> beginning_ns(const MdfBlock& head) {
  constexpr std::size_t kFlagsAt = 12;
  constexpr unsigned kIsLocal = 1;
  if (head.data.size() <= kFlagsAt) return std::nullopt;
  const auto ns = load_little<std::uint64_t>(head.data.data());
  if (ns > static_cast<std::uint64_t>(kStampMax_ns)) return std::nullopt;
  const bool is_local = (load_byte(&head.data[kFlagsAt]) & kIsLocal) != 0;
  return is_local ? from_local(static_cast<std::int64_t>(ns)) : static_cast<std::int64_t>(ns);
}

}  // namespace

bool is_mdf(std::string_view head) {
  return head.starts_with("MDF     ") || head.starts_with("UnFinMF ");
}

Expected<std::unique_ptr<LogReader>> MdfReader::open(std::unique_ptr<ByteSource> bytes) {
  auto source = seekable(std::move(bytes));
  if (!source) return tl::unexpected(source.error());
  auto file = MdfFile::open(std::move(*source));
  if (!file) return tl::unexpected(file.error());
  std::unique_ptr<MdfReader> reader(new MdfReader(std::move(*file)));
  if (auto done = reader->open_groups(); !done) return tl::unexpected(done.error());
  return reader;
}

Expected<void> MdfReader::open_groups() {
  constexpr std::size_t kHeadBytes = 32;
  const auto head = file_->block(kHeadAt, "##HD", kHeadBytes);
  if (!head) return tl::unexpected(head.error());
  const auto zero_ns = beginning_ns(*head);
  if (!zero_ns) return tl::unexpected(file_->damage(kHeadAt, "the measurement's beginning"));
  bool has_frames = false;
  for (std::uint64_t at = head->link(0); at != 0;) {
    const auto block = file_->block(at, "##DG", 1);
    if (!block) return tl::unexpected(block.error());
    auto group = MdfGroup::open(file_, *block, counts_);
    if (!group) return tl::unexpected(group.error());
    (*group)->zero_ns = *zero_ns;
    has_frames = has_frames || (*group)->has_frames();
    if ((*group)->has_frames() && !(*group)->is_empty()) {
      streams_.push_back({std::move(*group), {}, false});
    }
    if (streams_.size() > kGroupsMax) {
      return tl::unexpected(file_->damage(at, "more than 128 groups of frames"));
    }
    at = block->link(0);
  }
  if (!has_frames) {
    return fail(file_->name(), "is an MDF file without CAN frames: no group has CAN_DataFrame",
                "decoded signals cannot be replayed; the logger's own file of frames is needed");
  }
  return {};
}

void MdfReader::advance(Stream& stream) {
  stream.has_record = stream.group->next(stream.record);
  if (stream.has_record) return;
  if (stream.group->error() && !error_) error_ = stream.group->error();
  if (stream.group->is_cut_off()) counts_.cut_off_lines = 1;
}

bool MdfReader::next(LogRecord& record) {
  for (Stream& stream : streams_)
    if (!started_) advance(stream);
  started_ = true;
  while (true) {
    Stream* first = nullptr;
    for (Stream& stream : streams_) {
      if (stream.has_record && (first == nullptr || stream.record.stamp < first->record.stamp)) {
        first = &stream;
      }
    }
    if (first == nullptr) return false;
    record = first->record;
    advance(*first);
    set_stamp(to_ns(record.stamp), record);
    // The bus of "canN" has the file's own number N.
    if (!set_channel(record.bus + 1U, record)) {
      counts_.add_malformed("more than 64 different buses");
      continue;
    }
    ++counts_.frames;
    return true;
  }
}

}  // namespace vgyro::canlog
