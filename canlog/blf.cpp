#include "canlog/blf.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "canlog/blf_layout.h"
#include "canlog/byte_order.h"
#include "canlog/frame_fields.h"
#include "canlog/text_line.h"
#include "canlog/wall_time.h"

namespace vgyro::canlog {

namespace {

constexpr const char* kTooShort = "the object is shorter than its contents";
constexpr const char* kTooManyBuses = "more than 64 different channels";

// Nothing if there is no date, or an impossible one.
std::optional<std::int64_t> read_date(const char* from) {
  constexpr std::int64_t kMilli_ns = 1'000'000;
  std::array<std::uint16_t, blf::kDateWords> words{};
  for (std::size_t i = 0; i < words.size(); ++i)
    words[i] = load_little<std::uint16_t>(from + 2 * i);
  const auto [year, month, weekday, day, hour, minute, second, milli] = words;
  if (hour >= 24 || minute >= 60 || second > 60 || milli >= 1'000) return std::nullopt;
  return local_to_epoch_ns({year, month, day, hour, minute, second, milli * kMilli_ns});
}

// Reads the time since the start of the measurement. Returns null, or what is wrong.
const char* read_stamp(const char* object, std::int64_t zero_ns, std::int64_t& ns) {
  constexpr std::int64_t kTenMicros_ns = 10'000;
  const auto unit = load_little<std::uint32_t>(object + blf::object::kStampUnit);
  const auto count = load_little<std::uint64_t>(object + blf::object::kStamp);
  // Writers that use a single unit leave zero.
  if (unit != blf::object::kTenMicros && unit != blf::object::kNanos && unit != 0) {
    return "stamp: neither in 10 us nor in ns";
  }
  const std::int64_t unit_ns = unit == blf::object::kTenMicros ? kTenMicros_ns : 1;
  if (count > static_cast<std::uint64_t>((kStampMax_ns - zero_ns) / unit_ns)) {
    return "stamp: beyond the year 2255";
  }
  ns = zero_ns + static_cast<std::int64_t>(count) * unit_ns;
  return nullptr;
}

Direction direction_of(unsigned value) {
  return (value & blf::kTransmitted) != 0 ? Direction::kTransmitted : Direction::kReceived;
}

const char* set_blf_id(std::uint32_t id, can::Frame& frame) {
  const bool extended = (id & blf::kExtendedId) != 0;
  return set_id(id & ~blf::kExtendedId, extended, frame);
}

void copy_payload(const char* from, std::size_t there, can::Frame& frame) {
  std::memcpy(frame.data.data(), from, std::min<std::size_t>(there, frame.length));
}

// Sets the content of a frame from an object for CAN FD; the frame may be classic. The object holds
// `there` bytes of it, of which `valid` count.
const char* set_fd_content(unsigned dlc, unsigned valid, const char* data, std::size_t there,
                           can::Frame& frame) {
  if (!frame.has(can::kFd)) {
    if (const char* why = set_dlc(dlc, frame)) return why;
    if (!frame.has(can::kRemote)) copy_payload(data, there, frame);
    return nullptr;
  }
  if (frame.has(can::kRemote)) return "a remote frame of CAN FD, which does not exist";
  if (const char* why = set_length(valid, frame)) return why;
  // Bytes that the object has no room for are zero, as CANoe writes and reads them.
  copy_payload(data, there, frame);
  return nullptr;
}

bool is_read(std::uint32_t type) {
  switch (type) {
    case blf::kCanMessage:
    case blf::kCanError:
    case blf::kCanErrorExt:
    case blf::kCanMessage2:
    case blf::kCanFdMessage:
    case blf::kCanFdMessage64:
    case blf::kCanFdError64:
      return true;
    default:
      return false;
  }
}

}  // namespace

bool is_blf(std::string_view head) {
  return head.starts_with(blf::kFileMark);
}

Expected<std::unique_ptr<LogReader>> BlfReader::open(std::unique_ptr<ByteSource> bytes) {
  auto window = std::make_unique<ByteWindow>(std::move(bytes));
  const std::string_view head = window->peek(blf::file::kBytes);
  const auto head_bytes = head.size() < blf::file::kBytesMin
                              ? 0
                              : load_little<std::uint32_t>(&head[blf::file::kHeadBytes]);
  if (head_bytes < blf::file::kBytesMin || head_bytes > blf::file::kBytesMax) {
    return fail(window->name(), "begins like a BLF file, but its head is invalid or cut off",
                "the file may be damaged; if Vector's tools open it, save it from there");
  }
  const std::string kept(head);
  window->pass(head_bytes);
  return std::unique_ptr<LogReader>(new BlfReader(std::move(window), kept));
}

BlfReader::BlfReader(std::unique_ptr<ByteWindow> bytes, std::string_view head)
    : BinaryReader("object"),
      content_(std::move(bytes)),
      buffer_(std::make_unique<char[]>(kBufferBytes)) {
  const auto date_ns = read_date(&head[blf::file::kBegin]);
  zero_ns_ = date_ns.value_or(0);
  const auto objects = load_little<std::uint32_t>(&head[blf::file::kObjects]);
  // python-can writes the date at the end, when it has seen a frame.
  if (!date_ns && objects == 0) {
    counts_.add_malformed(
        "the file's head was never completed: without its date the stamps count from zero");
  }
}

bool BlfReader::next(LogRecord& record) {
  while (true) {
    const Outcome outcome = read_object(record);
    if (outcome == Outcome::kFrame) {
      ++counts_.frames;
      return true;
    }
    if (outcome == Outcome::kEnd) return false;
  }
}

BlfReader::Outcome BlfReader::read_object(LogRecord& record) {
  if (!find_object()) return break_off(!lost_ && end_ - at_ >= blf::kPaddingOf);
  if (!fill(blf::object::kBaseBytes)) return break_off(true);
  Object object{buffer_.get() + at_, 0, 0, 0};
  object.head_bytes = load_little<std::uint16_t>(object.begin + blf::object::kHeadBytes);
  object.bytes = load_little<std::uint32_t>(object.begin + blf::object::kBytes);
  object.type = load_little<std::uint32_t>(object.begin + blf::object::kType);
  if (object.head_bytes < blf::object::kBaseBytes || object.bytes < object.head_bytes ||
      (is_read(object.type) && object.bytes > kObjectBytesMax)) {
    ++counts_.lines;
    counts_.add_malformed("impossible sizes");
    at_ += blf::kObjectMark.size();
    lost_ = true;
    return Outcome::kNone;
  }
  if (!is_read(object.type)) {
    if (!pass(object.bytes)) return break_off(true);
    ++counts_.lines;
    if (object.type != blf::kRestorePoints) ++counts_.other_lines;
    return Outcome::kNone;
  }
  if (!fill(object.bytes)) return break_off(true);
  object.begin = buffer_.get() + at_;
  at_ += object.bytes;
  ++counts_.lines;
  record = {};
  bool is_frame = true;
  if (const char* why = read_event(object, record, is_frame)) {
    counts_.add_malformed(why);
    return Outcome::kNone;
  }
  if (!is_frame) ++counts_.other_lines;
  return is_frame ? Outcome::kFrame : Outcome::kNone;
}

// Moves to the mark of the next object; false if none follows, or if bytes are missing.
bool BlfReader::find_object() {
  constexpr std::size_t kNear = blf::kPaddingOf + blf::kObjectMark.size();
  while (true) {
    fill(kNear);
    const std::string_view near(buffer_.get() + at_, std::min(kNear, end_ - at_));
    const std::size_t padding = near.find(blf::kObjectMark);
    if (padding != near.npos) {
      at_ += padding;
      if (lost_) counts_.skipped_bytes += padding;
      lost_ = false;
      return true;
    }
    if (near.size() < kNear) return false;
    if (!lost_) counts_.add_malformed("followed by data that are not an object");
    lost_ = true;
    resume_at_mark();
  }
}

void BlfReader::resume_at_mark() {
  const std::string_view there(buffer_.get() + at_, end_ - at_);
  const std::size_t found = there.find(blf::kObjectMark);
  // The mark may begin in the last bytes of the buffer.
  const std::size_t step =
      found != there.npos ? found : there.size() - (blf::kObjectMark.size() - 1);
  at_ += step;
  counts_.skipped_bytes += step;
}

bool BlfReader::fill(std::size_t size) {
  if (end_ - at_ >= size) return true;
  std::memmove(buffer_.get(), buffer_.get() + at_, end_ - at_);
  end_ -= at_;
  at_ = 0;
  while (end_ < size && torn_ == nullptr && !ended_) {
    const auto piece = content_.read(buffer_.get() + end_, kBufferBytes - end_);
    end_ += piece.size;
    torn_ = piece.torn;
    ended_ = piece.end;
  }
  return end_ >= size;
}

bool BlfReader::pass(std::uint64_t size) {
  while (size > 0) {
    if (at_ == end_ && !fill(1)) return false;
    const auto some = static_cast<std::size_t>(std::min<std::uint64_t>(size, end_ - at_));
    at_ += some;
    size -= some;
  }
  return true;
}

// No whole object is available: bytes are missing, or the log has ended, `inside` an object or not.
BlfReader::Outcome BlfReader::break_off(bool inside) {
  if (torn_ != nullptr) {
    counts_.add_malformed(torn_);
    counts_.skipped_bytes += end_ - at_;
    lost_ = true;
    torn_ = nullptr;
    at_ = end_;
    return Outcome::kNone;
  }
  const std::size_t rest = end_ - at_;
  at_ = end_;
  if (!ended_) return Outcome::kNone;
  if (std::exchange(finished_, true)) return Outcome::kEnd;
  counts_.skipped_bytes += content_.skipped_bytes() + (lost_ ? rest : 0);
  if (content_.bytes().error()) {
    error_ = content_.bytes().error();
  } else if (inside || content_.is_cut_off()) {
    counts_.cut_off_lines = 1;
  }
  return Outcome::kEnd;
}

// Returns null, or why the object holds no valid frame.
const char* BlfReader::read_event(const Object& object, LogRecord& record, bool& is_frame) {
  if (object.head_bytes < blf::object::kEventBytes) return kTooShort;
  std::int64_t ns = 0;
  if (const char* why = read_stamp(object.begin, zero_ns_, ns)) return why;
  set_stamp(ns, record);
  switch (object.type) {
    case blf::kCanMessage:
    case blf::kCanMessage2:
      return read_message(object, record, is_frame);
    case blf::kCanFdMessage:
      return read_fd(object, record, is_frame);
    case blf::kCanFdMessage64:
      return read_fd64(object, record, is_frame);
    default:
      break;
  }
  if (object.field_bytes() < sizeof(std::uint16_t)) return kTooShort;
  set_error_frame(record.frame);
  const unsigned channel = object.type == blf::kCanFdError64
                               ? load_byte(object.fields())
                               : load_little<std::uint16_t>(object.fields());
  return set_channel(channel, record) ? nullptr : kTooManyBuses;
}

const char* BlfReader::read_message(const Object& object, LogRecord& record, bool& is_frame) {
  namespace at = blf::message;
  if (object.field_bytes() < at::kBytes) return kTooShort;
  const char* fields = object.fields();
  can::Frame& frame = record.frame;
  if (const char* why = read_start(fields, record, is_frame)) return why;
  if (const char* why = set_dlc(load_byte(fields + at::kDlc), frame)) return why;
  if (!frame.has(can::kRemote)) {
    std::memcpy(frame.data.data(), fields + at::kData, can::kClassicBytesMax);
  }
  return set_message_channel(fields, record);
}

const char* BlfReader::read_fd(const Object& object, LogRecord& record, bool& is_frame) {
  if (object.field_bytes() < blf::fd::kData) return kTooShort;
  const char* fields = object.fields();
  can::Frame& frame = record.frame;
  const unsigned fd_flags = load_byte(fields + blf::fd::kFdFlags);
  if ((fd_flags & blf::fd::kFormat) != 0) {
    frame.flags |= can::kFd;
    if ((fd_flags & blf::fd::kRateSwitch) != 0) frame.flags |= can::kBitRateSwitch;
    if ((fd_flags & blf::fd::kErrorState) != 0) frame.flags |= can::kErrorStateIndicator;
  }
  if (const char* why = read_start(fields, record, is_frame)) return why;
  if (const char* why = set_fd_content(
          load_byte(fields + blf::message::kDlc), load_byte(fields + blf::fd::kLength),
          fields + blf::fd::kData, object.field_bytes() - blf::fd::kData, frame)) {
    return why;
  }
  return set_message_channel(fields, record);
}

// Reads the beginning that the classic object and the older FD object have in common.
const char* BlfReader::read_start(const char* fields, LogRecord& record, bool& is_frame) {
  namespace at = blf::message;
  const unsigned flags = load_byte(fields + at::kFlags);
  is_frame = (flags & at::kDirection) != blf::kTransmitRequest;
  record.direction = direction_of(flags);
  if ((flags & at::kRemote) != 0) record.frame.flags |= can::kRemote;
  const auto id = load_little<std::uint32_t>(fields + at::kId);
  return set_blf_id(id, record.frame);
}

const char* BlfReader::set_message_channel(const char* fields, LogRecord& record) {
  const auto channel = load_little<std::uint16_t>(fields + blf::message::kChannel);
  return set_channel(channel, record) ? nullptr : kTooManyBuses;
}

const char* BlfReader::read_fd64(const Object& object, LogRecord& record, bool& is_frame) {
  namespace at = blf::fd64;
  if (object.field_bytes() < at::kData) return kTooShort;
  const char* fields = object.fields();
  const unsigned direction = load_byte(fields + at::kDirection);
  is_frame = direction != blf::kTransmitRequest;
  record.direction = direction_of(direction);
  can::Frame& frame = record.frame;
  const auto flags = load_little<std::uint32_t>(fields + at::kFlags);
  if ((flags & at::kRemote) != 0) frame.flags |= can::kRemote;
  if ((flags & at::kFormat) != 0) {
    frame.flags |= can::kFd;
    if ((flags & at::kRateSwitch) != 0) frame.flags |= can::kBitRateSwitch;
    if ((flags & at::kErrorState) != 0) frame.flags |= can::kErrorStateIndicator;
  }
  if (const char* why = set_blf_id(load_little<std::uint32_t>(fields + at::kId), frame)) return why;
  // Other data may follow the bytes, at a place that counts from the object's beginning.
  const std::size_t more_at = load_byte(fields + at::kMoreAt);
  const std::size_t data_at = object.head_bytes + at::kData;
  const std::size_t data_end = more_at > data_at && more_at < object.bytes ? more_at : object.bytes;
  if (const char* why =
          set_fd_content(load_byte(fields + at::kDlc), load_byte(fields + at::kLength),
                         fields + at::kData, data_end - data_at, frame)) {
    return why;
  }
  return set_channel(load_byte(fields + at::kChannel), record) ? nullptr : kTooManyBuses;
}

}  // namespace vgyro::canlog
