#include "canlog/writer.h"

#include <algorithm>
#include <array>

#include "canlog/asc_writer.h"
#include "canlog/blf_writer.h"
#include "canlog/candump.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

void LogWriter::omit(std::string_view what) {
  const auto known = std::find_if(omissions_.begin(), omissions_.end(),
                                  [&](const Omission& omission) { return omission.what == what; });
  if (known != omissions_.end()) {
    ++known->frames;
  } else {
    omissions_.push_back({std::string(what), 1});
  }
}

std::string channel_name(unsigned channel) {
  return "can" + std::to_string(channel - 1);
}

unsigned ChannelNumbers::channel_of(std::string_view name) {
  const auto known = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return entry.name == name; });
  if (known != entries_.end()) return known->channel;
  const auto is_taken = [this](unsigned channel) {
    return std::any_of(entries_.begin(), entries_.end(),
                       [&](const Entry& entry) { return entry.channel == channel; });
  };
  // The forms hold a channel in 8 bits.
  constexpr unsigned kChannelMax = 255;
  unsigned channel = 0;
  if (name.starts_with("can"))
    channel = number_of<unsigned>(name.substr(3)).value_or(kChannelMax) + 1;
  if (channel == 0 || channel > kChannelMax || is_taken(channel)) {
    channel = 1;
    while (is_taken(channel))
      ++channel;
  }
  entries_.push_back({std::string(name), channel});
  return channel;
}

namespace {

class CandumpWriter final : public LogWriter {
 public:
  CandumpWriter(ByteSink& sink, const WriterOptions& options) : sink_(sink), options_(options) {}
  void put(const LogRecord& record, std::string_view bus, const XlFrame* xl) override {
    const unsigned digits =
        options_.fraction_digits != 0 ? options_.fraction_digits : record.fraction_digits;
    if (record.is_xl && xl != nullptr) {
      sink_.write(format_xl_line(record.stamp, bus, *xl, digits, record.direction));
      return;
    }
    char line[kLineBytesMax];
    sink_.write(
        {line, format_line(line, record.stamp, bus, record.frame, digits, record.direction)});
  }
  void finish() override {}

 private:
  ByteSink& sink_;
  WriterOptions options_;
};

template <class T>
std::unique_ptr<LogWriter> make(ByteSink& sink, const WriterOptions& options) {
  return std::make_unique<T>(sink, options);
}

constexpr std::array kWrittenForms{
    WrittenForm{".log", "candump log", true, false, make<CandumpWriter>},
    WrittenForm{".asc", "Vector ASC", true, false, make<AscWriter>},
    WrittenForm{".blf", "Vector BLF", false, true, make<BlfWriter>},
};

}  // namespace

std::span<const WrittenForm> written_forms() {
  return kWrittenForms;
}

const WrittenForm* written_form(std::string_view path) {
  const auto found =
      std::find_if(kWrittenForms.begin(), kWrittenForms.end(),
                   [&](const WrittenForm& form) { return path.ends_with(form.ending); });
  return found == kWrittenForms.end() ? nullptr : &*found;
}

}  // namespace vgyro::canlog
