#include "cli/gap/report_page.h"

#include <cmath>
#include <map>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <vgyro_report_text.h>

#include "model/catalogue.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

// A screen shows no more, and the page stays small.
constexpr int kDigits = 6;
constexpr int kDigitsOfX = 8;

Json number(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  return std::stod(fmt::format("{:.{}g}", value, digits));
}

Json numbers(const std::vector<double>& values, int digits) {
  Json json = Json::array();
  for (const double value : values)
    json.push_back(number(value, digits));
  return json;
}

Json figure_json(const gap::Figure& figure) {
  Json curves = Json::array();
  for (const gap::Curve& curve : figure.curves) {
    Json json{{"label", curve.label},
              {"points", curve.points},
              {"x", numbers(curve.x, kDigitsOfX)},
              {"y", numbers(curve.y, kDigits)}};
    if (!curve.y_sigma.empty()) json["y_sigma"] = numbers(curve.y_sigma, kDigits);
    curves.push_back(std::move(json));
  }
  return {{"title", figure.title}, {"x_label", figure.x_label}, {"y_label", figure.y_label},
          {"log_x", figure.log_x}, {"log_y", figure.log_y},     {"curves", std::move(curves)}};
}

void add_subject(Json& json, const GapSubject& subject) {
  json["config"] = subject.config;
  json["log"] = subject.log;
  json["model"] = subject.model;
  json["gyros"] = subject.gyros;
  json["provenance"] = provenance_json(subject.provenance);
}

Json page_data(const GapSubject& subject, const gap::Result& result,
               std::span<const AxisResult> axes) {
  Json json = gap_json(subject, result);
  add_subject(json, subject);
  for (const AxisResult& axis : axes)
    json["pages"].push_back({{"axis", axis.subject.axis}, {"file", report_name(axis.subject)}});
  json["verdict_text"] = verdict_text(result);
  for (std::size_t i = 0; i < result.effects.size(); ++i) {
    const gap::NamedEffect& named = result.effects[i];
    Json& effect = json["effects"][i];
    effect["value"] = value_text(named);
    effect["meaning"] = std::string(model::info(named.effect.kind).meaning);
    effect["figure"] = figure_json(named.figure);
  }
  json["not_told"] = Json::array();
  for (const NotTold& line : not_told(subject, result)) {
    json["not_told"].push_back(
        {{"who", line.who}, {"why", line.why}, {"experiment", line.experiment}});
  }
  json["figures"] = Json::array();
  for (const gap::GyroFigures& gyro : result.figures) {
    json["figures"].push_back({{"time", figure_json(gyro.time)},
                               {"spectrum", figure_json(gyro.spectrum)},
                               {"allan", figure_json(gyro.allan)}});
  }
  return json;
}

// JSON that no HTML parser takes for the end of its script.
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

// The last line, "//# …" or "/*# …", points at a file beside the library that is not there.
std::string_view without_source_map(std::string_view text) {
  const std::size_t at = text.rfind("# sourceMappingURL=");
  return at == std::string_view::npos ? text : text.substr(0, at - 2);
}

// Each "{{name}}" of the template for its text; what is put in is not looked at again.
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

std::string page_of(const Json& json) {
  const std::string data = harmless(json);
  return filled(report::page, {{"style", report::style},
                               {"script", report::script},
                               {"library", without_source_map(report::library)},
                               {"library_style", without_source_map(report::library_style)},
                               {"data", data}});
}

}  // namespace

std::string report_page(const GapSubject& subject, const gap::Result& result,
                        std::span<const AxisResult> axes) {
  return page_of(page_data(subject, result, axes));
}

std::string overview_page(std::span<const AxisResult> axes) {
  Json json = axes_gap_json(axes);
  add_subject(json, axes.front().subject);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Json& axis = json["axes"][i];
    axis["verdict_text"] = verdict_text(axes[i].judged);
    for (std::size_t k = 0; k < axes[i].judged.effects.size(); ++k)
      axis["effects"][k]["value"] = value_text(axes[i].judged.effects[k]);
  }
  return page_of(json);
}

}  // namespace vgyro::cli
