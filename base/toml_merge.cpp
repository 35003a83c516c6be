#include "base/toml_merge.h"

#include <sstream>
#include <utility>

#include <fmt/core.h>

namespace vgyro {
namespace {

bool is_tables(const toml::node& node) {
  return node.is_array() && node.as_array()->is_homogeneous(toml::node_type::table);
}

void merge_lists(toml::array& into, toml::array&& later) {
  for (std::size_t i = 0; i < later.size(); ++i) {
    toml::table& table = *later[i].as_table();
    if (i < into.size()) {
      merge_toml(*into[i].as_table(), std::move(table));
    } else {
      into.push_back(std::move(table));
    }
  }
}

// The library's copies lose the place where they were written; moved nodes keep it, and so does the
// key if the old one is removed first.
void put(toml::table& into, const toml::key& key, toml::node& value) {
  into.erase(key.str());
  value.visit([&](auto& concrete) { into.insert(key, std::move(concrete)); });
}

// As people would write it; the library writes a double with all 17 digits.
std::string text_of(const toml::node& node) {
  if (const auto* number = node.as_floating_point()) return fmt::format("{}", number->get());
  std::ostringstream text;
  node.visit([&](const auto& concrete) { text << concrete; });
  return text.str();
}

void add_origins(const toml::table& table, const std::string& prefix,
                 std::vector<TomlOrigin>& origins) {
  for (const auto& [key, node] : table) {
    const std::string name = prefix + std::string(key.str());
    if (const toml::table* inner = node.as_table()) {
      add_origins(*inner, name + '.', origins);
    } else if (is_tables(node)) {
      const toml::array& list = *node.as_array();
      for (std::size_t i = 0; i < list.size(); ++i)
        add_origins(*list[i].as_table(), fmt::format("{}[{}].", name, i), origins);
    } else {
      const toml::source_region& source = key.source();
      const std::string file = source.path ? *source.path : std::string();
      origins.push_back(
          {name, text_of(node), at_line(file, static_cast<unsigned>(source.begin.line))});
    }
  }
}

}  // namespace

void merge_toml(toml::table& into, toml::table&& later) {
  for (auto&& [key, node] : later) {
    toml::node* const before = into.get(key.str());
    if (before != nullptr && before->is_table() && node.is_table()) {
      merge_toml(*before->as_table(), std::move(*node.as_table()));
    } else if (before != nullptr && is_tables(*before) && is_tables(node)) {
      merge_lists(*before->as_array(), std::move(*node.as_array()));
    } else {
      put(into, key, node);
    }
  }
}

std::vector<TomlOrigin> toml_origins(const toml::table& table) {
  std::vector<TomlOrigin> origins;
  add_origins(table, {}, origins);
  return origins;
}

}  // namespace vgyro
