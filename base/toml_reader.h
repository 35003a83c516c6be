#pragma once

// One TOML table, read key by key. Collects every complaint (wrong type, missing key, unknown key
// with the nearest valid name), each with file and line, instead of stopping at the first.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#define TOML_EXCEPTIONS 0
// What its parser asserts, of "[!name]" for one, it then reports as an error of the text as well.
#define TOML_ASSERT static_cast<void>
#include <toml++/toml.h>

#include "base/error.h"

namespace vgyro {

class TomlReader {
 public:
  /// `title` names the table in messages, e.g. "[[gyro]]". Errors go to `errors`.
  TomlReader(const toml::table& table, std::string file, std::string title,
             std::vector<Error>& errors);

  std::optional<std::string> text(std::string_view key);
  std::optional<double> number(std::string_view key);
  std::optional<std::int64_t> integer(std::string_view key);
  std::optional<bool> boolean(std::string_view key);
  const toml::table* table(std::string_view key);
  const toml::array* array(std::string_view key);

  /// Like text(), and a complaint when the key is not there.
  std::string required_text(std::string_view key, std::string_view example);

  [[nodiscard]] bool has(std::string_view key) const { return table_.contains(key); }
  /// "file:line" of the key, or of the table when it is not there.
  [[nodiscard]] std::string where(std::string_view key) const;
  [[nodiscard]] std::string where() const;
  void complain(std::string where, std::string what, std::string remedy = {});

  /// These keys are known, but after other trouble nobody reads them.
  void forgive(std::initializer_list<std::string_view> keys);

  /// Complains of every key that was not asked for.
  void finish();

 private:
  const toml::node* node(std::string_view key, const char* wanted, toml::node_type type);

  const toml::table& table_;
  std::string file_;
  std::string title_;
  std::vector<Error>& errors_;
  std::vector<std::string> asked_;
};

}  // namespace vgyro
