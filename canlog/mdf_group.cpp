#include <algorithm>
#include <cstring>

#include <fmt/core.h>

#include "canlog/byte_order.h"
#include "canlog/mdf.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

namespace {

constexpr std::size_t kRecordBytesMax = 65'536;
constexpr std::size_t kRecordsMax = 1'024;
constexpr std::size_t kSizeBytes = 4;  // before a payload
// Limit of frames that wait for a payload.
constexpr std::size_t kWaitingMax = 1'024;

// Copies the payload; a classic frame has its stated length, even if more bytes are there. Null, or
// what is wrong.
const char* set_payload(const char* from, std::size_t there, can::Frame& frame) {
  if (frame.has(can::kRemote)) return nullptr;
  if (there < frame.length) return "payload: shorter than its length";
  std::memcpy(frame.data.data(), from, frame.length);
  return nullptr;
}

}  // namespace

const MdfGroup::Payload* MdfGroup::Payloads::find(std::uint64_t offset) const {
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const Payload& payload = kept[(last + kept.size() - i) % kept.size()];
    if (payload.offset == offset) return &payload;
  }
  return nullptr;
}

void MdfGroup::Payloads::keep(const Payload& payload) {
  if (kept.empty()) kept.resize(kKept);
  last = (last + 1) % kept.size();
  kept[last] = payload;
}

Expected<std::unique_ptr<MdfGroup>> MdfGroup::open(std::shared_ptr<MdfFile> file,
                                                   const MdfBlock& group, LogCounts& counts) {
  constexpr std::size_t kFirstLink = 1;
  constexpr std::size_t kDataLink = 2;
  constexpr std::size_t kChannelGroupBytes = 32;
  std::unique_ptr<MdfGroup> opened(new MdfGroup(file, counts));
  if (group.data.empty()) return tl::unexpected(file->damage(group.at, "a data group"));
  opened->number_bytes_ = load_byte(group.data.data());
  if (opened->number_bytes_ > sizeof(std::uint64_t)) {
    return tl::unexpected(file->damage(group.at, "a data group's numbers of records"));
  }
  for (std::uint64_t at = group.link(kFirstLink); at != 0;) {
    const auto block = file->block(at, "##CG", kChannelGroupBytes);
    if (!block) return tl::unexpected(block.error());
    if (block->data.size() < kChannelGroupBytes || opened->records_.size() == kRecordsMax) {
      return tl::unexpected(file->damage(at, "a channel group"));
    }
    if (auto done = opened->add_records(*block); !done) return tl::unexpected(done.error());
    at = block->link(0);
  }
  opened->link_payloads();
  if (opened->number_bytes_ == 0 && opened->records_.size() > 1) {
    return tl::unexpected(file->damage(group.at, "several channel groups without numbers"));
  }
  if (opened->number_bytes_ == 0 && !opened->records_.empty() && !file->lacks_counts()) {
    opened->left_ = opened->records_.front()->cycles;
  }
  if (group.link(kDataLink) == 0) opened->ended_ = true;
  opened->bytes_ = std::make_unique<ByteWindow>(
      std::make_unique<MdfData>(std::move(file), group.link(kDataLink)));
  return opened;
}

Expected<void> MdfGroup::add_records(const MdfBlock& block) {
  constexpr unsigned kPayloadFlag = 1;
  auto records = std::make_unique<Records>();
  records->number = load_little<std::uint64_t>(&block.data[0]);
  records->place = block.at;
  records->cycles = load_little<std::uint64_t>(&block.data[8]);
  records->is_payload = (load_little<std::uint16_t>(&block.data[16]) & kPayloadFlag) != 0;
  const std::size_t data_bytes = load_little<std::uint32_t>(&block.data[24]);
  // Bits after a record mark its invalid channels.
  records->bytes = data_bytes + load_little<std::uint32_t>(&block.data[28]);
  if (!records->is_payload) {
    auto frames = MdfFrames::describe(*file_, block, data_bytes);
    if (!frames) return tl::unexpected(frames.error());
    records->frames = std::move(*frames);
    if (records->frames) records->stream = streams_++;
    if (records->bytes > kRecordBytesMax && records->frames) {
      return tl::unexpected(file_->damage(block.at, "frames in records of more than 64 KiB"));
    }
  }
  records_.push_back(std::move(records));
  return {};
}

