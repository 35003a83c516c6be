#include "cli/fleet/json_reader.h"

#include <cmath>

#include <fmt/format.h>

namespace vgyro::cli {

namespace {

template <class Value>
Value value_of(JsonValue json, std::string_view key, const char* form) {
  Value value{};
  if (json.get(value) != simdjson::SUCCESS) throw Fault{fmt::format("\"{}\" is not {}", key, form)};
  return value;
}

}  // namespace

JsonValue JsonReader::parse(std::string_view text) {
  JsonValue json;
  // The parser reads some bytes beyond the end, so it takes a copy.
  constexpr bool kCopy = true;
  if (const auto error = parser_.parse(text.data(), text.size(), kCopy).get(json))
    throw Fault{fmt::format("not a line of JSON: {}", simdjson::error_message(error))};
  return json;
}

std::optional<JsonValue> find_member(JsonValue object, std::string_view key) {
  JsonValue found;
  if (object.at_key(key).get(found) != simdjson::SUCCESS) return std::nullopt;
  return found;
}

JsonValue member(JsonValue object, std::string_view key) {
  const auto found = find_member(object, key);
  if (!found) throw Fault{fmt::format("\"{}\" is missing", key)};
  return *found;
}

simdjson::dom::array list_of(JsonValue object, std::string_view key) {
  return value_of<simdjson::dom::array>(member(object, key), key, "a list");
}

JsonValue entry(simdjson::dom::array list, std::size_t at, std::string_view key) {
  JsonValue found;
  if (list.at(at).get(found) != simdjson::SUCCESS)
    throw Fault{fmt::format("\"{}\" has fewer than {} entries", key, at + 1)};
  return found;
}

std::string_view text_of(JsonValue value, std::string_view key) {
  return value_of<std::string_view>(value, key, "a text");
}

double number_of(JsonValue value, std::string_view key) {
  const auto number = value_of<double>(value, key, "a number");
  if (!std::isfinite(number)) throw Fault{fmt::format("\"{}\" is not finite", key)};
  return number;
}

std::uint64_t count_of(JsonValue value, std::string_view key) {
  return value_of<std::uint64_t>(value, key, "a count");
}

}  // namespace vgyro::cli
