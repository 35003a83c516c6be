#include "canlog/blf_writer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <ctime>

#include <zlib.h>

#include "canlog/blf_layout.h"
#include "canlog/byte_order.h"
#include "canlog/frame_fields.h"

namespace vgyro::canlog {

namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kMilli_ns = 1'000'000;
constexpr std::int64_t kMicro_ns = 1'000;

// The size to which Vector's tools and python-can fill a container.
constexpr std::size_t kContainerBytes = 131'072;

// Stamps before the year 1980 count from an unknown beginning, so there is no date.
constexpr std::int64_t kDatesFrom_ns = 315'532'800 * kSecond_ns;

void store_date(char* to, std::int64_t ns) {
  if (ns < kDatesFrom_ns) return;
  const std::time_t seconds = ns / kSecond_ns;
  std::tm local{};
  ::localtime_r(&seconds, &local);
  constexpr int kTmYearZero = 1900;
  const std::array<int, blf::kDateWords> words{kTmYearZero + local.tm_year,
                                               local.tm_mon + 1,
                                               local.tm_wday,
                                               local.tm_mday,
                                               local.tm_hour,
                                               local.tm_min,
                                               local.tm_sec,
                                               static_cast<int>(ns % kSecond_ns / kMilli_ns)};
  for (std::size_t i = 0; i < words.size(); ++i)
    store_little(to + 2 * i, static_cast<std::uint16_t>(words[i]));
}

void store_object_head(char* to, std::size_t head_bytes, std::size_t bytes, std::uint32_t type) {
  constexpr std::uint16_t kVersion = 1;
  std::memcpy(to, blf::kObjectMark.data(), blf::kObjectMark.size());
  store_little(to + blf::object::kHeadBytes, static_cast<std::uint16_t>(head_bytes));
  store_little(to + blf::object::kVersion, kVersion);
  store_little(to + blf::object::kBytes, static_cast<std::uint32_t>(bytes));
  store_little(to + blf::object::kType, type);
}

std::uint8_t flags_of(const LogRecord& record) {
  return static_cast<std::uint8_t>(
      (record.direction == Direction::kTransmitted ? blf::kTransmitted : blf::kReceived) |
      (record.frame.has(can::kRemote) ? blf::message::kRemote : 0U));
}

// The fields that messages of both kinds share.
void store_message(char* fields, const LogRecord& record, unsigned channel, unsigned dlc) {
  namespace at = blf::message;
  const can::Frame& frame = record.frame;
  store_little(fields + at::kChannel, static_cast<std::uint16_t>(channel));
  store_little(fields + at::kFlags, flags_of(record));
  store_little(fields + at::kDlc, static_cast<std::uint8_t>(dlc));
  store_little(fields + at::kId, frame.id | (frame.has(can::kExtended) ? blf::kExtendedId : 0U));
}

}  // namespace

BlfWriter::BlfWriter(ByteSink& sink, const WriterOptions& options)
    : sink_(sink), options_(options), plain_bytes_(blf::file::kBytes) {
  content_.reserve(2 * kContainerBytes);
  const std::string begun = head();
  sink_.write(begun);
  file_bytes_ = begun.size();
}

void BlfWriter::put(const LogRecord& record, std::string_view bus, const XlFrame* /*xl*/) {
  if (record.is_xl) return omit("CAN XL frames");
  const std::int64_t stamp_ns = to_ns(record.stamp);
  if (!zero_ns_) {
    const std::int64_t first_ns = std::max<std::int64_t>(stamp_ns, 0);
    zero_ns_ = first_ns < kDatesFrom_ns ? 0 : first_ns - first_ns % kSecond_ns;
  }
  std::int64_t since_ns = stamp_ns - *zero_ns_;
  if (since_ns < 0) return omit("frames stamped before the second of the first frame");
  constexpr unsigned kMicroDigits = 6;
  if (options_.fraction_digits == kMicroDigits) since_ns -= since_ns % kMicro_ns;
  last_ns_ = std::max(last_ns_, stamp_ns);
  const unsigned channel = channels_.channel_of(bus);
  if (record.frame.has(can::kError)) {
    put_error(channel, since_ns);
  } else if (record.frame.has(can::kFd)) {
    put_fd(record, channel, since_ns);
  } else {
    put_classic(record, channel, since_ns);
  }
  if (content_.size() >= kContainerBytes) write_container();
}

