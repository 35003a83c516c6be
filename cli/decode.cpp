#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <unordered_map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "canlog/merged_reader.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/log_notes.h"
#include "cli/other_senders.h"
#include "cli/output/errors.h"
#include "cli/output/output_file.h"
#include "cli/output/terminal.h"
#include "dbc/codes.h"
#include "dbc/multiplex.h"
#include "dbc/parser.h"

namespace vgyro::cli {

namespace {

std::string json_text(std::string_view text) {
  // JSON passes 8-bit control characters through; as \u009b they are text for a terminal too.
  const bool ascii_only = printable(text) != text;
  return nlohmann::json(text).dump(-1, ' ', ascii_only, nlohmann::json::error_handler_t::replace);
}

// The parts of a signal's output that are the same in every line.
struct KnownSignal {
  std::string name;
  std::string unit;
  dbc::NoValues no_values;
};

struct KnownMessage {
  KnownMessage(const dbc::Message& message, std::size_t in_file)
      : codec(message), name(json_text(message.name)), file(in_file) {
    for (const dbc::Signal& signal : message.signals) {
      signals.emplace(&signal, KnownSignal{json_text(signal.name), json_text(signal.unit),
                                           dbc::NoValues(signal, message.codes)});
    }
  }
  dbc::MessageCodec codec;
  std::string name;
  std::size_t file;  ///< index among the given files
  std::unordered_map<const dbc::Signal*, KnownSignal> signals;
  std::uint64_t frames = 0;
};

class Decoder {
 public:
  explicit Decoder(std::vector<dbc::Database> databases) : databases_(std::move(databases)) {
    for (std::size_t file = 0; file < databases_.size(); ++file) {
      for (const dbc::Message& message : databases_[file].messages) {
        messages_.push_back(std::make_unique<KnownMessage>(message, file));
      }
    }
  }

  /// The message of a frame's identifier, from the first file that has it, or null. An exact
  /// identifier takes precedence over a J1939 PGN from the same sender, and that over a PGN from
  /// any sender.
  KnownMessage* find(std::uint32_t id, bool extended) {
    const std::uint64_t key = static_cast<std::uint64_t>(extended) << 32U | id;
    const auto known = by_id_.find(key);
    if (known != by_id_.end()) return known->second;
    KnownMessage* message = search(id, extended);
    // A hostile log could bring half a billion identifiers.
    if (by_id_.size() < kRememberedMax) by_id_.emplace(key, message);
    return message;
  }

  /// After the log: warns of files without a frame in it, and of messages that came from other
  /// senders.
  void warn_of_silence() const {
    std::vector<std::uint64_t> frames(databases_.size());
    for (const auto& message : messages_)
      frames[message->file] += message->frames;
    for (const auto& message : messages_) {
      if (message->frames == 0) warn_of_other_senders(*message);
    }
    for (std::size_t file = 0; file < databases_.size(); ++file) {
      if (frames[file] > 0) continue;
      warn({databases_[file].path,
            fmt::format("none of its {} messages is in the log", databases_[file].messages.size()),
            ids_that_came()});
    }
  }

 private:
  static constexpr std::size_t kRememberedMax = 65536;
  static constexpr std::size_t kIdsShown = 8;

  KnownMessage* search(std::uint32_t id, bool extended) {
    const auto first = [&](auto fits) -> KnownMessage* {
      const auto found = std::find_if(messages_.begin(), messages_.end(), [&](const auto& message) {
        const dbc::Message& it = message->codec.message();
        return it.matches(id, extended) && fits(it.id);
      });
      return found == messages_.end() ? nullptr : found->get();
    };
    if (KnownMessage* exact = first([&](std::uint32_t its) { return its == id; })) return exact;
    if (KnownMessage* same = first([&](std::uint32_t its) { return dbc::same_sender(its, id); }))
      return same;
    return first([](std::uint32_t) { return true; });
  }

  void warn_of_other_senders(const KnownMessage& known) const {
    const dbc::Message& message = known.codec.message();
    if (!message.extended || message.is_j1939) return;
    OtherSenders others;
    for (const auto& [key, found] : by_id_) {
      const bool extended = key >> 32U != 0;
      if (extended && found == nullptr) others.add(message.id, static_cast<std::uint32_t>(key));
    }
    if (others.empty()) return;
    warn({at_line(databases_[known.file].path, message.line), others.text(message.name, message.id),
          others.remedy(message.id_mask())});
  }

