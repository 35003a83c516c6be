#include "cli/gap/report.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "model/catalogue.h"
#include "model/file.h"

namespace vgyro::cli {

namespace {

// What simulations of the final model score: gaps are counted from there.
constexpr double kFloor = 0.0;

using Json = nlohmann::ordered_json;
using model::Parameter;

constexpr int kFormat = 1;
constexpr std::string_view kUnit = "nats_per_sample";

// Rounding then moves a value by less than a two-hundredth of its σ.
constexpr int kDigitsOfSigma = 3;
constexpr int kDigitsMost = 12;
constexpr int kDigitsOfReading = 4;

int decade(double value) {
  return static_cast<int>(std::floor(std::log10(std::abs(value))));
}

int digits_for(double value, double sigma, int digits_of_sigma) {
  if (value == 0.0 || !std::isfinite(value)) return digits_of_sigma;
  return std::clamp(decade(value) - decade(sigma) + digits_of_sigma, digits_of_sigma, kDigitsMost);
}

bool estimated(double sigma) {
  return std::isfinite(sigma) && sigma > 0.0;
}

// Through decimal digits: what is printed is what is meant.
double with_digits(double value, int digits) {
  return std::stod(fmt::format("{:.{}g}", value, digits));
}

double rounded(const Parameter& parameter, double value, double sigma) {
  if (parameter.form != Parameter::Form::kNumber || !estimated(sigma)) return value;
  const double result = with_digits(value, digits_for(value, sigma, kDigitsOfSigma));
  return parameter.allows(result) ? result : value;
}

void round_parameters(model::Kind kind, const model::Parameters& sigma, model::Parameters& values) {
  const auto parameters = model::info(kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i)
    values[i] = rounded(parameters[i], values[i], sigma[i]);
}

// Of another kind nobody has asked how sure it would be.
void round_reading(const gap::NamedEffect& named, gap::Reading& reading) {
  if (reading.kind == named.effect.kind) {
    round_parameters(reading.kind, named.sigma, reading.parameters);
    return;
  }
  const auto parameters = model::info(reading.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].form != Parameter::Form::kNumber) continue;
    const double value = with_digits(reading.parameters[i], kDigitsOfReading);
    if (parameters[i].allows(value)) reading.parameters[i] = value;
  }
}

bool same(const model::Effect& a, const model::Effect& b) {
  return a.gyro == b.gyro && a.kind == b.kind && a.parameters == b.parameters;
}

// --- JSON ----------------------------------------------------------------------------------------

Json gyro_number(std::size_t gyro) {
  return gyro + 1;
}

Json kind_name(model::Kind kind) {
  return std::string(model::info(kind).name);
}

Json parameter_json(const Parameter& parameter, double value) {
  if (parameter.form == Parameter::Form::kAxis) {
    return std::string(1, "xyz"[static_cast<std::size_t>(value)]);
  }
  if (parameter.form == Parameter::Form::kWhole) return static_cast<std::int64_t>(value);
  return value;
}

void add_where(Json& json, const gap::Where& where) {
  json["from_s"] = where.from_s;
  json["to_s"] = where.to_s;
  json["band_hz"] = {where.low_hz, where.high_hz};
}

// As the model file calls them.
Json parameters_json(model::Kind kind, const model::Parameters& parameters, bool has_axis) {
  Json json = Json::object();
  const auto rows = model::info(kind).parameters;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string key(model::key_of(rows[i], has_axis));
    json[key] = parameter_json(rows[i], parameters[i]);
  }
  return json;
}

// Beside "gyro", of a unit: which of its own axes; nothing where it is all of them.
void add_axis(Json& json, const GapSubject& subject, model::Kind kind, std::size_t gyro) {
  if (const auto axis = subject.axis_of(kind, gyro)) json["axis"] = std::string(1, "xyz"[*axis]);
}

Json kind_json(const GapSubject& subject, model::Kind kind, std::size_t gyro) {
  Json json{{"kind", kind_name(kind)}, {"gyro", gyro_number(gyro)}};
  add_axis(json, subject, kind, gyro);
  return json;
}