void BlfWriter::add_object(std::uint32_t type, std::int64_t since_ns, std::size_t field_bytes) {
  const std::size_t at = content_.size();
  const std::size_t bytes = blf::object::kEventBytes + field_bytes;
  content_.append(bytes + bytes % blf::kPaddingOf, '\0');
  char* object = content_.data() + at;
  store_object_head(object, blf::object::kEventBytes, bytes, type);
  store_little(object + blf::object::kStampUnit, blf::object::kNanos);
  store_little(object + blf::object::kStamp, static_cast<std::uint64_t>(since_ns));
  fields_ = object + blf::object::kEventBytes;
  ++objects_;
}

// Writes only that there was an error frame: the form has no place for the causes that Linux
// reports.
void BlfWriter::put_error(unsigned channel, std::int64_t since_ns) {
  add_object(blf::kCanErrorExt, since_ns, blf::error_ext::kBytes);
  store_little(fields_ + blf::message::kChannel, static_cast<std::uint16_t>(channel));
}

void BlfWriter::put_classic(const LogRecord& record, unsigned channel, std::int64_t since_ns) {
  add_object(blf::kCanMessage, since_ns, blf::message::kBytes);
  const can::Frame& frame = record.frame;
  store_message(fields_, record, channel, frame.raw_dlc > 0 ? frame.raw_dlc : frame.length);
  if (frame.is_data()) {
    std::memcpy(fields_ + blf::message::kData, frame.data.data(),
                std::min<std::size_t>(frame.length, can::kClassicBytesMax));
  }
}

void BlfWriter::put_fd(const LogRecord& record, unsigned channel, std::int64_t since_ns) {
  namespace at = blf::fd;
  add_object(blf::kCanFdMessage, since_ns, at::kBytes);
  const can::Frame& frame = record.frame;
  store_message(fields_, record, channel, dlc_of(frame.length));
  store_little(fields_ + at::kFdFlags,
               static_cast<std::uint8_t>(
                   at::kFormat | (frame.has(can::kBitRateSwitch) ? at::kRateSwitch : 0U) |
                   (frame.has(can::kErrorStateIndicator) ? at::kErrorState : 0U)));
  store_little(fields_ + at::kLength, frame.length);
  std::memcpy(fields_ + at::kData, frame.data.data(), frame.length);
}

void BlfWriter::write_container() {
  if (content_.empty()) return;
  constexpr std::size_t kHeadBytes = blf::object::kBaseBytes + blf::container::kHeadBytes;
  uLongf packed_bytes = ::compressBound(content_.size());
  packed_.assign(kHeadBytes + packed_bytes, '\0');
  const bool is_packed = ::compress2(reinterpret_cast<Bytef*>(packed_.data() + kHeadBytes),
                                     &packed_bytes, reinterpret_cast<const Bytef*>(content_.data()),
                                     content_.size(), Z_DEFAULT_COMPRESSION) == Z_OK;
  if (is_packed) {
    packed_.resize(kHeadBytes + packed_bytes);
  } else {  // out of memory
    packed_.resize(kHeadBytes);
    packed_ += content_;
  }
  char* fields = packed_.data() + blf::object::kBaseBytes;
  store_object_head(packed_.data(), blf::object::kBaseBytes, packed_.size(), blf::kContainer);
  store_little(fields + blf::container::kPacking,
               is_packed ? blf::container::kDeflated : blf::container::kStored);
  store_little(fields + blf::container::kPlainBytes, static_cast<std::uint32_t>(content_.size()));
  packed_.append(packed_.size() % blf::kPaddingOf, '\0');
  sink_.write(packed_);
  file_bytes_ += packed_.size();
  plain_bytes_ += kHeadBytes + content_.size();
  content_.clear();
}

std::string BlfWriter::head() const {
  constexpr std::string_view kFormatVersion("\2\6\x8\1", 4);  // the version that readers have known
                                                              // longest
  std::string head(blf::file::kBytes, '\0');
  head.replace(0, blf::kFileMark.size(), blf::kFileMark);
  head.replace(blf::file::kVersion, kFormatVersion.size(), kFormatVersion);
  store_little(&head[blf::file::kHeadBytes], static_cast<std::uint32_t>(blf::file::kBytes));
  store_little(&head[blf::file::kFileBytes], file_bytes_);
  store_little(&head[blf::file::kPlainBytes], plain_bytes_);
  store_little(&head[blf::file::kObjects], objects_);
  if (zero_ns_) {
    store_date(&head[blf::file::kBegin], *zero_ns_);
    store_date(&head[blf::file::kEnd], last_ns_);
  }
  return head;
}

void BlfWriter::finish() {
  write_container();
  sink_.rewrite(0, head());
}

}  // namespace vgyro::canlog
