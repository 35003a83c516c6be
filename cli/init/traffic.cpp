#include "cli/init/traffic.h"

#include <algorithm>

#include "canlog/merged_reader.h"
#include "cli/log_notes.h"
#include "cli/log_progress.h"

namespace vgyro::cli {

double Stream::frames_per_s() const {
  const double seconds = to_seconds(span(time_from_ns(first_ns), time_from_ns(last_ns)));
  return seconds > 0.0 ? static_cast<double>(frames - 1) / seconds : 0.0;
}

Expected<void> Traffic::read(const std::vector<std::string>& logs) {
  const auto opened = canlog::open_logs(logs);
  if (!opened) return tl::unexpected(opened.error());
  canlog::LogReader& reader = **opened;
  LogProgress progress("reading " + name_of(logs), reader);
  canlog::LogRecord record;
  while (reader.next(record)) {
    if (record.is_xl || !record.frame.is_data()) continue;
    add(reader.interfaces().name(record.bus), record);
    progress.add();
  }
  if (reader.error()) return tl::unexpected(*reader.error());
  if (frames_ == 0) return fail(name_of(logs), kNoFrame, kLogsRemedy);
  const auto parts = reader.parts();
  for (std::size_t i = 0; i < logs.size(); ++i) {
    if (parts[i]->malformed_lines + parts[i]->cut_off_lines > 0)
      notes_ += log_text(logs[i], *parts[i], false);
  }
  return {};
}

bool Traffic::wanted(std::int64_t t_ns) const {
  return span(time_from_ns(begin_ns_), time_from_ns(t_ns)).count() / kBlock_ns % every_ == 0;
}

void Traffic::add(const std::string& bus, const canlog::LogRecord& record) {
  const std::int64_t t_ns = to_ns(record.stamp);
  if (frames_++ == 0) begin_ns_ = t_ns;
  const Key key{bus, record.frame.has(can::kExtended), record.frame.id};
  auto found = streams_.find(key);
  if (found == streams_.end()) {
    if (streams_.size() >= kStreamsMost) return;
    found = streams_.emplace(key, Stream{}).first;
    found->second.bus = bus;
    found->second.id = record.frame.id;
    found->second.extended = record.frame.has(can::kExtended);
    found->second.first_ns = t_ns;
  }
  Stream& stream = found->second;
  ++stream.frames;
  stream.last_ns = t_ns;  // not the maximum: a single wrong stamp must not stretch the log
  if (!wanted(t_ns) || (!only_.empty() && !only_.contains(stream.id))) return;
  const auto payload = record.frame.payload();
  stream.kept.push_back({t_ns, stream.bytes.size(), record.frame.length});
  stream.bytes.insert(stream.bytes.end(), payload.begin(), payload.end());
  bytes_ += sizeof(Stream::Kept) + payload.size();
  if (bytes_ > bytes_most_) thin();
}

void Traffic::thin() {
  every_ *= 2;
  bytes_ = 0;
  for (auto& [key, stream] : streams_) {
    std::vector<Stream::Kept> kept;
    std::vector<std::uint8_t> bytes;
    for (const Stream::Kept& frame : stream.kept) {
      if (!wanted(frame.t_ns)) continue;
      const auto payload = stream.payload(frame);
      kept.push_back({frame.t_ns, bytes.size(), frame.length});
      bytes.insert(bytes.end(), payload.begin(), payload.end());
    }
    stream.kept = std::move(kept);
    stream.bytes = std::move(bytes);
    bytes_ += stream.kept.size() * sizeof(Stream::Kept) + stream.bytes.size();
  }
}

std::vector<const Stream*> Traffic::streams() const {
  std::vector<const Stream*> all;
  for (const auto& [key, stream] : streams_)
    all.push_back(&stream);
  return all;
}

double Traffic::seconds() const {
  std::int64_t first = INT64_MAX;
  std::int64_t last = INT64_MIN;
  for (const auto& [key, stream] : streams_) {
    first = std::min(first, stream.first_ns);
    last = std::max(last, stream.last_ns);
  }
  return last > first ? to_seconds(span(time_from_ns(first), time_from_ns(last))) : 0.0;
}

bool Traffic::has(const std::string& bus, std::uint32_t id) const {
  return streams_.contains(Key{bus, false, id});
}

}  // namespace vgyro::cli