  /// In candump's notation.
  [[nodiscard]] std::string ids_that_came() const {
    std::set<std::uint64_t> ids;
    for (const auto& [key, message] : by_id_)
      ids.insert(key);
    std::string text;
    std::size_t shown = 0;
    for (const std::uint64_t key : ids) {
      if (shown++ == kIdsShown) break;
      text += fmt::format("{}{:0{}X}", text.empty() ? "" : ", ", static_cast<std::uint32_t>(key),
                          key >> 32U != 0 ? 8 : 3);
    }
    if (ids.empty()) return {};
    return fmt::format("the log's identifiers are: {}{}", text,
                       ids.size() > kIdsShown ? ", …" : "");
  }

  std::vector<dbc::Database> databases_;
  std::vector<std::unique_ptr<KnownMessage>> messages_;
  std::unordered_map<std::uint64_t, KnownMessage*> by_id_;
};

using Text = fmt::memory_buffer;

// Fifteen digits show the value that the file's decimal scale meant; a float is shown in its
// shortest form.
void put_number(Text& out, const dbc::Signal& signal, double value, std::string_view not_finite) {
  auto to = std::back_inserter(out);
  if (!std::isfinite(value)) {
    fmt::format_to(to, "{}", not_finite);
  } else if (signal.type == dbc::ValueType::kFloat32 && signal.factor == 1.0 &&
             signal.offset == 0.0) {
    fmt::format_to(to, "{}", static_cast<float>(value));
  } else if (signal.type == dbc::ValueType::kFloat64) {
    fmt::format_to(to, "{}", value);
  } else {
    fmt::format_to(to, "{:.15g}", value);
  }
}

// "not available (0xFFFF)"
void put_code(Text& out, const dbc::Signal& signal, dbc::CodeRules rules, std::int64_t raw) {
  fmt::format_to(std::back_inserter(out), "{} (0x{:X})", dbc::code_text(signal, rules, raw),
                 static_cast<std::uint64_t>(raw));
}

void put_json(Text& out, const canlog::LogRecord& record, std::string_view bus,
              const KnownMessage& message) {
  auto to = std::back_inserter(out);
  const std::int64_t ns = to_ns(record.stamp);
  fmt::format_to(to, "{{\"t\": {}.", ns / 1'000'000'000);
  if (record.fraction_digits == 9) {
    fmt::format_to(to, "{:09}", ns % 1'000'000'000);
  } else {
    fmt::format_to(to, "{:06}", ns % 1'000'000'000 / 1000);
  }
  fmt::format_to(to, ", \"bus\": {}, \"id\": {}, \"message\": {}, \"signals\": {{", json_text(bus),
                 record.frame.id, message.name);
  bool first = true;
  message.codec.for_each(
      record.frame.payload(), [&](const dbc::Signal& signal, dbc::Reading reading) {
        const KnownSignal& text = message.signals.at(&signal);
        fmt::format_to(to, "{}{}: {{\"value\": ", first ? "" : ", ", text.name);
        if (text.no_values.contains(reading.raw)) {
          fmt::format_to(to, "null");
        } else {
          put_number(out, signal, reading.value, "null");
        }
        if (signal.type == dbc::ValueType::kUnsigned) {
          fmt::format_to(to, ", \"raw\": {}", static_cast<std::uint64_t>(reading.raw));
        } else {
          fmt::format_to(to, ", \"raw\": {}", reading.raw);
        }
        const std::string* label = signal.label(reading.raw);
        fmt::format_to(to, ", \"unit\": {}, \"label\": {}}}", text.unit,
                       label == nullptr ? "null" : json_text(*label));
        first = false;
      });
  fmt::format_to(to, "}}}}\n");
}

void put_text(Text& out, const canlog::LogRecord& record, std::string_view bus,
              const KnownMessage& message) {
  auto to = std::back_inserter(out);
  const std::int64_t ns = to_ns(record.stamp);
  fmt::format_to(to, "{}.{:06}  {:<6} {:0{}X}  {}", ns / 1'000'000'000, ns % 1'000'000'000 / 1000,
                 bus, record.frame.id, record.frame.has(can::kExtended) ? 8 : 3,
                 message.codec.message().name);
  const dbc::CodeRules rules = message.codec.message().codes;
  message.codec.for_each(record.frame.payload(),
                         [&](const dbc::Signal& signal, dbc::Reading reading) {
                           fmt::format_to(to, "  {}=", signal.name);
                           if (const std::string* label = signal.label(reading.raw)) {
                             fmt::format_to(to, "{}", *label);
                             return;
                           }
                           if (message.signals.at(&signal).no_values.contains(reading.raw)) {
                             put_code(out, signal, rules, reading.raw);
                             return;
                           }
                           put_number(out, signal, reading.value, "nan");
                           if (!signal.unit.empty()) fmt::format_to(to, " {}", signal.unit);
                         });
  fmt::format_to(to, "\n");
}

// Is the line ASCII without control characters, except its end? Most lines are.
bool is_plain(std::string_view line) {
  return std::all_of(line.begin(), line.end() - 1, [](char c) { return c >= ' ' && c <= '~'; });
}

Expected<Decoder> load_decoder(const std::vector<std::string>& files) {
  std::vector<dbc::Database> databases;
  for (const std::string& file : files) {
    auto loaded = dbc::load(file);
    if (!loaded) return tl::unexpected(loaded.error());
    for (const dbc::Diagnostic& odd : loaded->diagnostics) {
      warn({at_line(file, odd.line), odd.what, {}});
    }
    databases.push_back(std::move(*loaded));
  }
  return Decoder(std::move(databases));
}

// Reports the lines of each log that were no frame, and the sum.
void tell_counts(const std::vector<std::string>& logs, const canlog::LogReader& reader,
                 std::uint64_t decoded) {
  std::uint64_t not_understood = 0;
  std::string passed_over;
  const auto parts = reader.parts();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const canlog::LogCounts& counts = *parts[i];
    for (const canlog::MalformedLine& bad : counts.first_malformed)
      warn({fmt::format("{}:{}", logs[i], bad.line), bad.why, {}});
    not_understood += counts.malformed_lines + counts.cut_off_lines;
    passed_over += passed_over_text(counts);
  }
  tell("{} of {} frames decoded, {} not understood{}\n", decoded, reader.counts().frames,
       count_of(not_understood, parts.front()->item), passed_over);
}

}  // namespace

int run_decode(const DecodeOptions& options) {
  auto decoder = load_decoder(options.dbc_files);
  if (!decoder) return report(decoder.error());
  const auto opened = canlog::open_logs(options.logs);
  if (!opened) return report(opened.error());
  auto output = OutputFile::open("-");
  if (!output) return report(output.error());
  canlog::LogReader& reader = **opened;
  reader.before_wait([&] { output->flush(); });
  canlog::LogRecord record;
  Text line;
  std::uint64_t decoded = 0;
  while (reader.next(record)) {
    if (record.is_xl || !record.frame.is_data()) continue;
    KnownMessage* message = decoder->find(record.frame.id, record.frame.has(can::kExtended));
    if (message == nullptr) continue;
    ++message->frames;
    line.clear();
    const std::string& bus = reader.interfaces().name(record.bus);
    if (options.text) {
      put_text(line, record, bus, *message);
    } else {
      put_json(line, record, bus, *message);
    }
    const std::string_view text(line.data(), line.size());
    if (options.text && !is_plain(text)) {
      output->write(printable(text.substr(0, text.size() - 1)) + "\n");
    } else {
      output->write(text);
    }
    ++decoded;
  }
  if (const auto closed = output->close(); !closed) return report(closed.error());
  if (reader.counts().frames > 0) decoder->warn_of_silence();
  tell_counts(options.logs, reader, decoded);
  if (reader.error()) return report(*reader.error());
  if (reader.counts().frames + reader.counts().xl_frames == 0) {
    return report(Error{name_of(options.logs), kNoFrame, kLogsRemedy});
  }
  return kDone;
}

}  // namespace vgyro::cli
