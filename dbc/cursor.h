#pragma once

// A position in DBC text, with functions to read elements there. The first mismatch is kept as the
// error; from then on reads return nothing and do not move, so that a statement can be read as a
// sequence with one check at its end.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace vgyro::dbc {

class Cursor {
 public:
  explicit Cursor(std::string_view text) : text_(text) {}

  [[nodiscard]] bool at_end();
  [[nodiscard]] unsigned line() const { return line_; }
  [[nodiscard]] bool failed() const { return !error_.empty(); }
  [[nodiscard]] const std::string& error() const { return error_; }
  void fail(std::string what);

  /// Looks at what follows blanks and newlines, without taking it.
  [[nodiscard]] char peek();
  [[nodiscard]] std::string_view peek_word();
  [[nodiscard]] bool peek_number();

  bool accept(char c);
  bool accept_word(std::string_view word);
  void expect(char c, std::string_view after);

  /// Letters, digits, '_' and everything beyond ASCII; may begin with a digit.
  std::string_view word(std::string_view what);
  std::uint32_t integer(std::string_view what, std::uint32_t max);
  std::uint64_t integer64(std::string_view what);
  /// Overflow gives an infinity, underflow zero.
  double number(std::string_view what);
  /// An integer that may be negative, beyond 2^63 (two's complement), or written as "3.0".
  std::int64_t label_value();
  enum class Wrap : bool { kNo, kYes };
  /// Does \" stand for a quote, or does the text end there? In Shift JIS the second byte of some
  /// characters is a backslash. Holds until it is set again.
  enum class Backslash : bool { kEscapes, kIsText };
  void take_backslash_as(Backslash backslash) { backslash_ = backslash; }
  /// Unescaped text between quotes; with Wrap::kYes it may extend over several lines.
  std::string quoted(std::string_view what, Wrap wrap);
  /// Empty when the line ends here.
  std::string_view word_on_this_line();

  /// Skips to the end of the line, before the newline.
  void skip_line();
  /// Moves to the next line if that holds a single word.
  bool next_line_is_one_word();
  /// Skips everything including the next ';' outside quotes, or to a line that begins with a
  /// keyword.
  void skip_statement();

  /// A position to return to.
  struct Mark {
    std::size_t position;
    unsigned line;
  };
  [[nodiscard]] Mark mark();
  /// Forgets the error and continues at the first later line that begins with a keyword.
  void resume_after(const Mark& statement_start);
  /// Forgets the error and goes back.
  void go_back_to(const Mark& mark);

 private:
  void skip_blanks();
  void step();
  [[nodiscard]] bool line_begins_with_keyword() const;
  [[nodiscard]] std::size_t closing_quote(std::size_t open) const;

  std::string_view text_;
  std::size_t position_ = 0;
  unsigned line_ = 1;
  Backslash backslash_ = Backslash::kEscapes;
  std::string error_;
};

/// Is it the first word of a DBC section?
bool is_keyword(std::string_view word);

}  // namespace vgyro::dbc
