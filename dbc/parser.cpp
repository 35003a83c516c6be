#include "dbc/parser.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "base/bounded_file.h"
#include "dbc/assembly.h"
#include "dbc/contents.h"
#include "dbc/cursor.h"
#include "dbc/text.h"

namespace vgyro::dbc {

namespace {

constexpr std::uint32_t kUint16Max = std::numeric_limits<std::uint16_t>::max();
constexpr std::uint32_t kUint32Max = std::numeric_limits<std::uint32_t>::max();
constexpr std::string_view kFrameFormat = "VFrameFormat";
constexpr std::string_view kProtocol = "ProtocolType";
constexpr std::string_view kStartValue = "GenSigStartValue";
// Names beyond 32 characters are in attributes; the file itself holds shortened names.
constexpr std::string_view kLongMessageName = "SystemMessageLongSymbol";
constexpr std::string_view kLongSignalName = "SystemSignalLongSymbol";

class Parser {
 public:
  explicit Parser(std::string_view text) : cursor_(text) {}

  Contents run();

 private:
  void statement();
  bool read_with_plain_backslashes(const Cursor::Mark& start);
  void symbols();
  void message();
  void signal();
  void comment();
  void value_table();
  void value_labels();
  void value_type();
  void multiplex_ranges();
  void attribute_definition();
  void attribute_default();
  void attribute();

  void check_id(FileId id, const Message& message);
  void keep_signal(Signal signal, std::optional<std::uint64_t> multiplex_value);
  std::optional<std::uint64_t> multiplex_role(Signal& signal);
  void signal_layout(Signal& signal);
  void signal_scaling(Signal& signal);
  std::vector<ValueLabel> labels();
  AttributeValue attribute_value();
  std::optional<double> start_value();
  std::optional<Reference> attribute_target();
  FileId file_id() { return cursor_.integer("the identifier of a message", kUint32Max); }
  Reference signal_reference();
  void end_of_statement();
  void odd(std::string what) { contents_.diagnostics.add(line_, std::move(what)); }

