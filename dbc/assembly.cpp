#include "dbc/assembly.h"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "dbc/codes.h"
#include "dbc/layout_check.h"

namespace vgyro::dbc {

namespace {

constexpr std::string_view kJ1939Format = "J1939PG";
constexpr std::uint32_t kJ1939FormatNumber = 3;
constexpr std::string_view kFdFormatEnding = "_FD";  // ending of StandardCAN_FD and ExtendedCAN_FD
constexpr std::array<std::uint32_t, 2> kFdFormatNumbers{14, 15};
constexpr unsigned kClassicBytesMost = 8;
constexpr std::string_view kJ1939Protocol = "J1939";

// Limits the memory if very many signals refer to one large table.
constexpr std::size_t kTableCopiesBytesMax = std::size_t{64} << 20U;

/// Place of a message among all messages; ordered maps stay fast with hostile names.
using MessageIndex = std::map<std::pair<bool, std::uint32_t>, std::size_t>;
using SignalIndex = std::map<std::pair<std::size_t, std::string_view>, std::size_t>;
/// Pairs of a message's place and a signal's place.
using SignalSet = std::set<std::pair<std::size_t, std::size_t>>;

class Assembly {
 public:
  explicit Assembly(Contents contents) : contents_(std::move(contents)) {}

  Database run(std::string path);

 private:
  void index();
  void comments();
  void long_names();
  void floats();
  void labels();
  void multiplex();
  void simple_multiplex();
  void frame_formats();
  void start_values();
  void check_layouts();

  std::optional<std::size_t> message_index(const Reference& at);
  Signal* find(const Reference& at);
  std::vector<ValueLabel> labels_of(LabelsStatement& statement);
  void leave_out(const SignalSet& signals);
  void odd(unsigned line, std::string what) { contents_.diagnostics.add(line, std::move(what)); }

