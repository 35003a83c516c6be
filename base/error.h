#pragma once

// Bad input as a value: the place, what is wrong, and the remedy.

#include <cerrno>
#include <string>
#include <utility>

#include <tl/expected.hpp>

namespace vgyro {

struct Error {
  std::string where;   ///< "file:line", a file, an interface; empty if `what` suffices
  std::string what;    ///< one sentence, no full stop
  std::string remedy;  ///< what to do; empty if `what` implies it

  /// "where: what; remedy", as the programs print it: one printable line.
  [[nodiscard]] std::string message() const;
};

template <class T>
using Expected = tl::expected<T, Error>;

inline tl::unexpected<Error> fail(std::string where, std::string what, std::string remedy = {}) {
  return tl::unexpected<Error>(Error{std::move(where), std::move(what), std::move(remedy)});
}

/// The system's text for a failed call; for the last one if no error number is given.
std::string system_reason(int error = errno);

/// "file:line"
std::string at_line(const std::string& file, unsigned line);

}  // namespace vgyro
