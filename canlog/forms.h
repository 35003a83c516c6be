#pragma once

// The table of log forms: how each is recognised by its first bytes, and its reader. A new form is
// a new row. Forms that are recognised but not read are listed with a remedy.

#include <memory>
#include <span>
#include <string_view>

#include "canlog/byte_source.h"
#include "canlog/reader.h"

namespace vgyro::canlog {

/// A form is recognised by its first bytes, or by one whole line that occurs in no other form.
/// Exactly one of `begins` and `has_line` is set.
struct Form {
  std::string_view name;  ///< for people; empty if the form is only refused
  /// For a binary form. Called with ever longer beginnings of the log until one form returns true;
  /// returns false while there are too few bytes.
  bool (*begins)(std::string_view head);
  /// For a text form: whether a line (without its end or a byte-order mark) is certainly of this
  /// form. Called for every line of the head; the first form to return true gets the log.
  bool (*has_line)(std::string_view line);
  /// `bytes` begin at the log's first byte. Text forms read them through LogSource; a form that
  /// needs random access wraps them in seekable().
  Expected<std::unique_ptr<LogReader>> (*open)(std::unique_ptr<ByteSource> bytes);
};

/// In the order in which they are tried.
std::span<const Form> forms();

/// Recognised but not read.
struct ForeignForm {
  std::string_view what;  ///< "is a ROS bag"
  bool (*begins)(std::string_view head);
  std::string_view remedy;
};
std::span<const ForeignForm> foreign_forms();

}  // namespace vgyro::canlog
