#include "cli/page/page.h"

#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <vgyro_pages_text.h>

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

// JSON without "<", so that no HTML parser finds the end of the script in it.
std::string harmless(const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

// Drops the last line, "//# …" or "/*# …", which refers to a file that is not shipped.
std::string_view without_source_map(std::string_view text) {
  const std::size_t at = text.rfind("# sourceMappingURL=");
  return at == std::string_view::npos ? text : text.substr(0, at - 2);
}

// Replaces each "{{name}}" of the template by its text, in which nothing is replaced again.
std::string filled(std::string_view page, const std::map<std::string_view, std::string_view>& by) {
  std::string text;
  while (true) {
    const std::size_t open = page.find("{{");
    if (open == std::string_view::npos) break;
    const std::size_t close = page.find("}}", open);
    text += page.substr(0, open);
    text += by.at(page.substr(open + 2, close - open - 2));
    page.remove_prefix(close + 2);
  }
  text += page;
  return text;
}

}  // namespace

std::string page_of(const PageParts& parts, const Json& data) {
  const std::string harmless_data = harmless(data);
  return filled(pages::shell, {{"title", parts.title},
                               {"noscript", parts.noscript},
                               {"made_by", parts.made_by},
                               {"shell_style", pages::shell_style},
                               {"style", parts.style},
                               {"shell_script", pages::shell_script},
                               {"script", parts.script},
                               {"library", without_source_map(pages::library)},
                               {"library_style", without_source_map(pages::library_style)},
                               {"data", harmless_data}});
}

Json page_number(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  return std::stod(fmt::format("{:.{}g}", value, digits));
}

Json page_numbers(const std::vector<double>& values, int digits) {
  Json json = Json::array();
  for (const double value : values)
    json.push_back(page_number(value, digits));
  return json;
}

}  // namespace vgyro::cli