Json reading_json(const GapSubject& subject, const gap::Reading& reading) {
  Json json = kind_json(subject, reading.kind, reading.gyro);
  if (reading.is_fitted()) {
    json["parameters"] = parameters_json(reading.kind, reading.parameters, json.contains("axis"));
  }
  return json;
}

Json effect_json(const GapSubject& subject, const gap::NamedEffect& named) {
  Json json = kind_json(subject, named.effect.kind, named.effect.gyro);
  json["parameters"] =
      parameters_json(named.effect.kind, named.effect.parameters, json.contains("axis"));
  Json sigma = Json::object();
  const auto parameters = model::info(named.effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (estimated(named.sigma[i])) sigma[std::string(parameters[i].name)] = named.sigma[i];
  }
  Json where = Json::object();
  add_where(where, named.where);
  Json ambiguous = Json::array();
  for (const gap::Reading& reading : named.ambiguous_with)
    ambiguous.push_back(reading_json(subject, reading));
  json["sigma"] = sigma;
  json["p_value"] = named.p_value;
  json["statistic"] = named.statistic;
  json["gap_before"] = named.gap_before;
  json["gap_after"] = named.gap_after;
  json["where"] = where;
  json["ambiguous_with"] = ambiguous;
  json["applied"] = named.applied;
  json["checked"] = named.checked;
  json["evidence"] = named.evidence;
  json["experiment"] = named.experiment;
  return json;
}

Json unexplained_json(const GapSubject& subject, const gap::Unexplained& rest) {
  Json json{{"signature", rest.signature}, {"gyro", nullptr}};
  if (rest.gyro) {
    json["gyro"] = gyro_number(*rest.gyro);
    add_axis(json, subject, model::Kind::kBias, *rest.gyro);
  }
  if (rest.frequency_hz) json["frequency_hz"] = *rest.frequency_hz;
  if (rest.amplitude_dps) json["amplitude_dps"] = *rest.amplitude_dps;
  json["from_s"] = rest.from_s;
  json["to_s"] = rest.to_s;
  json["text"] = rest.text;
  return json;
}

template <class Judged>
Json recording_json(const Judged& judged) {
  Json json{{"seconds", judged.seconds},
            {"samples", {judged.samples[0], judged.samples[1]}},
            {"with_reference", judged.with_reference}};
  // Times of a result are of all recordings behind each other.
  if (judged.drives.empty()) return json;
  json["parts"] = Json::array();
  for (const gap::Span& drive : judged.drives)
    json["parts"].push_back({{"from_s", drive.from_s}, {"to_s", drive.to_s}});
  return json;
}

// --- text ----------------------------------------------------------------------------------------

std::string rounded_text(double value, double sigma) {
  return fmt::format("{:.{}g} ± {:.2g}", value, digits_for(value, sigma, 2), sigma);
}

std::string reading_text(const GapSubject& subject, const gap::Reading& reading) {
  return fmt::format("{} {}", subject.gyros[reading.gyro], model::info(reading.kind).name);
}

template <class Judged>
std::string subject_text(const GapSubject& subject, const Judged& judged) {
  std::string text =
      fmt::format("{}{}: {:.1f} s, {} samples of {}, {} of {}, {} reference\n",
                  subject.axis.empty() ? "" : fmt::format("Axis {}: ", subject.axis), subject.log,
                  judged.seconds, judged.samples[0], subject.gyros[0], judged.samples[1],
                  subject.gyros[1], judged.with_reference ? "with a" : "no");
  for (std::size_t i = 0; i < judged.drives.size(); ++i) {
    text += fmt::format("  recording {} from {:.0f} to {:.0f} s\n", i + 1, judged.drives[i].from_s,
                        judged.drives[i].to_s);
  }
  return text;
}

std::string floor_text(const gap::Gap& gap) {
  return fmt::format("floor {} (95 % of simulations: {} to {})", gap_number(kFloor),
                     gap_number(gap.band95[0]), gap_number(gap.band95[1]));
}

using Rows = std::vector<std::vector<std::string>>;

