#include "cli/gap/axes.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "model/catalogue.h"

namespace vgyro::cli {

namespace {

using Json = nlohmann::ordered_json;

template <class Judged>
gap::Gap gap_of_all(std::span<const OfAxis<Judged>> axes) {
  double samples = 0.0;
  for (const auto& one : axes)
    samples += static_cast<double>(one.judged.held_out);
  gap::Gap all;
  std::array<double, 2> variance{};
  for (const auto& one : axes) {
    const double share = static_cast<double>(one.judged.held_out) / std::max(1.0, samples);
    const gap::Gap& own = one.judged.gap;
    all.before += share * own.before;
    all.after += share * own.after;
    all.of_model += share * own.of_model;
    for (std::size_t end = 0; end < 2; ++end)
      variance[end] += std::pow(share * own.band95[end], 2);
  }
  all.band95 = {-std::sqrt(variance[0]), std::sqrt(variance[1])};
  return all;
}

gap::Verdict verdict_of_all(std::span<const AxisResult> axes) {
  const auto all_are = [&](auto... verdicts) {
    return std::all_of(axes.begin(), axes.end(), [&](const AxisResult& one) {
      return ((one.judged.verdict == verdicts) || ...);
    });
  };
  using gap::Verdict;
  if (all_are(Verdict::kNoGap)) return Verdict::kNoGap;
  if (all_are(Verdict::kNoGap, Verdict::kExplained)) return Verdict::kExplained;
  if (all_are(Verdict::kNoGap, Verdict::kUnexplained)) return Verdict::kUnexplained;
  return Verdict::kPartlyExplained;
}

void append(Json& list, const Json& more) {
  for (const Json& one : more)
    list.push_back(one);
}

std::string effects_text(const gap::Result& result) {
  std::vector<std::string> names;
  names.reserve(result.effects.size());
  for (const gap::NamedEffect& named : result.effects) {
    names.push_back(fmt::format("{} of gyro {}{}", model::info(named.effect.kind).name,
                                named.effect.gyro + 1, named.applied ? "" : " (not applied)"));
  }
  return names.empty() ? "-" : fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

std::string report_name(const GapSubject& subject) {
  return fmt::format("report-{}.html", subject.axis);
}

Json axes_gap_json(std::span<const AxisResult> axes) {
  const gap::Gap all = gap_of_all(axes);
  gap::Result whole;
  whole.verdict = verdict_of_all(axes);
  whole.gap = all;
  Json json = gap_json(GapSubject{}, whole);
  for (const char* key : {"recording", "notes", "complete", "open", "model", "report"})
    json.erase(key);
  json["axes"] = Json::array();
  bool complete = true;
  for (const AxisResult& axis : axes) {
    Json own = gap_json(axis.subject, axis.judged);
    own["report"] = report_name(axis.subject);
    if (own.contains("starting_model")) append(json["starting_model"], own["starting_model"]);
    for (const char* list : {"effects", "unexplained", "not_identifiable"})
      append(json[list], own[list]);
    complete = complete && own["complete"];
    json["axes"].push_back(std::move(own));
  }
  json["complete"] = complete;
  json["model"] = "model.toml";
  json["report"] = "report.html";
  return json;
}

Json axes_comparison_json(std::span<const AxisComparison> axes) {
  gap::Comparison whole;
  whole.gap = gap_of_all(axes);
  Json json = comparison_json(GapSubject{}, whole);
  for (const char* key : {"recording", "notes"})
    json.erase(key);
  json["axes"] = Json::array();
  for (const AxisComparison& axis : axes) {
    Json own = comparison_json(axis.subject, axis.judged);
    append(json["where"], own["where"]);
    json["axes"].push_back(std::move(own));
  }
  return json;
}

std::string axes_text(std::span<const AxisResult> axes) {
  std::vector<std::vector<std::string>> rows{{"axis", "verdict", "gap before", "after", "found"}};
  for (const auto& [subject, result] : axes) {
    rows.push_back({subject.axis, std::string(gap::verdict_name(result.verdict)),
                    gap_number(result.gap.before), gap_number(result.gap.after),
                    effects_text(result)});
  }
  const gap::Gap all = gap_of_all(axes);
  rows.push_back({"all", std::string(gap::verdict_name(verdict_of_all(axes))),
                  gap_number(all.before), gap_number(all.after), ""});
  return table(rows);
}

std::string axes_text(std::span<const AxisComparison> axes) {
  std::vector<std::vector<std::string>> rows{{"axis", "gap", "95 % of simulations"}};
  const auto add = [&](const std::string& name, const gap::Gap& gap) {
    rows.push_back({name, gap_number(gap.before),
                    fmt::format("{} to {}", gap_number(gap.band95[0]), gap_number(gap.band95[1]))});
  };
  for (const auto& [subject, comparison] : axes)
    add(subject.axis, comparison.gap);
  add("all", gap_of_all(axes));
  return table(rows);
}

}  // namespace vgyro::cli
