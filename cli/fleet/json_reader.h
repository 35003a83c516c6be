#pragma once

// Reads the JSON of an evidence file, which is not trusted: a missing value, or one of another
// form, is a Fault that names the key. simdjson checks a whole document before any of it is used,
// and reads numbers to the nearest double.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <simdjson.h>

namespace vgyro::cli {

/// An error in a file; thrown here, and reported with the file's name and line.
struct Fault {
  std::string what;
  std::string remedy = "a file that vgyro gap --evidence or vgyro fleet wrote";
};

using JsonValue = simdjson::dom::element;

class JsonReader {
 public:
  /// The result is valid until the next call.
  JsonValue parse(std::string_view text);

 private:
  simdjson::dom::parser parser_;
};

std::optional<JsonValue> find_member(JsonValue object, std::string_view key);
JsonValue member(JsonValue object, std::string_view key);
simdjson::dom::array list_of(JsonValue object, std::string_view key);
/// Entry `at` of a list; `key` is the list's.
JsonValue entry(simdjson::dom::array list, std::size_t at, std::string_view key);

/// `key` names the value in the message.
std::string_view text_of(JsonValue value, std::string_view key);
/// A finite number.
double number_of(JsonValue value, std::string_view key);
std::uint64_t count_of(JsonValue value, std::string_view key);

}  // namespace vgyro::cli
