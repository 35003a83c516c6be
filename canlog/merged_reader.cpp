#include "canlog/merged_reader.h"

#include <algorithm>
#include <chrono>

#include <fmt/core.h>

namespace vgyro::canlog {

namespace {

// Smaller stamps count from some beginning: of the log, or of a logger without a clock. No CAN log
// is older than 1980.
constexpr TimePoint kEpochStampsFrom = time_from_ns(315'532'800'000'000'000);

// Rotated logs with a night or a winter between them are one recording if the user says so.
constexpr Duration kPauseMax = std::chrono::hours(366 * 24);

std::string seconds_text(TimePoint t) {
  return fmt::format("{:.3f}", to_seconds(t.time_since_epoch()));
}

}  // namespace

Expected<std::unique_ptr<LogReader>> open_logs(const std::vector<std::string>& paths) {
  if (paths.size() == 1) return open_log(paths.front());
  std::vector<MergedReader::Part> parts;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const auto last = paths.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(paths.begin(), last, paths[i]) != last) {
      return fail(paths[i] == "-" ? "standard input" : paths[i], "is named twice");
    }
    auto reader = open_log(paths[i]);
    if (!reader) return tl::unexpected(reader.error());
    parts.push_back({paths[i], std::move(*reader)});
  }
  return MergedReader::make(std::move(parts));
}

MergedReader::MergedReader(std::vector<Part> parts) {
  for (Part& part : parts)
    streams_.push_back({std::move(part), {}, {}, {}, false});
}

Expected<std::unique_ptr<LogReader>> MergedReader::make(std::vector<Part> parts) {
  std::unique_ptr<MergedReader> merged(new MergedReader(std::move(parts)));
  for (Stream& stream : merged->streams_) {
    stream.next = merged->read(stream);
    if (stream.next) stream.after = merged->read(stream);
  }
  if (const auto error = merged->mismatch()) return tl::unexpected(*error);
  return merged;
}

// Logs that count from different beginnings cannot be aligned.
std::optional<Error> MergedReader::mismatch() const {
  const Stream* since_epoch = nullptr;
  const Stream* since_start = nullptr;
  for (const Stream& stream : streams_) {
    if (!stream.next) continue;
    const bool is_epoch = stream.next->record.stamp >= kEpochStampsFrom;
    const Stream*& kind = is_epoch ? since_epoch : since_start;
    if (kind == nullptr) kind = &stream;
  }
  if (since_epoch == nullptr || since_start == nullptr) return std::nullopt;
  return Error{since_start->part.path,
               fmt::format("its stamps count from its own beginning ({} s), those of {} from the "
                           "epoch ({} s): which frames were simultaneous is unknown",
                           seconds_text(since_start->next->record.stamp), since_epoch->part.path,
                           seconds_text(since_epoch->next->record.stamp)),
               "logs with stamps of one clock are needed"};
}

std::optional<MergedReader::Held> MergedReader::read(Stream& stream) {
  Held held;
  if (!stream.part.reader->next(held.record)) {
    if (stream.part.reader->error() && !error_) {
      error_ = stream.part.reader->error();
      failed_ = &stream;
    }
    return std::nullopt;
  }
  if (held.record.is_xl && stream.part.reader->xl_frame() != nullptr) {
    held.xl = std::make_unique<XlFrame>(*stream.part.reader->xl_frame());
  }
  return held;
}

MergedReader::Stream* MergedReader::first_due() {
  Stream* first = nullptr;
  for (Stream& stream : streams_) {
    if (stream.next && (first == nullptr || stream.due() < first->due())) first = &stream;
  }
  return first;
}

bool MergedReader::is_far_from_all_before(const Stream& stream) {
  if (stream.begun || !newest_ || span(*newest_, stream.due()) <= kPauseMax) return false;
  constexpr double kDay_s = 86'400.0;
  error_ = Error{stream.part.path,
                 fmt::format("begins {:.0f} days after all that came before it has ended: these "
                             "are not logs of one drive",
                             to_seconds(span(*newest_, stream.due())) / kDay_s),
                 "give each drive a run of its own"};
  return true;
}

bool MergedReader::take_bus(Stream& stream, LogRecord& record) {
  const auto& names = stream.part.reader->interfaces();
  while (stream.buses.size() <= record.bus) {
    const auto bus =
        interfaces_.index_of(names.name(static_cast<can::BusIndex>(stream.buses.size())));
    if (!bus) return false;
    stream.buses.push_back(*bus);
  }
  record.bus = stream.buses[record.bus];
  return true;
}

bool MergedReader::next(LogRecord& record) {
  while (Stream* stream = first_due()) {
    // The records read before the damage of one log are still returned; after them the other logs
    // would be alone.
    if (failed_ != nullptr && !failed_->next) break;
    if (is_far_from_all_before(*stream)) break;
    stream->begun = true;
    record = stream->next->record;
    xl_ = std::move(stream->next->xl);
    stream->next = std::move(stream->after);
    stream->after = stream->next ? read(*stream) : std::nullopt;
    if (!newest_ || record.stamp > *newest_) newest_ = record.stamp;
    if (!take_bus(*stream, record)) {
      ++counts_.lines;
      counts_.add_malformed("more than 64 different interfaces in all logs together");
      continue;
    }
    ++(record.is_xl ? counts_.xl_frames : counts_.frames);
    return true;
  }
  for (Stream& stream : streams_)
    stream.next.reset();
  return false;
}

std::vector<const LogCounts*> MergedReader::parts() const {
  std::vector<const LogCounts*> all;
  for (const Stream& stream : streams_)
    all.push_back(&stream.part.reader->counts());
  return all;
}

std::uint64_t MergedReader::bytes_read() const {
  std::uint64_t sum = 0;
  for (const Stream& stream : streams_)
    sum += stream.part.reader->bytes_read();
  return sum;
}

std::uint64_t MergedReader::bytes_total() const {
  std::uint64_t sum = 0;
  for (const Stream& stream : streams_) {
    const std::uint64_t total = stream.part.reader->bytes_total();
    if (total == 0) return 0;  // one total is unknown
    sum += total;
  }
  return sum;
}

void MergedReader::before_wait(std::function<void()> callback) {
  for (Stream& stream : streams_)
    stream.part.reader->before_wait(callback);
}

}  // namespace vgyro::canlog
