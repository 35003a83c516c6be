#include "base/toml_reader.h"

#include <algorithm>
#include <utility>

#include <fmt/core.h>

#include "base/spelling.h"
#include "base/toml_bounds.h"

namespace vgyro {

Expected<toml::table> parse_toml(std::string_view text, const std::string& file,
                                 std::string remedy) {
  if (auto good = check_toml_shape(text, file); !good) return tl::unexpected(good.error());
  toml::parse_result parsed = toml::parse(text, file);
  if (parsed) return std::move(parsed).table();
  const toml::parse_error& error = parsed.error();
  return fail(at_line(file, static_cast<unsigned>(error.source().begin.line)),
              std::string(error.description()), std::move(remedy));
}

TomlReader::TomlReader(const toml::table& table, std::string file, std::string title,
                       std::vector<Error>& errors)
    : table_(table), file_(std::move(file)), title_(std::move(title)), errors_(errors) {}

// If several files make up one table (base/toml_merge.h), each node has the path of its own.
std::string TomlReader::place(const toml::source_region& source) const {
  return at_line(source.path ? *source.path : file_,
                 std::max(1U, static_cast<unsigned>(source.begin.line)));
}

std::string TomlReader::where() const {
  return place(table_.source());
}

std::string TomlReader::where(std::string_view key) const {
  const auto found = table_.find(key);
  if (found == table_.end()) return where();
  return place(found->first.source());
}

void TomlReader::complain(std::string where, std::string what, std::string remedy) {
  errors_.push_back({std::move(where), std::move(what), std::move(remedy)});
}

const toml::node* TomlReader::node(std::string_view key, const char* wanted, toml::node_type type) {
  asked_.emplace_back(key);
  const toml::node* found = table_.get(key);
  if (found == nullptr) return nullptr;
  const bool fits =
      found->type() == type || (type == toml::node_type::floating_point && found->is_integer());
  if (fits) return found;
  complain(where(key), fmt::format("{} {} must be {}", title_, key, wanted));
  return nullptr;
}

std::optional<std::string> TomlReader::text(std::string_view key) {
  const toml::node* found = node(key, "a string in quotes", toml::node_type::string);
  if (found == nullptr) return std::nullopt;
  return found->value<std::string>();
}

std::optional<double> TomlReader::number(std::string_view key) {
  const toml::node* found = node(key, "a number", toml::node_type::floating_point);
  if (found == nullptr) return std::nullopt;
  const auto value = found->value<double>();
  // The library returns nothing for an integer that no double holds; a default would replace it.
  if (!value) {
    complain(where(key), fmt::format("{} {} has more digits than a number can hold", title_, key),
             "at most 15 digits, or an exponent: 9.007e15");
  }
  return value;
}

std::optional<std::int64_t> TomlReader::integer(std::string_view key) {
  const toml::node* found = node(key, "a whole number", toml::node_type::integer);
  if (found == nullptr) return std::nullopt;
  return found->value<std::int64_t>();
}

std::optional<bool> TomlReader::boolean(std::string_view key) {
  const toml::node* found = node(key, "true or false", toml::node_type::boolean);
  if (found == nullptr) return std::nullopt;
  return found->value<bool>();
}

const toml::table* TomlReader::table(std::string_view key) {
  const toml::node* found =
      node(key, fmt::format("a table: [{}]", key).c_str(), toml::node_type::table);
  return found == nullptr ? nullptr : found->as_table();
}

const toml::array* TomlReader::array(std::string_view key, const std::string& shape) {
  const std::string tables = fmt::format("a list of tables: [[{}]]", key);
  const toml::node* found =
      node(key, (shape.empty() ? tables : shape).c_str(), toml::node_type::array);
  return found == nullptr ? nullptr : found->as_array();
}

std::string TomlReader::required_text(std::string_view key, std::string_view example) {
  const auto found = text(key);
  if (found && !found->empty()) return *found;
  if (found || !has(key)) {
    complain(found ? where(key) : where(), fmt::format("{} needs {}", title_, key),
             fmt::format("for example {} = \"{}\"", key, example));
  }
  return {};
}

void TomlReader::forgive(std::initializer_list<std::string_view> keys) {
  for (const std::string_view key : keys)
    asked_.emplace_back(key);
}

void TomlReader::finish() {
  // A wrong file needs one message, not one for each of its keys.
  constexpr std::size_t kUnknownMost = 10;
  std::size_t unknown = 0;
  for (const auto& [key, value] : table_) {
    if (std::find(asked_.begin(), asked_.end(), key.str()) != asked_.end()) continue;
    if (++unknown > kUnknownMost) continue;
    complain(where(key.str()), fmt::format("unknown key \"{}\" in {}", key.str(), title_),
             suggest_name(key.str(), asked_));
  }
  if (unknown <= kUnknownMost) return;
  complain(where(),
           fmt::format("… and {} more unknown keys in {}", unknown - kUnknownMost, title_));
}

}  // namespace vgyro
