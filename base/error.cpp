#include "base/error.h"

#include <system_error>

#include <fmt/core.h>

#include "base/printable.h"

namespace vgyro {

std::string Error::message() const {
  std::string text = where.empty() ? what : fmt::format("{}: {}", where, what);
  if (!remedy.empty()) text += "; " + remedy;
  return printable(text);
}

std::string system_reason(int error) {
  return std::system_category().message(error);
}

std::string at_line(const std::string& file, unsigned line) {
  return fmt::format("{}:{}", file, line);
}

}  // namespace vgyro
