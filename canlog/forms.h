#pragma once

// The table of the forms of a log: how each is known by its first bytes, and who reads it. A form
// that is added is a row. What is known and not read is named, with the way out.

#include <memory>
#include <span>
#include <string_view>

#include "canlog/byte_source.h"
#include "canlog/reader.h"

namespace vgyro::canlog {

/// A form is known by its first bytes, or by one whole line that no other form would have. Exactly
/// one of `begins` and `has_line` is set.
struct Form {
  std::string_view name;  ///< for people; empty where the form is only refused
  /// Of a binary form. Called with every longer beginning of the log until one returns true;
  /// false while there are too few bytes.
  bool (*begins)(std::string_view head);
  /// Of a text form: whether a line (without its end, without a byte-order mark) is certainly of
  /// this form. It is called for every line of the head; the first form to return true gets the
  /// log.
  bool (*has_line)(std::string_view line);
  /// `bytes` begin at the log's first byte. Text forms read them through LogSource; a form that has
  /// to jump about wraps them in seekable().
  Expected<std::unique_ptr<LogReader>> (*open)(std::unique_ptr<ByteSource> bytes);
};

/// In the order in which they are asked.
std::span<const Form> forms();

/// Known and not read.
struct ForeignForm {
  std::string_view what;  ///< "is a ROS bag"
  bool (*begins)(std::string_view head);
  std::string_view remedy;
};
std::span<const ForeignForm> foreign_forms();

}  // namespace vgyro::canlog