std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
}

std::string starting_text(const GapSubject& subject, const gap::Result& result) {
  Rows rows;
  for (const gap::NamedEffect& one : result.starting)
    rows.push_back({subject.gyros[one.effect.gyro], std::string(model::info(one.effect.kind).name),
                    value_text(one)});
  return "starting model, for the given one says neither bias nor noise:\n" + table(rows);
}

std::string drop_table(const GapSubject& subject, const gap::Result& result) {
  Rows rows{{"round", "gap before", "after", "gyro", "effect", "value ± σ", "in model.toml",
             "may also be"}};
  for (std::size_t i = 0; i < result.effects.size(); ++i) {
    const gap::NamedEffect& named = result.effects[i];
    std::string also;
    for (const gap::Reading& reading : named.ambiguous_with)
      also += (also.empty() ? "" : ", ") + reading_text(subject, reading);
    rows.push_back({std::to_string(i + 1), gap_number(named.gap_before),
                    gap_number(named.gap_after), subject.gyros[named.effect.gyro],
                    std::string(model::info(named.effect.kind).name), value_text(named),
                    named.applied ? "yes" : "no", also.empty() ? "-" : also});
  }
  return table(rows);
}

std::string experiments(const gap::Result& result) {
  std::string text;
  for (std::size_t i = 0; i < result.effects.size(); ++i) {
    const gap::NamedEffect& named = result.effects[i];
    if (named.ambiguous_with.empty() || named.experiment.empty()) continue;
    fmt::format_to(std::back_inserter(text), "  to tell what round {} is: {}\n", i + 1,
                   named.experiment);
  }
  return text;
}

std::string where_text(const gap::Where& where) {
  return fmt::format("{:.0f} to {:.0f} s", where.from_s, where.to_s);
}

std::string notes_text(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes)
    text += "note: " + note + "\n";
  return text;
}

void add_once(std::vector<std::string>& list, const std::string& text) {
  if (std::find(list.begin(), list.end(), text) == list.end()) list.push_back(text);
}

}  // namespace

std::optional<std::size_t> GapSubject::axis_of(model::Kind kind, std::size_t gyro) const {
  if (axis.empty() || model::acts_on_unit(kind)) return std::nullopt;
  return sensor_axis[gyro];
}

std::string gap_number(double nats) {
  return fmt::format("{:.4g}", std::abs(nats) < 5e-7 ? 0.0 : nats);
}

std::string table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i)
      widths[i] = std::max(widths[i], width_of(row[i]));
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line = "  ";
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += row[i];
      line.append(widths[i] - width_of(row[i]) + 2, ' ');
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

void round_to_sigma(gap::Result& result) {
  for (auto* list : {&result.starting, &result.effects}) {
    for (gap::NamedEffect& named : *list) {
      const model::Effect exact = named.effect;
      for (gap::Reading& reading : named.ambiguous_with)
        round_reading(named, reading);
      round_parameters(named.effect.kind, named.sigma, named.effect.parameters);
      for (double& sigma : named.sigma) {
        if (estimated(sigma)) sigma = with_digits(sigma, kDigitsOfSigma);
      }
      for (model::Effect& effect : result.model.effects) {
        if (same(effect, exact)) effect.parameters = named.effect.parameters;
      }
    }
  }
}