void MdfGroup::link_payloads() {
  for (const auto& records : records_) {
    if (!records->frames || !records->frames->elsewhere) continue;
    const std::uint64_t place = *records->frames->elsewhere;
    records->data.link = place;
    for (const auto& other : records_)
      if (other->is_payload && other->place == place) records->source = other.get();
  }
}

bool MdfGroup::next(LogRecord& record) {
  while (!by_stamp_.is_ready()) {
    if (!read(record)) {
      by_stamp_.close();
      break;
    }
    if (streams_ < 2) return true;
    by_stamp_.push(record, nullptr, stream_);
  }
  if (by_stamp_.is_empty()) return false;
  record = by_stamp_.pop().record;
  return true;
}

bool MdfGroup::read(LogRecord& record) {
  while (true) {
    if (take_waiting(record)) return true;
    if (ended_) return false;
    switch (step(record)) {
      case Step::kFrame:
        return true;
      case Step::kNone:
        break;
      case Step::kEnd:
        ended_ = true;
        break;
    }
  }
}

// Returns the first waiting frame once its payload is there or will not come.
bool MdfGroup::take_waiting(LogRecord& record) {
  while (!waiting_.empty()) {
    Waiting& first = waiting_.front();
    const bool is_whole = first.from == nullptr;
    if (!is_whole && !ended_ && waiting_.size() < kWaitingMax) return false;
    if (!is_whole) counts_.add_malformed("payload: it is not in the log");
    record = first.record;
    stream_ = first.stream;
    waiting_.pop_front();
    if (is_whole) return true;
  }
  return false;
}

MdfGroup::Step MdfGroup::step(LogRecord& record) {
  if (left_ == 0) return Step::kEnd;
  std::uint64_t number = 0;
  if (number_bytes_ > 0) {
    const std::string_view bytes = bytes_->peek(number_bytes_);
    if (bytes.empty() && !bytes_->error()) return Step::kEnd;
    if (bytes.size() < number_bytes_) return end_inside();
    for (std::size_t i = number_bytes_; i-- > 0;)
      number = number << 8U | load_byte(&bytes[i]);
    bytes_->take(number_bytes_);
  } else if (bytes_->peek(1).empty() && !bytes_->error()) {
    return left_ == UINT64_MAX ? Step::kEnd : end_inside();
  } else if (left_ != UINT64_MAX) {
    --left_;
  }
  Records* records = number_bytes_ > 0 ? find(number) : records_.front().get();
  if (records == nullptr) return end_damaged("a record of a group that is not described");
  return records->is_payload ? read_payload(*records) : read_record(*records, record);
}

MdfGroup::Records* MdfGroup::find(std::uint64_t number) {
  for (const auto& records : records_)
    if (records->number == number) return records.get();
  return nullptr;
}

MdfGroup::Step MdfGroup::read_payload(Records& records) {
  const std::string_view size = bytes_->peek(kSizeBytes);
  if (size.size() < kSizeBytes) return end_inside();
  Payload payload;
  payload.offset = records.payloads.end;
  payload.bytes = load_little<std::uint32_t>(size.data());
  bytes_->take(kSizeBytes);
  const std::size_t shown = std::min(payload.bytes, payload.data.size());
  const std::string_view bytes = bytes_->peek(shown);
  if (bytes.size() < shown) return end_inside();
  std::memcpy(payload.data.data(), bytes.data(), shown);
  if (!bytes_->pass(payload.bytes)) return end_inside();
  records.payloads.end += kSizeBytes + payload.bytes;
  records.payloads.keep(payload);
  const auto waits = std::find_if(waiting_.begin(), waiting_.end(), [&](const Waiting& waiting) {
    return waiting.from == &records && waiting.offset == payload.offset;
  });
  if (waits == waiting_.end()) return Step::kNone;
  waits->from = nullptr;
  if (const char* why = set_payload(payload.data.data(), shown, waits->record.frame)) {
    counts_.add_malformed(why);
    waiting_.erase(waits);
  }
  return Step::kNone;
}

