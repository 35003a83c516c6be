#include "base/printable.h"

#include <cstdint>

#include <fmt/core.h>

namespace vgyro {

namespace {

constexpr std::uint32_t kDelete = 0x7F;
constexpr std::uint32_t kC1First = 0x80;  // ISO 6429: 8-bit controls
constexpr std::uint32_t kC1Last = 0x9F;

struct Letter {
  std::size_t bytes = 0;  ///< 0: no UTF-8 begins here
  std::uint32_t code = 0;
};

// RFC 3629; overlong forms, surrogates and code points above U+10FFFF are invalid.
Letter letter_at(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const std::uint32_t lead = byte(0);
  if (lead < 0x80) return {1, lead};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < bytes) return {};
  std::uint32_t code = lead & (0x7FU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xC0U) != 0x80U) return {};
    code = code << 6U | (byte(i) & 0x3FU);
  }
  constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  if (code < kLeast[bytes] || surrogate || code > 0x10FFFF) return {};
  return {bytes, code};
}

bool is_control(std::uint32_t code) {
  return code < ' ' || code == kDelete || (code >= kC1First && code <= kC1Last);
}

std::string escaped(std::string_view text, bool keep_newlines) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const Letter letter = letter_at(text);
    const std::string_view raw = text.substr(0, letter.bytes == 0 ? 1 : letter.bytes);
    const bool newline = keep_newlines && letter.code == '\n';
    if (letter.bytes > 0 && (newline || !is_control(letter.code))) {
      result += raw;
    } else {
      for (const char c : raw)
        result += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
    text.remove_prefix(raw.size());
  }
  return result;
}

}  // namespace

std::string printable(std::string_view text) {
  return escaped(text, false);
}

std::string printable_lines(std::string_view text) {
  return escaped(text, true);
}

}  // namespace vgyro