Json gap_json(const GapSubject& subject, const gap::Result& result) {
  Json json{{"format", kFormat}};
  if (!subject.axis.empty()) json["axis"] = subject.axis;
  json["verdict"] = std::string(gap::verdict_name(result.verdict));
  json["gap"] = {{"unit", kUnit},
                 {"before", result.gap.before},
                 {"after", result.gap.after},
                 {"floor", kFloor},
                 {"band95", {result.gap.band95[0], result.gap.band95[1]}},
                 {"of_model", result.gap.of_model}};
  if (!result.starting.empty()) {
    json["starting_model"] = Json::array();
    for (const gap::NamedEffect& one : result.starting) {
      Json fitted = effect_json(subject, one);
      for (const char* key : {"p_value", "statistic", "gap_before", "gap_after", "where",
                              "ambiguous_with", "applied", "checked", "evidence", "experiment"})
        fitted.erase(key);
      json["starting_model"].push_back(std::move(fitted));
    }
  }
  json["effects"] = Json::array();
  for (const gap::NamedEffect& named : result.effects)
    json["effects"].push_back(effect_json(subject, named));
  json["unexplained"] = Json::array();
  for (const gap::Unexplained& rest : result.unexplained)
    json["unexplained"].push_back(unexplained_json(subject, rest));
  json["not_identifiable"] = Json::array();
  for (const gap::NotIdentifiable& kind : result.not_identifiable) {
    Json one = kind_json(subject, kind.kind, kind.gyro);
    one["why"] = kind.why;
    one["experiment"] = kind.experiment;
    json["not_identifiable"].push_back(std::move(one));
  }
  json["recording"] = recording_json(result);
  json["recording"]["held_out"] = result.held_out;
  json["notes"] = result.notes;
  for (const std::string& text : {not_applied_text(result), open_text(result)}) {
    if (!text.empty()) json["notes"].push_back(text);
  }
  json["complete"] = result.open.empty();
  json["open"] = result.open;
  json["model"] = "model.toml";
  json["report"] = "report.html";
  return json;
}

Json comparison_json(const GapSubject& subject, const gap::Comparison& comparison) {
  Json json{{"format", kFormat}};
  if (!subject.axis.empty()) json["axis"] = subject.axis;
  json["gap"] = {{"unit", kUnit},
                 {"value", comparison.gap.before},
                 {"floor", kFloor},
                 {"band95", {comparison.gap.band95[0], comparison.gap.band95[1]}}};
  json["where"] = Json::array();
  for (const gap::Difference& difference : comparison.differences) {
    Json where{{"gyro", gyro_number(difference.gyro)}};
    add_axis(where, subject, model::Kind::kBias, difference.gyro);
    add_where(where, difference.where);
    where["against"] = difference.against;
    where["nats"] = difference.nats;
    where["text"] = difference.text;
    json["where"].push_back(where);
  }
  json["recording"] = recording_json(comparison);
  json["notes"] = comparison.notes;
  return json;
}

std::string value_text(const gap::NamedEffect& named) {
  const auto parameters = model::info(named.effect.kind).parameters;
  std::string text;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double value = named.effect.parameters[i];
    text += fmt::format("{}{} ", text.empty() ? "" : ", ",
                        model::key_of(parameters[i], named.effect.of_axis.has_value()));
    if (parameters[i].form == Parameter::Form::kAxis) {
      text += "xyz"[static_cast<std::size_t>(value)];
    } else if (estimated(named.sigma[i])) {
      text += rounded_text(value, named.sigma[i]);
    } else {
      text += fmt::format("{:g}", value);
    }
  }
  return text;
}

std::vector<NotTold> not_told(const GapSubject& subject, const gap::Result& result) {
  struct Group {
    std::vector<std::string> gyros;
    std::vector<std::string> kinds;
    std::string why;
    std::string experiment;
  };
  std::vector<Group> groups;
  for (const gap::NotIdentifiable& kind : result.not_identifiable) {
    auto group = std::find_if(groups.begin(), groups.end(), [&](const Group& other) {
      return other.why == kind.why && other.experiment == kind.experiment;
    });
    if (group == groups.end()) {
      group = groups.insert(groups.end(), Group{{}, {}, kind.why, kind.experiment});
    }
    add_once(group->gyros, subject.gyros[kind.gyro]);
    add_once(group->kinds, std::string(model::info(kind.kind).name));
  }
  std::vector<NotTold> result_lines;
  result_lines.reserve(groups.size());
  for (const Group& group : groups) {
    result_lines.push_back(
        {fmt::format("{}: {}", fmt::join(group.gyros, ", "), fmt::join(group.kinds, ", ")),
         group.why, group.experiment});
  }
  return result_lines;
}

