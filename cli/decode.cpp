#include <algorithm>
#include <cmath>
#include <memory>
#include <unordered_map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/printable.h"
#include "canlog/merged_reader.h"
#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/log_notes.h"
#include "cli/output/errors.h"
#include "cli/output/output_file.h"
#include "cli/output/terminal.h"
#include "dbc/multiplex.h"
#include "dbc/parser.h"

namespace vgyro::cli {

namespace {

std::string json_text(std::string_view text) {
  // JSON lets controls of eight bits through; as \u009b they are text to a terminal too.
  const bool ascii_only = printable(text) != text;
  return nlohmann::json(text).dump(-1, ' ', ascii_only, nlohmann::json::error_handler_t::replace);
}

// The texts of a signal that are the same in every line.
struct SignalText {
  std::string name;
  std::string unit;
};

struct KnownMessage {
  explicit KnownMessage(const dbc::Message& message)
      : codec(message), name(json_text(message.name)) {
    for (const dbc::Signal& signal : message.signals) {
      texts.emplace(&signal, SignalText{json_text(signal.name), json_text(signal.unit)});
    }
  }
  dbc::MessageCodec codec;
  std::string name;
  std::unordered_map<const dbc::Signal*, SignalText> texts;
};

class Decoder {
 public:
  explicit Decoder(std::vector<dbc::Database> databases) : databases_(std::move(databases)) {
    for (const dbc::Database& database : databases_) {
      for (const dbc::Message& message : database.messages) {
        messages_.push_back(std::make_unique<KnownMessage>(message));
      }
    }
  }

  /// The message of a frame's identifier, from the first file that knows it; null when none does.
  const KnownMessage* find(std::uint32_t id, bool extended) {
    const std::uint64_t key = static_cast<std::uint64_t>(extended) << 32U | id;
    const auto known = by_id_.find(key);
    if (known != by_id_.end()) return known->second;
    const auto found = std::find_if(messages_.begin(), messages_.end(), [&](const auto& message) {
      return message->codec.message().matches(id, extended);
    });
    const KnownMessage* message = found == messages_.end() ? nullptr : found->get();
    // A hostile log could bring half a billion identifiers.
    if (by_id_.size() < kRememberedMax) by_id_.emplace(key, message);
    return message;
  }

 private:
  static constexpr std::size_t kRememberedMax = 65536;
  std::vector<dbc::Database> databases_;
  std::vector<std::unique_ptr<KnownMessage>> messages_;
  std::unordered_map<std::uint64_t, const KnownMessage*> by_id_;
};

using Text = fmt::memory_buffer;

// Fifteen digits show what the file's decimal scale meant; a float shows its own shortest form.
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
        const SignalText& text = message.texts.at(&signal);
        fmt::format_to(to, "{}{}: {{\"value\": ", first ? "" : ", ", text.name);
        put_number(out, signal, reading.value, "null");
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
  message.codec.for_each(record.frame.payload(),
                         [&](const dbc::Signal& signal, dbc::Reading reading) {
                           fmt::format_to(to, "  {}=", signal.name);
                           if (const std::string* label = signal.label(reading.raw)) {
                             fmt::format_to(to, "{}", *label);
                             return;
                           }
                           put_number(out, signal, reading.value, "nan");
                           if (!signal.unit.empty()) fmt::format_to(to, " {}", signal.unit);
                         });
  fmt::format_to(to, "\n");
}

// ASCII without control characters, but for the end of the line: most lines are.
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

// What was no frame, of each log, and the sum.
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
  tell("{} of {} frames decoded, {} {}s not understood{}\n", decoded, reader.counts().frames,
       not_understood, parts.front()->item, passed_over);
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
    const KnownMessage* message = decoder->find(record.frame.id, record.frame.has(can::kExtended));
    if (message == nullptr) continue;
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
  tell_counts(options.logs, reader, decoded);
  if (reader.error()) return report(*reader.error());
  if (reader.counts().frames + reader.counts().xl_frames == 0) {
    return report(Error{name_of(options.logs), kNoFrame, kLogsRemedy});
  }
  return kDone;
}

}  // namespace vgyro::cli