MdfGroup::Step MdfGroup::read_record(Records& records, LogRecord& record) {
  if (!records.frames) {
    if (!bytes_->pass(records.bytes)) return end_inside();
    ++counts_.lines;
    ++counts_.other_lines;
    return Step::kNone;
  }
  const std::string_view bytes = bytes_->peek(records.bytes);
  if (bytes.size() < records.bytes) return end_inside();
  ++counts_.lines;
  record = {};
  stream_ = records.stream;
  const char* why = read_frame(records, bytes.data(), record);
  const std::uint64_t offset = records.frames->offset.value(bytes.data());
  bytes_->take(records.bytes);
  if (why != nullptr) {
    counts_.add_malformed(why);
    return Step::kNone;
  }
  const bool has_payload = record.frame.is_data() && records.frames->elsewhere;
  if (has_payload) return place_payload(records, offset, record);
  if (waiting_.empty()) return Step::kFrame;
  waiting_.push_back({record, stream_, nullptr, 0});
  return Step::kNone;
}

// Returns null, or why it is no frame.
const char* MdfGroup::read_frame(const Records& records, const char* bytes,
                                 LogRecord& record) const {
  const MdfFrames& frames = *records.frames;
  const auto since_ns = frames.clock->to_ns(bytes);
  if (!since_ns || *since_ns < -zero_ns || *since_ns > kStampMax_ns - zero_ns) {
    return "stamp: before 1970 or beyond 2255";
  }
  record.stamp = time_from_ns(zero_ns + *since_ns);
  const std::uint64_t bus = frames.bus.value(bytes);
  constexpr std::uint64_t kBusMax = 254;
  if (bus > kBusMax) return "bus: above 254";
  record.bus = static_cast<can::BusIndex>(bus);
  if (const char* why = frames.read(bytes, record)) return why;
  if (frames.elsewhere || !record.frame.is_data()) return nullptr;
  return set_payload(bytes + frames.data_at, frames.data_bytes, record.frame);
}

// Finds the payload, which is elsewhere: earlier, later, or in data of its own.
MdfGroup::Step MdfGroup::place_payload(Records& records, std::uint64_t offset, LogRecord& record) {
  can::Frame& frame = record.frame;
  const char* why = nullptr;
  Records* missing = nullptr;
  if (records.source == nullptr) {
    why = fetch(records.data, offset, frame);
  } else if (const Payload* payload = records.source->payloads.find(offset)) {
    why = set_payload(payload->data.data(), std::min(payload->bytes, payload->data.size()), frame);
  } else if (offset < records.source->payloads.end) {
    why = "payload: it is not in the log";
  } else {
    missing = records.source;
  }
  if (why != nullptr) {
    counts_.add_malformed(why);
    return Step::kNone;
  }
  if (missing == nullptr && waiting_.empty()) return Step::kFrame;
  waiting_.push_back({record, stream_, missing, offset});
  return Step::kNone;
}

// Returns null, or what is wrong. Offsets usually increase.
const char* MdfGroup::fetch(PayloadData& data, std::uint64_t offset, can::Frame& frame) {
  constexpr unsigned kRewoundMax = 64;
  constexpr const char* kMissing = "payload: it is not in the log";
  if (data.link == 0) return kMissing;
  if (data.bytes == nullptr || offset < data.at) {
    if (data.bytes != nullptr && ++data.rewound > kRewoundMax) {
      return "payload: before that of the frame before it, once too often";
    }
    data.bytes = std::make_unique<ByteWindow>(std::make_unique<MdfData>(file_, data.link));
    data.at = 0;
  }
  if (!data.bytes->pass(offset - data.at)) {
    data.at = UINT64_MAX;
    return kMissing;
  }
  data.at = offset;
  const std::string_view size = data.bytes->peek(kSizeBytes);
  if (size.size() < kSizeBytes) return kMissing;
  const std::size_t bytes = load_little<std::uint32_t>(size.data());
  const std::size_t shown = kSizeBytes + std::min(bytes, can::kFdBytesMax);
  const std::string_view all = data.bytes->peek(shown);
  if (all.size() < shown) return kMissing;
  return set_payload(&all[0] + kSizeBytes, shown - kSizeBytes, frame);
}

MdfGroup::Step MdfGroup::end_inside() {
  if (bytes_->error()) {
    error_ = bytes_->error();
  } else {
    cut_off_ = true;
  }
  return Step::kEnd;
}

MdfGroup::Step MdfGroup::end_damaged(const char* what) {
  error_ = Error{file_->name(), fmt::format("behind record {}: {}", counts_.lines, what),
                 "the file is damaged there; everything before it was read"};
  return Step::kEnd;
}

}  // namespace vgyro::canlog
