#include "base/toml_bounds.h"

#include <fmt/core.h>

namespace vgyro {

namespace {

// Scans a text as TOML does: strings and comments hide brackets and dots. In doubt it counts too
// much rather than too little.
class Shape {
 public:
  Shape(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  Expected<void> check() {
    while (at_ < text_.size()) {
      if (const std::size_t bytes = line_end(); bytes > 0) {
        end_line(bytes);
      } else if (const char c = text_[at_]; c == '#') {
        skip_comment();
      } else if (c == '"' || c == '\'') {
        skip_string(c);
      } else {
        count(c);
        ++at_;
      }
      if (line_ > kTomlLinesMax) return broken("has more than {} lines", kTomlLinesMax);
      if (at_ - line_begin_ > kTomlLineBytesMax) {
        return broken("is longer than {} bytes", kTomlLineBytesMax);
      }
      if (depth_ > kTomlNestingMax) return broken("nests deeper than {} brackets", kTomlNestingMax);
      if (dots_ >= kTomlKeyPartsMax)
        return broken("has a key of more than {} parts", kTomlKeyPartsMax);
    }
    return {};
  }

 private:
  template <class T>
  [[nodiscard]] tl::unexpected<Error> broken(fmt::format_string<T&> what, T most) const {
    return fail(at_line(file_, line_), fmt::format(what, most),
                "this is not a file for this program");
  }

  // The library also ends lines at Unicode line ends.
  [[nodiscard]] std::size_t line_end() const {
    const std::string_view rest = text_.substr(at_);
    if (rest.front() == '\n' || rest.front() == '\r' || rest.front() == '\v' ||
        rest.front() == '\f')
      return 1;
    if (rest.starts_with("\xC2\x85")) return 2;                                           // U+0085
    return rest.starts_with("\xE2\x80\xA8") || rest.starts_with("\xE2\x80\xA9") ? 3 : 0;  // U+2028
  }

  void end_line(std::size_t bytes) {
    if (text_[at_] == '\n') ++line_;
    at_ += bytes;
    line_begin_ = at_;
    dots_ = 0;
  }

  void skip_comment() {
    while (at_ < text_.size() && line_end() == 0)
      ++at_;
  }

  // Skips to the string's end or the end of its line; skips a long string piece by piece, so that
  // check() sees its lines.
  void skip_string(char quote) {
    const std::string three(3, quote);
    if (text_.substr(at_).starts_with(three)) {
      at_ += three.size();
      skip_long_string(three);
      return;
    }
    ++at_;
    while (at_ < text_.size() && line_end() == 0) {
      const char c = text_[at_++];
      if (c == quote) return;
      if (c == '\\' && quote == '"' && at_ < text_.size() && line_end() == 0) ++at_;
    }
  }

  void skip_long_string(const std::string& three) {
    while (at_ < text_.size()) {
      if (text_.substr(at_).starts_with(three)) {
        at_ += three.size();
        // Up to two more quotes are part of the string.
        for (int more = 0; more < 2 && at_ < text_.size() && text_[at_] == three[0]; ++more)
          ++at_;
        return;
      }
      if (const std::size_t bytes = line_end(); bytes > 0) {
        end_line(bytes);
        continue;
      }
      if (text_[at_] == '\\' && three[0] == '"' && at_ + 1 < text_.size() && text_[at_ + 1] != '\n')
        ++at_;
      ++at_;
    }
  }

  void count(char c) {
    if (c == '.') ++dots_;
    if (c == '[' || c == '{') ++depth_;
    if ((c == ']' || c == '}') && depth_ > 0) --depth_;
    if (c == '=' || c == ',' || c == '[' || c == '{' || c == ']' || c == '}') dots_ = 0;
  }

  std::string_view text_;
  const std::string& file_;
  std::size_t at_ = 0;
  std::size_t line_begin_ = 0;
  unsigned line_ = 1;
  int depth_ = 0;
  int dots_ = 0;
};

}  // namespace

Expected<void> check_toml_shape(std::string_view text, const std::string& file) {
  if (text.size() > kTomlBytesMax) {
    return fail(file, fmt::format("is larger than {} KiB", kTomlBytesMax >> 10U),
                "this is not a file for this program");
  }
  return Shape(text, file).check();
}

}  // namespace vgyro