  Contents contents_;
  MessageIndex message_index_;
  SignalIndex signal_index_;
  std::size_t table_copies_bytes_ = 0;
};

Database Assembly::run(std::string path) {
  index();
  multiplex();
  comments();
  long_names();
  floats();
  labels();
  frame_formats();
  start_values();
  simple_multiplex();  // last: it may remove signals, which the index does not track
  check_layouts();
  return {std::move(path), std::move(contents_.messages), contents_.diagnostics.take()};
}

void Assembly::index() {
  std::set<std::string_view> names;
  for (std::size_t m = 0; m < contents_.messages.size(); ++m) {
    const Message& message = contents_.messages[m];
    if (!names.insert(message.name).second) {
      odd(message.line,
          fmt::format("there is a message {} already; names find the first one", message.name));
    }
    const auto [first, is_new] = message_index_.try_emplace({message.extended, message.id}, m);
    if (!is_new) {
      odd(message.line, fmt::format("message {} has the identifier of message {}", message.name,
                                    contents_.messages[first->second].name));
    }
    for (std::size_t s = 0; s < message.signals.size(); ++s) {
      signal_index_.try_emplace({m, message.signals[s].name}, s);
    }
  }
}

std::optional<std::size_t> Assembly::message_index(const Reference& at) {
  if (at.id == kNoMessage) return std::nullopt;
  const SplitId id = split_id(at.id);
  const auto found = message_index_.find({id.extended, id.id});
  if (found != message_index_.end()) return found->second;
  odd(at.line, fmt::format("no message has the identifier {}", at.id));
  return std::nullopt;
}

Signal* Assembly::find(const Reference& at) {
  const std::optional<std::size_t> message = message_index(at);
  if (!message) return nullptr;
  const auto found = signal_index_.find({*message, at.signal});
  if (found != signal_index_.end()) return &contents_.messages[*message].signals[found->second];
  odd(at.line,
      fmt::format("message {} has no signal {}", contents_.messages[*message].name, at.signal));
  return nullptr;
}

void Assembly::comments() {
  for (CommentStatement& statement : contents_.comments) {
    if (!statement.at.signal.empty()) {
      Signal* const signal = find(statement.at);
      if (signal != nullptr) signal->comment = std::move(statement.text);
    } else if (const auto message = message_index(statement.at)) {
      contents_.messages[*message].comment = std::move(statement.text);
    }
  }
}

void Assembly::long_names() {
  for (LongNameStatement& statement : contents_.long_names) {
    if (!statement.at.signal.empty()) {
      Signal* const signal = find(statement.at);
      if (signal != nullptr) signal->long_name = std::move(statement.name);
    } else if (const auto message = message_index(statement.at)) {
      contents_.messages[*message].long_name = std::move(statement.name);
    }
  }
}

void Assembly::floats() {
  for (const FloatStatement& statement : contents_.floats) {
    Signal* const signal = find(statement.at);
    if (signal == nullptr || statement.kind == 0) continue;
    signal->type = statement.kind == 1 ? ValueType::kFloat32 : ValueType::kFloat64;
  }
}

void Assembly::labels() {
  for (LabelsStatement& statement : contents_.labels) {
    Signal* const signal = find(statement.at);
    if (signal == nullptr) continue;
    signal->labels = labels_of(statement);
    // Some tools write the bit pattern of a signed value: 255 for an 8-bit -1.
    if (signal->type != ValueType::kSigned || signal->length_bits >= 63) continue;
    const std::int64_t span = std::int64_t{1} << signal->length_bits;
    for (ValueLabel& label : signal->labels) {
      if (label.raw >= span / 2 && label.raw < span) label.raw -= span;
    }
  }
}

std::vector<ValueLabel> Assembly::labels_of(LabelsStatement& statement) {
  if (statement.table.empty()) return std::move(statement.labels);
  const auto table = contents_.label_tables.find(statement.table);
  if (table == contents_.label_tables.end()) {
    odd(statement.at.line, fmt::format("there is no value table {}", statement.table));
    return {};
  }
  for (const ValueLabel& label : table->second) {
    table_copies_bytes_ += sizeof label + label.text.size();
  }
  if (table_copies_bytes_ <= kTableCopiesBytesMax) return table->second;
  odd(statement.at.line, "value tables are used too often; this signal gets no labels");
  return {};
}

void Assembly::multiplex() {
  for (MultiplexStatement& statement : contents_.multiplex) {
    Signal* const signal = find(statement.at);
    if (signal == nullptr) continue;
    Signal* const multiplexor =
        find({statement.at.line, statement.at.id, statement.condition.multiplexor});
    if (multiplexor == nullptr) continue;
    multiplexor->is_multiplexor = true;
    if (!signal->condition) {
      signal->condition = std::move(statement.condition);
    } else if (signal->condition->multiplexor == statement.condition.multiplexor) {
      auto& ranges = signal->condition->ranges;
      ranges.insert(ranges.end(), statement.condition.ranges.begin(),
                    statement.condition.ranges.end());
    } else {
      odd(statement.at.line, fmt::format("signal {} has multiplexor {} already", signal->name,
                                         signal->condition->multiplexor));
    }
  }
}

/// Gives every m<value> signal the multiplexor that its message marks with a plain M.
void Assembly::simple_multiplex() {
  struct Root {
    std::size_t count = 0;
    std::string name;
  };
  std::vector<Message>& messages = contents_.messages;
  SignalSet valued;
  for (const SimpleMultiplex& item : contents_.simple_multiplex) {
    valued.emplace(item.message, item.signal);
  }
  std::vector<Root> roots(messages.size());
  for (std::size_t m = 0; m < messages.size(); ++m) {
    for (std::size_t s = 0; s < messages[m].signals.size(); ++s) {
      const Signal& signal = messages[m].signals[s];
      if (!signal.is_multiplexor || signal.condition || valued.contains({m, s})) continue;
      ++roots[m].count;
      roots[m].name = signal.name;
    }
  }
  SignalSet left_out;
  for (const SimpleMultiplex& item : contents_.simple_multiplex) {
    Signal& signal = messages[item.message].signals[item.signal];
    const Root& root = roots[item.message];
    if (signal.condition) continue;  // SG_MUL_VAL_ has set it
    if (root.count == 1) {
      signal.condition = {root.name, {{item.value, item.value}}};
      continue;
    }
    left_out.emplace(item.message, item.signal);
    odd(signal.line, fmt::format("signal {} is multiplexed but message {} has {}; left out",
                                 signal.name, messages[item.message].name,
                                 root.count == 0 ? "no multiplexor" : "several multiplexors"));
  }
  leave_out(left_out);
}

void Assembly::leave_out(const SignalSet& signals) {
  for (std::size_t m = 0; m < contents_.messages.size(); ++m) {
    const auto first = signals.lower_bound({m, 0});
    if (first == signals.end() || first->first != m) continue;
    std::vector<Signal> kept;
    std::vector<Signal>& all = contents_.messages[m].signals;
    for (std::size_t s = 0; s < all.size(); ++s) {
      if (!signals.contains({m, s})) kept.push_back(std::move(all[s]));
    }
    all = std::move(kept);
  }
}

void Assembly::frame_formats() {
  const auto& labels = contents_.frame_format_labels;
  const auto label_of = [&](const AttributeValue& value) -> std::string_view {
    if (!value.number) return value.text;
    return *value.number < labels.size() ? std::string_view(labels[*value.number]) : "";
  };
  const auto is_j1939_format = [&](const AttributeValue& value) {
    if (value.number && labels.empty()) return *value.number == kJ1939FormatNumber;
    return label_of(value) == kJ1939Format;
  };
  const auto is_fd_format = [&](const AttributeValue& value) {
    if (!value.number || !labels.empty()) return label_of(value).ends_with(kFdFormatEnding);
    return std::find(kFdFormatNumbers.begin(), kFdFormatNumbers.end(), *value.number) !=
           kFdFormatNumbers.end();
  };
  const std::string& protocol =
      contents_.protocol.empty() ? contents_.protocol_default : contents_.protocol;
  const bool all_j1939 = protocol == kJ1939Protocol || names_nmea2000(protocol) ||
                         is_j1939_format(contents_.frame_format_default);
  const bool all_fd = is_fd_format(contents_.frame_format_default);
  for (Message& message : contents_.messages) {
    message.is_j1939 = message.extended && all_j1939;
    message.is_fd = all_fd;
  }
  for (const FrameFormatStatement& statement : contents_.frame_formats) {
    const std::optional<std::size_t> index = message_index(statement.at);
    if (!index) continue;
    Message& message = contents_.messages[*index];
    message.is_j1939 = message.extended && is_j1939_format(statement.value);
    message.is_fd = is_fd_format(statement.value);
  }
  for (Message& message : contents_.messages) {
    message.codes = code_rules_of(message.id, message.is_j1939, protocol);
    // J1939 and NMEA 2000 send longer messages in several classic frames.
    if (message.size_bytes > kClassicBytesMost && !message.is_j1939) message.is_fd = true;
  }
}

void Assembly::start_values() {
  if (contents_.start_value_default) {
    for (Message& message : contents_.messages) {
      for (Signal& signal : message.signals)
        signal.start_raw = contents_.start_value_default;
    }
  }
  for (const StartValueStatement& statement : contents_.start_values) {
    // Many files have start values of signals that were removed; they are no error.
    const SplitId id = split_id(statement.at.id);
    const auto message = message_index_.find({id.extended, id.id});
    if (message == message_index_.end()) continue;
    const auto found = signal_index_.find({message->second, statement.at.signal});
    if (found == signal_index_.end()) continue;
    contents_.messages[message->second].signals[found->second].start_raw = statement.raw;
  }
}

void Assembly::check_layouts() {
  for (Message& message : contents_.messages)
    check_layout(message, contents_.diagnostics);
}

}  // namespace

Database assemble(Contents contents, std::string path) {
  return Assembly(std::move(contents)).run(std::move(path));
}

}  // namespace vgyro::dbc