std::string verdict_text(const gap::Result& result) {
  const std::size_t count = result.effects.size();
  const std::string effects = count == 1 ? "one effect" : fmt::format("{} effects", count);
  switch (result.verdict) {
    case gap::Verdict::kNoGap:
      return "No gap: the model predicts this recording as well as it predicts its own simulations";
    case gap::Verdict::kExplained:
      return fmt::format(
          "Explained: with {} more, the model predicts this recording as well as "
          "its own simulations",
          effects);
    case gap::Verdict::kPartlyExplained:
      return fmt::format("Partly explained: {} named; something remains", effects);
    case gap::Verdict::kUnexplained:
      break;
  }
  return "Unexplained: simulation and measurement differ, and no known effect accounts for it";
}

std::string open_text(const gap::Result& result) {
  if (result.open.empty()) return {};
  return fmt::format("the time limit was reached; open is {}", fmt::join(result.open, ", and "));
}

std::string not_applied_text(const gap::Result& result) {
  const auto count_of = [&](bool checked) {
    return std::count_if(result.effects.begin(), result.effects.end(),
                         [&](const auto& one) { return !one.applied && one.checked == checked; });
  };
  const auto ambiguous = count_of(true);
  const auto unchecked = count_of(false);
  if (ambiguous + unchecked == 0) return {};
  std::vector<std::string> why;
  if (ambiguous > 0) why.push_back(fmt::format("{} ambiguous", ambiguous));
  if (unchecked > 0) why.push_back(fmt::format("{} not checked for lack of time", unchecked));
  std::string text = fmt::format(
      "effects that are not applied: {}; the gap after counts them, model.toml holds them as "
      "comments only and leaves a gap of {}",
      fmt::join(why, ", "), gap_number(result.gap.of_model));
  if (ambiguous > 0) {
    text += "; --accept gyro=1 or gyro=2 writes the reading that you know to be right";
  }
  return text;
}

std::string gap_text(const GapSubject& subject, const gap::Result& result) {
  std::string text = subject_text(subject, result);
  text += verdict_text(result) + ".\n";
  text += fmt::format("gap {} -> {} nats per sample on {} samples that took no part; {}\n",
                      gap_number(result.gap.before), gap_number(result.gap.after), result.held_out,
                      floor_text(result.gap));
  if (!result.starting.empty()) text += starting_text(subject, result);
  if (!result.effects.empty()) text += drop_table(subject, result) + experiments(result);
  for (const gap::Unexplained& rest : result.unexplained)
    text += fmt::format("unexplained: {}: {}\n",
                        rest.gyro ? subject.gyros[*rest.gyro] : "the reference", rest.text);
  for (const NotTold& line : not_told(subject, result)) {
    text += fmt::format("not identifiable: {}: {}{}{}\n", line.who, line.why,
                        line.experiment.empty() ? "" : "; ", line.experiment);
  }
  std::vector<std::string> notes = result.notes;
  for (const std::string& note : {not_applied_text(result), open_text(result)}) {
    if (!note.empty()) notes.push_back(note);
  }
  return text + notes_text(notes);
}

std::string comparison_text(const GapSubject& subject, const gap::Comparison& comparison) {
  const gap::Gap& gap = comparison.gap;
  std::string text = subject_text(subject, comparison);
  const bool inside = gap.before <= gap.band95[1];
  text += fmt::format("gap {} nats per sample, {} what the model's own simulations score; {}\n",
                      gap_number(gap.before), inside ? "within" : "above", floor_text(gap));
  if (comparison.differences.empty() && inside) {
    text += "They differ nowhere by more than chance.\n";
  }
  if (!comparison.differences.empty()) {
    Rows rows{{"gyro", "against", "when", "band, Hz", "nats", "what"}};
    for (const gap::Difference& difference : comparison.differences) {
      rows.push_back(
          {subject.gyros[difference.gyro], difference.against, where_text(difference.where),
           fmt::format("{:.3g} to {:.3g}", difference.where.low_hz, difference.where.high_hz),
           fmt::format("{:.4g}", difference.nats), difference.text});
    }
    text += table(rows);
  }
  return text + notes_text(comparison.notes);
}

}  // namespace vgyro::cli
