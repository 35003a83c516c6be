#include "dbc/cursor.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/core.h>

namespace vgyro::dbc {

namespace {

constexpr std::array<std::string_view, 29> kKeywords = {"VERSION",      "NS_",
                                                        "BS_",          "BU_",
                                                        "VAL_TABLE_",   "BO_",
                                                        "SG_",          "BO_TX_BU_",
                                                        "EV_",          "ENVVAR_DATA_",
                                                        "EV_DATA_",     "SGTYPE_",
                                                        "CM_",          "BA_DEF_",
                                                        "BA_DEF_REL_",  "BA_DEF_SGTYPE_",
                                                        "BA_DEF_DEF_",  "BA_DEF_DEF_REL_",
                                                        "BA_",          "BA_REL_",
                                                        "BA_SGTYPE_",   "VAL_",
                                                        "CAT_DEF_",     "CAT_",
                                                        "FILTER",       "SIG_GROUP_",
                                                        "SIG_VALTYPE_", "SIGTYPE_VALTYPE_",
                                                        "SG_MUL_VAL_"};

bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\v' || c == '\f';
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

bool is_word_char(char c) {
  const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
  return letter || is_digit(c) || c == '_' || static_cast<unsigned char>(c) >= 0x80;
}

std::string_view word_at(std::string_view text, std::size_t position) {
  std::size_t end = position;
  while (end < text.size() && is_word_char(text[end]))
    ++end;
  return text.substr(position, end - position);
}

/// What was found instead, for an error.
std::string shown(std::string_view text, std::size_t position) {
  if (position >= text.size()) return "the end of the file";
  if (text[position] == '\n') return "the end of the line";
  const std::string_view word = word_at(text, position).substr(0, 40);
  if (!word.empty()) return fmt::format("'{}'", word);
  return fmt::format("'{}'", text[position]);
}

}  // namespace

bool is_keyword(std::string_view word) {
  return std::find(kKeywords.begin(), kKeywords.end(), word) != kKeywords.end();
}

void Cursor::fail(std::string what) {
  if (!failed()) error_ = std::move(what);
}

void Cursor::step() {
  if (text_[position_] == '\n') ++line_;
  ++position_;
}

void Cursor::skip_blanks() {
  while (position_ < text_.size() && (is_blank(text_[position_]) || text_[position_] == '\n')) {
    step();
  }
}

bool Cursor::at_end() {
  skip_blanks();
  return position_ >= text_.size();
}

char Cursor::peek() {
  return at_end() ? '\0' : text_[position_];
}

std::string_view Cursor::peek_word() {
  skip_blanks();
  return failed() ? std::string_view{} : word_at(text_, position_);
}

bool Cursor::peek_number() {
  const char c = peek();
  return !failed() && (is_digit(c) || c == '-' || c == '+' || c == '.');
}

bool Cursor::accept(char c) {
  if (failed() || peek() != c) return false;
  ++position_;
  return true;
}

bool Cursor::accept_word(std::string_view word) {
  if (peek_word() != word) return false;
  position_ += word.size();
  return true;
}

void Cursor::expect(char c, std::string_view after) {
  if (failed() || accept(c)) return;
  fail(fmt::format("expected '{}' after {}, found {}", c, after, shown(text_, position_)));
}

std::string_view Cursor::word(std::string_view what) {
  const std::string_view found = peek_word();
  if (found.empty()) fail(fmt::format("expected {}, found {}", what, shown(text_, position_)));
  position_ += found.size();
  return found;
}

std::uint64_t Cursor::integer64(std::string_view what) {
  skip_blanks();
  if (failed()) return 0;
  std::uint64_t value = 0;
  const char* const begin = text_.data() + position_;
  const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
  if (error != std::errc{}) {
    fail(fmt::format("expected {}, found {}", what, shown(text_, position_)));
    return 0;
  }
  position_ += static_cast<std::size_t>(end - begin);
  return value;
}

std::uint32_t Cursor::integer(std::string_view what, std::uint32_t max) {
  const std::uint64_t value = integer64(what);
  if (value > max) fail(fmt::format("{} {} is above {}", what, value, max));
  return failed() ? 0 : static_cast<std::uint32_t>(value);
}

double Cursor::number(std::string_view what) {
  if (!peek_number()) {
    fail(fmt::format("expected {}, found {}", what, shown(text_, position_)));
    return 0.0;
  }
  const bool plus = text_[position_] == '+';
  const char* const begin = text_.data() + position_ + (plus ? 1 : 0);
  double value = 0.0;
  const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
  // from_chars also reads "-inf", which is not meant in a DBC file.
  if (error == std::errc::invalid_argument ||
      (end != begin && !is_digit(end[-1]) && end[-1] != '.')) {
    fail(fmt::format("expected {}, found {}", what, shown(text_, position_)));
    return 0.0;
  }
  const std::string_view written(begin, static_cast<std::size_t>(end - begin));
  position_ += written.size() + (plus ? 1 : 0);
  if (error == std::errc{}) return value;
  const bool tiny = written.find("e-") != written.npos || written.find("E-") != written.npos;
  if (tiny) return 0.0;
  const double infinity = std::numeric_limits<double>::infinity();
  return written[0] == '-' ? -infinity : infinity;
}

std::int64_t Cursor::label_value() {
  skip_blanks();
  if (failed()) return 0;
  const char* const begin = text_.data() + position_;
  const char* const end = text_.data() + text_.size();
  const auto is_fraction = [&](const char* p) {
    return p != end && (*p == '.' || *p == 'e' || *p == 'E');
  };
  std::int64_t value = 0;
  auto [after, error] = std::from_chars(begin, end, value);
  if (error == std::errc::result_out_of_range && *begin != '-') {
    return std::bit_cast<std::int64_t>(integer64("a value"));
  }
  if (error == std::errc{} && !is_fraction(after)) {
    position_ += static_cast<std::size_t>(after - begin);
    return value;
  }
  const double written = number("a value");
  const bool whole = std::abs(written) < 0x1p62 && std::trunc(written) == written;
  if (!whole) fail("the value of a label is not a whole number");
  return failed() ? 0 : static_cast<std::int64_t>(written);
}

std::size_t Cursor::closing_quote(std::size_t open) const {
  for (std::size_t i = open + 1; i < text_.size(); ++i) {
    if (text_[i] == '"') return i;
    if (backslash_ == Backslash::kIsText) continue;
    const bool pair =
        text_[i] == '\\' && i + 1 < text_.size() && (text_[i + 1] == '"' || text_[i + 1] == '\\');
    if (pair) ++i;
  }
  return text_.size();
}

std::string Cursor::quoted(std::string_view what, Wrap wrap) {
  if (failed()) return {};
  if (peek() != '"') {
    fail(fmt::format("expected {} in quotes, found {}", what, shown(text_, position_)));
    return {};
  }
  const std::size_t close = closing_quote(position_);
  const std::string_view inside = text_.substr(position_ + 1, close - position_ - 1);
  if (close == text_.size() || (wrap == Wrap::kNo && inside.find('\n') != inside.npos)) {
    fail(fmt::format("the quotes around {} are not closed", what));
    return {};
  }
  while (position_ <= close)
    step();
  std::string out;
  out.reserve(inside.size());
  for (std::size_t i = 0; i < inside.size(); ++i) {
    // Inside quotes, a quote always follows a backslash.
    if (inside[i] == '\\' && i + 1 < inside.size() && inside[i + 1] == '"') continue;
    out.push_back(inside[i]);
  }
  return out;
}

void Cursor::skip_line() {
  while (position_ < text_.size() && text_[position_] != '\n')
    ++position_;
}

std::string_view Cursor::word_on_this_line() {
  while (position_ < text_.size() && is_blank(text_[position_]))
    ++position_;
  const std::string_view found = word_at(text_, position_);
  position_ += found.size();
  return found;
}

bool Cursor::next_line_is_one_word() {
  if (position_ >= text_.size()) return false;
  Cursor ahead = *this;
  ahead.step();
  const bool has_word = !ahead.word_on_this_line().empty();
  ahead.word_on_this_line();
  const bool alone = ahead.position_ >= text_.size() || text_[ahead.position_] == '\n';
  if (!has_word || !alone) return false;
  step();
  return true;
}

void Cursor::skip_statement() {
  bool in_quotes = false;
  while (position_ < text_.size() && (in_quotes || text_[position_] != ';')) {
    const char c = text_[position_];
    step();
    if (c == '"') in_quotes = !in_quotes;
    if (c != '\n') continue;
    // Quotes still open here are more likely an odd line than a text of two lines.
    in_quotes = false;
    if (line_begins_with_keyword()) return;
  }
  if (position_ < text_.size()) ++position_;
}

Cursor::Mark Cursor::mark() {
  skip_blanks();
  return {position_, line_};
}

void Cursor::go_back_to(const Mark& mark) {
  error_.clear();
  position_ = mark.position;
  line_ = mark.line;
}

void Cursor::resume_after(const Mark& statement_start) {
  go_back_to(statement_start);
  do {
    skip_line();
    if (position_ < text_.size()) step();
  } while (position_ < text_.size() && !line_begins_with_keyword());
}

bool Cursor::line_begins_with_keyword() const {
  std::size_t start = position_;
  while (start < text_.size() && is_blank(text_[start]))
    ++start;
  return is_keyword(word_at(text_, start));
}

}  // namespace vgyro::dbc
