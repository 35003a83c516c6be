#include "model/edit.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

#include <fmt/core.h>

#include "base/toml_reader.h"
#include "model/catalogue.h"

namespace vgyro::model {

namespace {

constexpr const char* kFile = "the model file";
constexpr std::string_view kHead = "format = 1";

std::string_view newline_of(std::string_view text) {
  const std::size_t end = text.find('\n');
  return end != std::string_view::npos && end > 0 && text[end - 1] == '\r' ? "\r\n" : "\n";
}

// TOML allows no control character in a comment but the tab.
std::string comment_lines(std::string_view comment, std::string_view newline) {
  std::string lines;
  while (!comment.empty()) {
    const std::size_t end = std::min(comment.find('\n'), comment.size());
    std::string line = fmt::format("# {}", comment.substr(0, end));
    for (char& c : line) {
      const auto code = static_cast<unsigned char>(c);
      if ((code < 0x20 && c != '\t') || code == 0x7F) c = ' ';
    }
    line.erase(line.find_last_not_of(' ') + 1);
    lines += line;
    lines += newline;
    comment.remove_prefix(std::min(end + 1, comment.size()));
  }
  return lines;
}

std::string value_text(const Parameter& parameter, double value) {
  if (parameter.form != Parameter::Form::kAxis) return fmt::format("{}", value);
  return parameter.allows(value) ? fmt::format("\"{}\"", "xyz"[static_cast<std::size_t>(value)])
                                 : "\"\"";
}

std::string table_text(const Effect& effect, std::string_view newline) {
  const KindInfo& kind = info(effect.kind);
  std::string text = fmt::format("[[effect]]{0}gyro = {1}{0}kind = \"{2}\"{0}", newline,
                                 effect.gyro + 1, kind.name);
  for (std::size_t i = 0; i < kind.parameters.size(); ++i) {
    text += fmt::format("{} = {}{}", kind.parameters[i].name,
                        value_text(kind.parameters[i], effect.parameters[i]), newline);
  }
  return text;
}

Expected<Model> read(std::string_view text) {
  auto model = parse_model(text, kFile);
  if (!model) return tl::unexpected(model.error().front());
  return *std::move(model);
}

bool same(const Effect& a, const Effect& b) {
  return a.gyro == b.gyro && a.kind == b.kind && a.parameters == b.parameters;
}

// `text` must hold these effects, whatever else it holds.
Expected<std::string> read_back(std::string text, const std::vector<Effect>& wanted) {
  const auto model = read(text);
  if (!model) return tl::unexpected(model.error());
  const bool all =
      std::equal(model->effects.begin(), model->effects.end(), wanted.begin(), wanted.end(), same);
  if (!all) return fail(kFile, "cannot be edited without changing its other effects");
  return text;
}

// A table can follow [[effect]] tables, or nothing; not a closed array.
Expected<void> check_form(std::string_view text) {
  const Expected<toml::table> parsed = parse_toml(text, kFile);
  if (!parsed) return tl::unexpected(parsed.error());
  const toml::array* tables = (*parsed)["effect"].as_array();
  if (tables == nullptr) return {};
  const bool closed = tables->empty() || tables->get(0)->as_table()->is_inline();
  if (!closed) return {};
  return fail(at_line(kFile, static_cast<unsigned>(tables->source().begin.line)),
              "effects in an array, effect = [...], cannot be added to",
              "write each of them as an [[effect]] table");
}

// Columns count code points.
std::size_t offset_of(std::string_view text, toml::source_position position) {
  std::size_t offset = 0;
  for (unsigned line = 1; line < position.line; ++line)
    offset = text.find('\n', offset) + 1;
  if (position.line == 1 && text.starts_with("\xEF\xBB\xBF")) offset = 3;
  for (unsigned column = 1; column < position.column; ++column) {
    ++offset;
    while (offset < text.size() && (static_cast<unsigned char>(text[offset]) & 0xC0U) == 0x80U)
      ++offset;
  }
  return offset;
}

// The one table that begins on this line; null where there is none, or more than one.
const toml::table* table_on(const toml::table& root, unsigned line) {
  const toml::table* found = nullptr;
  for (const toml::node& node : *root["effect"].as_array()) {
    if (node.source().begin.line != line) continue;
    if (found != nullptr) return nullptr;
    found = node.as_table();
  }
  return found;
}

Expected<std::string> with_value(std::string_view text, unsigned line, std::string_view name,
                                 const std::string& value) {
  const Expected<toml::table> parsed = parse_toml(text, kFile);
  if (!parsed) return tl::unexpected(parsed.error());
  const toml::table* table = table_on(*parsed, line);
  std::string edited(text);
  if (table == nullptr)
    return fail(at_line(kFile, line), "holds several effects", "one table a line is needed");
  if (const toml::node* node = table->get(name)) {
    const std::size_t begin = offset_of(text, node->source().begin);
    const std::size_t end = offset_of(text, node->source().end);
    return edited.replace(begin, end - begin, value);
  }
  if (table->is_inline()) {
    return fail(at_line(kFile, line), fmt::format("{} cannot be added to an inline table", name),
                "write the effect as an [[effect]] table");
  }
  const std::string_view newline = newline_of(text);
  const std::size_t head_end = text.find('\n', offset_of(text, table->source().begin));
  // The table holds gyro and kind, so its first line ends.
  assert(head_end != std::string_view::npos);
  return edited.insert(head_end + 1, fmt::format("{} = {}{}", name, value, newline));
}

}  // namespace

Expected<std::string> append_effect(std::string_view text, const Effect& effect,
                                    std::string_view comment) {
  const bool blank = text.find_first_not_of(" \t\r\n") == std::string_view::npos;
  std::string result(text);
  if (blank) result += kHead;
  const auto before = read(result);
  if (!before) return tl::unexpected(before.error());
  if (const auto good = check_form(result); !good) return tl::unexpected(good.error());
  const std::string_view newline = newline_of(text);
  if (!result.ends_with('\n')) result += newline;
  result += newline;
  result += comment_lines(comment, newline);
  result += table_text(effect, newline);
  std::vector<Effect> wanted = before->effects;
  wanted.push_back(effect);
  return read_back(std::move(result), wanted);
}

Expected<std::string> replace_parameter(std::string_view text, unsigned line_of_table,
                                        std::string_view name, double value) {
  auto model = read(text);
  if (!model) return tl::unexpected(model.error());
  const auto effect = std::find_if(model->effects.begin(), model->effects.end(),
                                   [&](const Effect& e) { return e.line == line_of_table; });
  if (effect == model->effects.end())
    return fail(at_line(kFile, line_of_table), "no effect begins here");
  const std::span<const Parameter> parameters = info(effect->kind).parameters;
  const auto parameter = std::find_if(parameters.begin(), parameters.end(),
                                      [&](const Parameter& p) { return p.name == name; });
  if (parameter == parameters.end()) {
    return fail(at_line(kFile, line_of_table),
                fmt::format("{} has no parameter {}", info(effect->kind).name, name));
  }
  auto edited = with_value(text, line_of_table, name, value_text(*parameter, value));
  if (!edited) return edited;
  effect->parameters[static_cast<std::size_t>(parameter - parameters.begin())] = value;
  return read_back(*std::move(edited), model->effects);
}

std::string to_toml(const Model& model) {
  std::string text = fmt::format("{}\n", kHead);
  for (const Effect& effect : model.effects)
    text += "\n" + table_text(effect, "\n");
  return text;
}

}  // namespace vgyro::model
