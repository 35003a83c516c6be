#include "cli/gap/report_page.h"

#include <nlohmann/json.hpp>
#include <vgyro_pages_text.h>

#include "cli/page/page.h"
#include "model/catalogue.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

// A screen shows no more, and the page stays small.
constexpr int kDigits = 6;
constexpr int kDigitsOfX = 8;

Json figure_json(const gap::Figure& figure) {
  Json curves = Json::array();
  for (const gap::Curve& curve : figure.curves) {
    Json json{{"label", curve.label},
              {"points", curve.points},
              {"x", page_numbers(curve.x, kDigitsOfX)},
              {"y", page_numbers(curve.y, kDigits)}};
    if (!curve.y_sigma.empty()) json["y_sigma"] = page_numbers(curve.y_sigma, kDigits);
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

std::string gap_page_of(const Json& json) {
  return page_of({.title = "vgyro gap report",
                  .noscript = "This page draws its tables and plots with a script that it holds "
                              "itself; please allow it. gap.json beside it has the same figures.",
                  .made_by = "Made by vgyro gap.",
                  .style = pages::gap_style,
                  .script = pages::gap_script},
                 json);
}

}  // namespace

std::string report_page(const GapSubject& subject, const gap::Result& result,
                        std::span<const AxisResult> axes) {
  return gap_page_of(page_data(subject, result, axes));
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
  return gap_page_of(json);
}

}  // namespace vgyro::cli
