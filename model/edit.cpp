#include "model/edit.h"

#include <algorithm>

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

// TOML allows no control character in a comment except the tab.
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

// Empty without any σ; one number if only the parameter of the effect's size has a σ.
std::string sigma_text(const Effect& effect) {
  const std::span<const Parameter> parameters = info(effect.kind).parameters;
  const Parameter* size = size_parameter(effect.kind);
  std::string table;
  std::string alone;
  std::size_t count = 0;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (effect.sigma[i] == 0.0) continue;
    const std::string number = fmt::format("{}", effect.sigma[i]);
    if (&parameters[i] == size) alone = number;
    table += fmt::format("{} {} = {}", count++ == 0 ? "" : ",", parameters[i].name, number);
  }
  if (count == 1 && !alone.empty()) return alone;
  return count == 0 ? std::string() : fmt::format("{{{} }}", table);
}

std::string table_text(const Effect& effect, std::string_view newline) {
  const KindInfo& kind = info(effect.kind);
  std::string text = fmt::format("[[effect]]{0}gyro = {1}{0}kind = \"{2}\"{0}", newline,
                                 effect.gyro + 1, kind.name);
  if (effect.of_axis)
    text += fmt::format("{} = \"{}\"{}", kAxisKey, "xyz"[*effect.of_axis], newline);
  for (std::size_t i = 0; i < kind.parameters.size(); ++i) {
    text += fmt::format("{} = {}{}", key_of(kind.parameters[i], effect.of_axis.has_value()),
                        value_text(kind.parameters[i], effect.parameters[i]), newline);
  }
  if (const std::string sigma = sigma_text(effect); !sigma.empty()) {
    text += fmt::format("sigma = {}{}", sigma, newline);
  }
  if (effect.ambiguous) text += fmt::format("ambiguous = true{}", newline);
  return text;
}

Expected<Model> read(std::string_view text) {
  // An edit has no configuration, so it leaves the gyros' names as they are.
  auto model = parse_model(text, kFile, {.names = {}, .any = true});
  if (!model) return tl::unexpected(model.error().front());
  return *std::move(model);
}

bool same(const Effect& a, const Effect& b) {
  return a.gyro == b.gyro && a.kind == b.kind && a.parameters == b.parameters &&
         a.sigma == b.sigma && a.ambiguous == b.ambiguous && a.of_axis == b.of_axis;
}

// Checks that `text` holds these effects, whatever else it holds.
Expected<std::string> read_back(std::string text, const std::vector<Effect>& wanted) {
  const auto model = read(text);
  if (!model) return tl::unexpected(model.error());
  const bool all =
      std::equal(model->effects.begin(), model->effects.end(), wanted.begin(), wanted.end(), same);
  if (!all) return fail(kFile, "cannot be edited without changing its other effects");
  return text;
}

// A table can follow [[effect]] tables or nothing, but not a closed array.
Expected<void> check_form(std::string_view text) {
  const Expected<toml::table> parsed = parse_toml(text, kFile);
  if (!parsed) return tl::unexpected(parsed.error());
  const toml::array* tables = (*parsed)["effect"].as_array();
  if (tables == nullptr) return {};
  const bool closed = tables->empty() || tables->get(0)->as_table()->is_inline();
  if (!closed) return {};
  return fail(at_line(kFile, static_cast<unsigned>(tables->source().begin.line)),
              "effects in an array, effect = [...], cannot be extended",
              "write each of them as an [[effect]] table");
}

}  // namespace

namespace {

// A whole file to which lines can be added.
std::string begun_file(std::string_view text) {
  const bool blank = text.find_first_not_of(" \t\r\n") == std::string_view::npos;
  std::string result(text);
  if (blank) result += kHead;
  if (!result.ends_with('\n')) result += newline_of(text);
  return result;
}

}  // namespace

Expected<std::string> append_comment(std::string_view text, std::string_view comment) {
  std::string result = begun_file(text);
  const auto before = read(result);
  if (!before) return tl::unexpected(before.error());
  const std::string_view newline = newline_of(text);
  result += newline;
  result += comment_lines(comment, newline);
  return read_back(std::move(result), before->effects);
}

std::string effect_table(const Effect& effect) {
  return table_text(effect, "\n");
}

Expected<std::string> append_effect(std::string_view text, const Effect& effect,
                                    std::string_view comment) {
  std::string result = begun_file(text);
  const auto before = read(result);
  if (!before) return tl::unexpected(before.error());
  if (const auto good = check_form(result); !good) return tl::unexpected(good.error());
  const std::string_view newline = newline_of(text);
  result += newline;
  result += comment_lines(comment, newline);
  result += table_text(effect, newline);
  std::vector<Effect> wanted = before->effects;
  wanted.push_back(effect);
  return read_back(std::move(result), wanted);
}

std::string to_toml(const Model& model) {
  std::string text = fmt::format("{}\n", kHead);
  for (const Effect& effect : model.effects)
    text += "\n" + table_text(effect, "\n");
  return text;
}

}  // namespace vgyro::model