  Cursor cursor_;
  Contents contents_;
  unsigned line_ = 0;  ///< line of the statement
  // SG_ lines after a skipped BO_ belong to no message and are not errors themselves.
  enum class Scope : std::uint8_t { kOutside, kMessage, kSkipped };
  Scope scope_ = Scope::kOutside;
  std::set<std::string, std::less<>> signal_names_;  ///< of the present message
};

Contents Parser::run() {
  while (!cursor_.at_end()) {
    const Cursor::Mark start = cursor_.mark();
    line_ = start.line;
    statement();
    if (!cursor_.failed() || read_with_plain_backslashes(start)) continue;
    cursor_.resume_after(start);
  }
  return std::move(contents_);
}

/// Reads a failed statement again: \" may be the end of a text in Shift JIS, where the second byte
/// of a character can be a backslash. If that fails too, the first error is reported.
bool Parser::read_with_plain_backslashes(const Cursor::Mark& start) {
  const std::string first_error = cursor_.error();
  cursor_.go_back_to(start);
  cursor_.take_backslash_as(Cursor::Backslash::kIsText);
  statement();
  cursor_.take_backslash_as(Cursor::Backslash::kEscapes);
  if (!cursor_.failed()) return true;
  odd(first_error);
  return false;
}

void Parser::statement() {
  struct Section {
    std::string_view keyword;
    void (Parser::*read)();
  };
  static constexpr std::array<Section, 11> kSections = {{
      {"NS_", &Parser::symbols},
      {"BO_", &Parser::message},
      {"SG_", &Parser::signal},
      {"CM_", &Parser::comment},
      {"VAL_TABLE_", &Parser::value_table},
      {"VAL_", &Parser::value_labels},
      {"SIG_VALTYPE_", &Parser::value_type},
      {"SG_MUL_VAL_", &Parser::multiplex_ranges},
      {"BA_DEF_", &Parser::attribute_definition},
      {"BA_DEF_DEF_", &Parser::attribute_default},
      {"BA_", &Parser::attribute},
  }};
  if (cursor_.accept(';')) return;  // some writers end a statement twice
  const std::string_view keyword = cursor_.word("a section keyword");
  for (const Section& section : kSections) {
    if (section.keyword == keyword) return (this->*section.read)();
  }
  if (keyword == "VERSION" || keyword == "BS_" || keyword == "BU_") return cursor_.skip_line();
  if (is_keyword(keyword)) return cursor_.skip_statement();
  if (cursor_.failed()) return;
  cursor_.fail(fmt::format("'{}' begins no section of a DBC file", keyword.substr(0, 40)));
}

/// Skips NS_, which lists keywords, one on each line, that are not statements there.
void Parser::symbols() {
  cursor_.skip_line();
  while (cursor_.next_line_is_one_word())
    cursor_.skip_line();
}

/// BO_ 291 GYRO: 8 ECU
void Parser::message() {
  scope_ = Scope::kSkipped;
  signal_names_.clear();
  Message message;
  const FileId id = file_id();
  message.name = cursor_.word("the name of the message");
  cursor_.expect(':', "the name of the message");
  message.size_bytes =
      static_cast<std::uint16_t>(cursor_.integer("the size of the message", kUint16Max));
  if (cursor_.failed()) return;
  message.sender = cursor_.word_on_this_line();
  cursor_.skip_line();
  if (id == kNoMessage) return;

  message.line = line_;
  message.id = split_id(id).id;
  message.extended = split_id(id).extended;
  check_id(id, message);
  contents_.messages.push_back(std::move(message));
  scope_ = Scope::kMessage;
}

void Parser::check_id(FileId id, const Message& message) {
  if ((id & ~kExtendedBit) != message.id) {
    odd(fmt::format("identifier {} of message {} has more than 29 bits; taken as 0x{:X}", id,
                    message.name, message.id));
  } else if (message.extended && (id & kExtendedBit) == 0) {
    odd(fmt::format("identifier {} of message {} is above 0x7FF without bit 31; taken as extended",
                    id, message.name));
  }
}

/// SG_ Rate m0 : 0|16@1- (0.005,-163.84) [-160|160] "deg/s" ECU
void Parser::signal() {
  if (scope_ == Scope::kSkipped) return cursor_.skip_line();
  if (scope_ == Scope::kOutside) return cursor_.fail("a signal outside of any message");
  Signal signal;
  signal.line = line_;
  signal.name = cursor_.word("the name of a signal");
  const std::optional<std::uint64_t> multiplex_value = multiplex_role(signal);
  cursor_.expect(':', "the name of the signal");
  signal_layout(signal);
  signal_scaling(signal);
  signal.unit = cursor_.quoted("the unit", Cursor::Wrap::kNo);
  if (cursor_.failed()) return;
  cursor_.skip_line();
  keep_signal(std::move(signal), multiplex_value);
}

void Parser::keep_signal(Signal signal, std::optional<std::uint64_t> multiplex_value) {
  Message& message = contents_.messages.back();
  if (!signal_names_.insert(signal.name).second) {
    return odd(fmt::format("message {} has a signal {} already; this one is ignored", message.name,
                           signal.name));
  }
  if (multiplex_value) {
    contents_.simple_multiplex.push_back(
        {contents_.messages.size() - 1, message.signals.size(), *multiplex_value});
  }
  message.signals.push_back(std::move(signal));
}

/// M, m3 or m3M; returns the 3.
std::optional<std::uint64_t> Parser::multiplex_role(Signal& signal) {
  std::string_view role = cursor_.peek_word();
  if (role.empty()) return std::nullopt;
  cursor_.accept_word(role);
  const std::string_view written = role;
  signal.is_multiplexor = role.ends_with('M');
  if (signal.is_multiplexor) role.remove_suffix(1);
  if (role.empty()) return std::nullopt;
  Cursor value(role.substr(1));
  const std::uint64_t number = value.integer64("a multiplexor value");
  if (!role.starts_with('m') || value.failed() || !value.at_end()) {
    cursor_.fail(fmt::format("expected M, m<value> or ':' after the name of the signal, found '{}'",
                             written.substr(0, 40)));
  }
  return number;
}

/// 0|16@1-
void Parser::signal_layout(Signal& signal) {
  signal.start_bit = static_cast<std::uint16_t>(cursor_.integer("the start bit", kUint16Max));
  cursor_.expect('|', "the start bit");
  signal.length_bits = static_cast<std::uint16_t>(cursor_.integer("the length", kUint16Max));
  cursor_.expect('@', "the length");
  const std::uint32_t order = cursor_.integer("the byte order", 1);
  signal.byte_order = order == 1 ? ByteOrder::kIntel : ByteOrder::kMotorola;
  const bool is_signed = cursor_.accept('-');
  if (!is_signed) cursor_.expect('+', "the byte order");
  signal.type = is_signed ? ValueType::kSigned : ValueType::kUnsigned;
}

/// (0.005,-163.84) [-160|160]
void Parser::signal_scaling(Signal& signal) {
  cursor_.expect('(', "the layout of the signal");
  signal.factor = cursor_.number("the scale");
  cursor_.expect(',', "the scale");
  signal.offset = cursor_.number("the offset");
  cursor_.expect(')', "the offset");
  cursor_.expect('[', "the scale and offset");
  signal.minimum = cursor_.number("the minimum");
  cursor_.expect('|', "the minimum");
  signal.maximum = cursor_.number("the maximum");
  cursor_.expect(']', "the maximum");
  if (!std::isfinite(signal.factor) || !std::isfinite(signal.offset)) {
    cursor_.fail(fmt::format("the scaling of signal {} is beyond all numbers", signal.name));
  }
}

/// CM_ SG_ 291 Rate "text";
void Parser::comment() {
  Reference at{line_, kNoMessage, {}};
  bool nameless = false;
  if (cursor_.accept_word("BO_")) {
    at.id = file_id();
  } else if (cursor_.accept_word("SG_")) {
    at.id = file_id();
    nameless = cursor_.peek() == '"';
    if (!nameless) at.signal = cursor_.word("the name of a signal");
  } else if (cursor_.accept_word("BU_") || cursor_.accept_word("EV_")) {
    cursor_.word("a name");
  }
  std::string text = cursor_.quoted("the comment", Cursor::Wrap::kYes);
  end_of_statement();
  if (cursor_.failed()) return;
  if (nameless) return odd("this comment names no signal; ignored");
  contents_.comments.push_back({std::move(at), std::move(text)});
}

std::vector<ValueLabel> Parser::labels() {
  std::vector<ValueLabel> labels;
  while (cursor_.peek_number()) {
    const std::int64_t raw = cursor_.label_value();
    std::string text = cursor_.quoted("a label", Cursor::Wrap::kYes);
    if (!cursor_.failed()) labels.push_back({raw, std::move(text)});
  }
  return labels;
}

/// VAL_TABLE_ OnOff 1 "on" 0 "off" ;
void Parser::value_table() {
  std::string name{cursor_.word("the name of the table")};
  std::vector<ValueLabel> table = labels();
  end_of_statement();
  if (cursor_.failed()) return;
  if (!contents_.label_tables.try_emplace(name, std::move(table)).second) {
    odd(fmt::format("there is a value table {} already; this one is ignored", name));
  }
}

/// VAL_ 291 Status 1 "on" 0 "off" ;   or with the name of a table, or of an environment variable
void Parser::value_labels() {
  const bool is_signal = cursor_.peek_number();
  LabelsStatement statement;
  if (is_signal) {
    statement.at = signal_reference();
  } else {
    cursor_.word("the name of an environment variable");
  }
  const bool names_table = !cursor_.peek_word().empty() && !cursor_.peek_number();
  if (names_table) statement.table = cursor_.word("the name of a value table");
  statement.labels = labels();
  end_of_statement();
  if (is_signal && !cursor_.failed()) contents_.labels.push_back(std::move(statement));
}

/// SIG_VALTYPE_ 291 Rate : 1;
void Parser::value_type() {
  FloatStatement statement{signal_reference(), 0};
  cursor_.accept(':');
  statement.kind = cursor_.integer("the value type", kFloatKindMax);
  end_of_statement();
  if (!cursor_.failed()) contents_.floats.push_back(std::move(statement));
}

/// SG_MUL_VAL_ 291 Inner Outer 0-3, 7-7;
void Parser::multiplex_ranges() {
  MultiplexStatement statement{signal_reference(), {}};
  statement.condition.multiplexor = cursor_.word("the name of the multiplexor");
  do {
    const std::uint64_t low = cursor_.integer64("a multiplexor value");
    cursor_.expect('-', "a multiplexor value");
    const std::uint64_t high = cursor_.integer64("a multiplexor value");
    if (low > high) cursor_.fail("a range of multiplexor values ends before it begins");
    statement.condition.ranges.emplace_back(low, high);
  } while (cursor_.accept(','));
  end_of_statement();
  if (!cursor_.failed()) contents_.multiplex.push_back(std::move(statement));
}

/// BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN";
void Parser::attribute_definition() {
  const bool of_messages = cursor_.accept_word("BO_");
  if (!of_messages) return cursor_.skip_statement();
  const std::string name = cursor_.quoted("the name of an attribute", Cursor::Wrap::kNo);
  if (name != kFrameFormat || !cursor_.accept_word("ENUM")) return cursor_.skip_statement();
  std::vector<std::string> values;
  do {
    values.push_back(cursor_.quoted("a value", Cursor::Wrap::kNo));
  } while (cursor_.accept(','));
  end_of_statement();
  if (!cursor_.failed()) contents_.frame_format_labels = std::move(values);
}

/// BA_DEF_DEF_ "VFrameFormat" "J1939PG";
void Parser::attribute_default() {
  const std::string name = cursor_.quoted("the name of an attribute", Cursor::Wrap::kNo);
  if (name == kStartValue) {
    contents_.start_value_default = start_value();
    return end_of_statement();
  }
  AttributeValue value = attribute_value();
  end_of_statement();
  if (cursor_.failed()) return;
  if (name == kFrameFormat) {
    contents_.frame_format_default = std::move(value);
  } else if (name == kProtocol) {
    contents_.protocol_default = std::move(value.text);
  }
}

/// BA_ "VFrameFormat" BO_ 2566844926 3;
void Parser::attribute() {
  const std::string name = cursor_.quoted("the name of an attribute", Cursor::Wrap::kNo);
  if (name == kStartValue && cursor_.accept_word("SG_")) {
    Reference at = signal_reference();
    const std::optional<double> raw = start_value();
    end_of_statement();
    if (raw && !cursor_.failed()) contents_.start_values.push_back({std::move(at), *raw});
    return;
  }
  std::optional<Reference> target = attribute_target();
  AttributeValue value = attribute_value();
  end_of_statement();
  if (cursor_.failed()) return;
  const bool of_message = target && target->signal.empty();
  if (name == kFrameFormat && of_message) {
    contents_.frame_formats.push_back({std::move(*target), std::move(value)});
  } else if ((name == kLongMessageName && of_message) ||
             (name == kLongSignalName && target && !of_message)) {
    contents_.long_names.push_back({std::move(*target), std::move(value.text)});
  } else if (name == kProtocol) {
    contents_.protocol = std::move(value.text);
  }
}

/// The message or signal that the attribute refers to; nothing for other targets.
std::optional<Reference> Parser::attribute_target() {
  if (cursor_.accept_word("BO_")) return Reference{line_, file_id(), {}};
  if (cursor_.accept_word("SG_")) return signal_reference();
  if (cursor_.accept_word("BU_") || cursor_.accept_word("EV_")) cursor_.word("a name");
  return std::nullopt;
}

AttributeValue Parser::attribute_value() {
  if (cursor_.peek() == '"') return {{}, cursor_.quoted("the value", Cursor::Wrap::kYes)};
  if (!cursor_.peek_number()) return {{}, std::string{cursor_.word("the value")}};
  const double number = cursor_.number("the value");
  if (!(number >= 0.0 && number <= kUint32Max)) return {};
  return {static_cast<std::uint32_t>(number), {}};
}

/// A number, perhaps in quotes; nothing for anything else.
std::optional<double> Parser::start_value() {
  const auto number_in = [](Cursor& cursor) -> std::optional<double> {
    if (!cursor.peek_number()) return std::nullopt;
    const double number = cursor.number("the value");
    if (cursor.failed() || !std::isfinite(number)) return std::nullopt;
    return number;
  };
  if (cursor_.peek() == '"') {
    const std::string text = cursor_.quoted("the value", Cursor::Wrap::kYes);
    Cursor inside(text);
    return number_in(inside);
  }
  const std::optional<double> number = number_in(cursor_);
  if (!number && !cursor_.failed()) cursor_.word("the value");
  return number;
}

Reference Parser::signal_reference() {
  Reference at{line_, file_id(), {}};
  at.signal = cursor_.word("the name of a signal");
  return at;
}

void Parser::end_of_statement() {
  if (cursor_.failed() || cursor_.accept(';')) return;
  if (cursor_.at_end() || is_keyword(cursor_.peek_word())) {
    return odd("the statement does not end in ';'");
  }
  cursor_.expect(';', "the statement");
}

}  // namespace

Database parse(std::string_view text, std::string path) {
  const std::string clean = normalised(text);
  return assemble(Parser(clean).run(), std::move(path));
}

Expected<Database> load(const std::string& path) {
  const Expected<std::string> text = read_regular_file(path, kFileBytesMax);
  if (!text) return tl::unexpected(text.error());
  Database database = parse(*text, path);
  if (!database.messages.empty()) return database;
  if (database.diagnostics.empty())
    return fail(path, "holds no message", "a DBC file with BO_ lines");
  const Diagnostic& first = database.diagnostics.front();
  return fail(at_line(path, first.line), first.what, "a DBC file with BO_ lines");
}

}  // namespace vgyro::dbc
