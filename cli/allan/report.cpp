#include "cli/allan/report.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "model/file.h"

namespace vgyro::cli {

namespace {

using analysis::Estimate;
using analysis::NoiseFit;
using analysis::SeriesNoise;

constexpr double kSecondsPerHour = 3600.0;
constexpr double kPerRootHour = 60.0;  ///< deg/s/√Hz → deg/√h
constexpr double kFewFilled = 0.02;

struct Quantity {
  const char* name;
  const char* unit;
  const Estimate NoiseFit::*of;
  double scale;
};
constexpr std::array<Quantity, 5> kQuantities{{
    {"N  angle random walk", "deg/s/√Hz", &NoiseFit::white_dps_rthz, 1.0},
    {"", "deg/√h", &NoiseFit::white_dps_rthz, kPerRootHour},
    {"B  bias instability", "deg/h", &NoiseFit::flicker_dps, kSecondsPerHour},
    {"K  rate random walk", "deg/s/√s", &NoiseFit::walk_dps_rts, 1.0},
    {"Q  quantisation", "deg", &NoiseFit::quantisation_deg, 1.0},
}};

std::string number(double value) {
  return fmt::format("{:.3g}", value);
}

std::string estimate_text(const Estimate& estimate, double scale) {
  if (estimate.resolved) {
    return fmt::format("{} ± {:.1g}", number(scale * estimate.value), scale * estimate.sigma);
  }
  return estimate.below > 0.0 ? "not resolved, < " + fmt::format("{:.2g}", scale * estimate.below)
                              : "-";
}

// Columns are padded to their visible width, because fmt counts code points.
void row(std::string& text, const std::string& name, const std::string& unit,
         const std::array<std::string, 3>& cells) {
  fmt::format_to(std::back_inserter(text), "{:<23}{:<11}", name, unit);
  for (std::size_t i = 0; i < cells.size(); ++i)
    fmt::format_to(std::back_inserter(text), "{:<{}}", cells[i], i + 1 < cells.size() ? 25 : 0);
  text += '\n';
}

std::string ramp_text(const NoiseFit& fit) {
  if (fit.ramp_significance() > analysis::kRampSigmas) {
    return fmt::format("{:+.3g} ± {:.1g}", fit.ramp_dps_s, fit.ramp_sigma_dps_s);
  }
  return fmt::format("none (± {:.1g})", fit.ramp_sigma_dps_s);
}

std::string markov_text(const NoiseFit& fit) {
  if (!fit.markov) return "none";
  return fmt::format("σ {:.3g}, τ about {:.2g}", fit.markov->sigma_dps, fit.markov->tau_s);
}

std::array<const SeriesNoise*, 3> columns(const AllanReport& report) {
  return {&report.noise.gyros[0], &report.noise.gyros[1], &report.noise.difference};
}

std::array<std::string, 3> cells(const AllanReport& report,
                                 const std::function<std::string(const SeriesNoise&)>& cell) {
  std::array<std::string, 3> result;
  const auto of = columns(report);
  for (std::size_t i = 0; i < 3; ++i)
    result[i] = cell(*of[i]);
  return result;
}

std::string table(const AllanReport& report) {
  std::string text;
  row(text, "", "", {"gyro " + report.gyro_names[0], "gyro " + report.gyro_names[1], "difference"});
  row(text, "judged over", "s", cells(report, [](const SeriesNoise& noise) {
        return noise.parts > 1 ? fmt::format("{:.1f} in {} parts", noise.seconds, noise.parts)
                               : fmt::format("{:.1f}", noise.seconds);
      }));
  row(text, "samples", "Hz", cells(report, [](const SeriesNoise& noise) {
        return fmt::format("{:.4g}", 1.0 / noise.interval_s);
      }));
  row(text, "mean", "deg/s", cells(report, [](const SeriesNoise& noise) {
        return fmt::format("{:+.6f}", noise.mean_dps);
      }));
  for (const Quantity& quantity : kQuantities) {
    row(text, quantity.name, quantity.unit, cells(report, [&](const SeriesNoise& noise) {
          return noise.fit ? estimate_text((*noise.fit).*quantity.of, quantity.scale)
                           : std::string("-");
        }));
  }
  row(text, "correlated drift", "deg/s, s", cells(report, [](const SeriesNoise& noise) {
        return noise.fit ? markov_text(*noise.fit) : std::string("-");
      }));
  row(text, "ramp", "deg/s²", cells(report, [](const SeriesNoise& noise) {
        return noise.fit ? ramp_text(*noise.fit) : std::string("-");
      }));
  return text;
}

std::string motion_text(const AllanReport& report) {
  const analysis::MotionSummary& motion = report.noise.motion;
  if (motion.at_rest) return "The platform rested throughout.\n";
  std::string text =
      fmt::format("The platform turned or shook: up to {:.3g} deg/s. ", motion.turned_up_to_dps);
  if (motion.rest) {
    text += fmt::format(
        "Each gyro is judged over its longest rest, {:.0f} s from {:.0f} s on; the difference over "
        "everything.\n",
        motion.rest->seconds(), motion.rest->from_s);
  } else {
    text += fmt::format(
        "There is no rest of {:g} s in it: each gyro's own curve\nholds the motion, no noise is "
        "given for it; only the pair's difference is judged.\n",
        analysis::MotionSummary::kRestMin_s);
  }
  if (const auto& removed = report.noise.removed) {
    text += fmt::format(
        "Removed from the difference by least squares: {:+.3g} of the rate (scale factor), {:+.2g} "
        "ms "
        "of\nlag. What vibration and motion leave beyond that is in the difference's figures.\n",
        removed->scale, 1e3 * removed->lag_s);
  }
  return text;
}

std::string caution(const std::string& name, const SeriesNoise& noise) {
  std::string text;
  const auto to = std::back_inserter(text);
  if (noise.filled_share > kFewFilled) {
    fmt::format_to(to,
                   "{}: {:.1f} % of the places on an even grid had no sample (lost, or very uneven "
                   "stamps) and were filled in.\n",
                   name, 100.0 * noise.filled_share);
  }
  if (!noise.fit) return text;
  const NoiseFit& fit = *noise.fit;
  if (fit.limited) {
    fmt::format_to(
        to,
        "{}: fitted below {:.3g} Hz; above, the spectrum is not that of these noise terms "
        "(a filter in the gyro, or vibration).\n",
        name, fit.frequency_max_hz);
  }
  if (!fit.describes) {
    fmt::format_to(
        to,
        "{}: these noise terms do not describe the record: around {:.2g} Hz it holds {:.2g} "
        "times the power of the fit, and the figures are a rough guide only.\n",
        name, fit.worst_hz, fit.worst_ratio);
  }
  return text;
}

std::string step_caution(const std::string& name, const SeriesNoise& noise, double step_dps) {
  if (!noise.hidden_by_step) return {};
  return fmt::format(
      "{}: its values step by {:.3g} deg/s, and its own noise is at most half of that: the step "
      "hides\nit. White noise has a bound here, no value, and drift within a step does not show. "
      "An "
      "output of finer\nsteps would show more.\n",
      name, step_dps);
}

std::string cautions(const AllanReport& report) {
  std::string text;
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = "gyro " + report.gyro_names[i];
    text += caution(name, report.noise.gyros[i]);
    text += step_caution(name, report.noise.gyros[i], report.noise.step_dps[i]);
  }
  const bool hidden = report.noise.gyros[0].hidden_by_step || report.noise.gyros[1].hidden_by_step;
  if (hidden) {
    text +=
        "difference: holds those steps, too. Its figures, and the window below, are a rough "
        "guide.\n";
  }
  return text + caution("difference", report.noise.difference);
}

std::string correlation_text(const AllanReport& report) {
  if (const auto& rho = report.noise.correlation) {
    return fmt::format("ρ, correlation of the white noises: {:+.3f} ± {:.3f}\n", rho->value,
                       rho->sigma);
  }
  return "ρ, correlation of the white noises: not resolved; this needs a rest in which white noise "
         "is "
         "seen.\n";
}

std::string window_reason(const AllanReport& report) {
  const auto& advice = report.recommendation;
  const NoiseFit& fit = *report.noise.difference.fit;
  std::string text =
      fmt::format("long enough that white noise leaves {:.2g} deg/h, ",
                  kSecondsPerHour * fit.white_dps_rthz.value / std::sqrt(advice.window_s));
  if (advice.drift_known) {
    text += fmt::format("short against the drift: the difference is then predicted to {:.2g} deg/h",
                        kSecondsPerHour * advice.error_dps);
  } else if (fit.flicker_dps.resolved) {
    text += "and the bias instability is the same whatever the window";
  } else {
    text += "and no drift was seen that would ask for a shorter one";
  }
  if (advice.record_limits) text += "; a longer recording might allow a longer window";
  return text;
}

std::string order_reason(const AllanReport& report) {
  const NoiseFit& fit = *report.noise.difference.fit;
  const double sigmas = fit.ramp_significance();
  if (report.recommendation.order == 1) {
    return fmt::format("the difference has a slope of {:+.2g} deg/s², {:.0f} times its error",
                       fit.ramp_dps_s, sigmas);
  }
  if (report.recommendation.ramp_significant) {
    return fmt::format(
        "the slope of {:+.2g} deg/s² is real, but smaller than the error that fitting "
        "it in every window adds",
        fit.ramp_dps_s);
  }
  return fmt::format(
      "no slope is significant ({:.1f} times its error): a fitted one would be noise", sigmas);
}

nlohmann::ordered_json estimate_json(const Estimate& estimate, double scale) {
  if (estimate.resolved) {
    return {
        {"resolved", true}, {"value", scale * estimate.value}, {"sigma", scale * estimate.sigma}};
  }
  return {{"resolved", false}, {"below", scale * estimate.below}};
}

nlohmann::ordered_json fit_json(const NoiseFit& fit) {
  nlohmann::ordered_json json;
  json["white_noise_dps_rthz"] = estimate_json(fit.white_dps_rthz, 1.0);
  json["rate_random_walk_dps_rts"] = estimate_json(fit.walk_dps_rts, 1.0);
  json["bias_instability_dps"] = estimate_json(fit.flicker_dps, 1.0);
  const bool asked = fit.quantisation_deg.resolved || fit.quantisation_deg.below > 0.0;
  json["quantisation_deg"] =
      asked ? estimate_json(fit.quantisation_deg, 1.0) : nlohmann::ordered_json(nullptr);
  json["gauss_markov"] = fit.markov ? nlohmann::ordered_json{{"sigma_dps", fit.markov->sigma_dps},
                                                             {"tau_s", fit.markov->tau_s}}
                                    : nlohmann::ordered_json(nullptr);
  json["ramp_dps_s"] = {{"value", fit.ramp_dps_s}, {"sigma", fit.ramp_sigma_dps_s}};
  json["frequency_max_hz"] = fit.frequency_max_hz;
  json["describes"] = fit.describes;
  json["worst_octave"] = {{"frequency_hz", fit.worst_hz}, {"power_ratio", fit.worst_ratio}};
  return json;
}

nlohmann::ordered_json noise_json(const SeriesNoise& noise) {
  nlohmann::ordered_json json;
  json["seconds"] = noise.seconds;
  json["parts"] = noise.parts;
  json["sample_rate_hz"] = 1.0 / noise.interval_s;
  json["bridged_share"] = noise.filled_share;
  json["mean_dps"] = noise.mean_dps;
  json["hidden_by_step"] = noise.hidden_by_step;
  json["noise"] = noise.fit ? fit_json(*noise.fit) : nlohmann::ordered_json(nullptr);
  json["allan"] = nlohmann::ordered_json::array();
  for (const analysis::AllanPoint& point : noise.allan) {
    json["allan"].push_back({{"tau_s", point.tau_s},
                             {"deviation_dps", point.deviation_dps},
                             {"low_dps", point.low_dps},
                             {"high_dps", point.high_dps},
                             {"freedom", point.freedom}});
  }
  return json;
}

struct Gyro {
  std::size_t number;
  std::optional<std::size_t> axis;  ///< a unit's own axis
};

void effect(std::string& text, const Gyro& gyro, const char* kind, const std::string& parameters) {
  const std::string axis =
      gyro.axis ? fmt::format("{} = \"{}\"\n", model::kAxisKey, "xyz"[*gyro.axis]) : "";
  fmt::format_to(std::back_inserter(text), "[[effect]]\ngyro = {}\nkind = \"{}\"\n{}{}\n",
                 gyro.number, kind, axis, parameters);
}

// Flicker noise as three Gauss–Markov processes a decade apart, around the bottom of the Allan
// curve.
void add_flicker(std::string& text, const Gyro& gyro, const SeriesNoise& noise) {
  const double flicker = noise.fit->flicker_dps.value;
  const double sigma_dps = flicker * std::sqrt(std::numbers::ln10 / std::numbers::pi);
  const double white = noise.fit->white_dps_rthz.value;
  const double walk = noise.fit->walk_dps_rts.value;
  const double longest_s = 0.1 * noise.seconds;
  const double begin_s = std::max(white * white / (flicker * flicker), 10.0 * noise.interval_s);
  const double end_s =
      walk > 0.0 ? std::min(longest_s, flicker * flicker / (walk * walk)) : longest_s;
  const double middle_s = std::sqrt(begin_s * std::max(begin_s, end_s));
  for (const double factor : {0.1, 1.0, 10.0}) {
    effect(text, gyro, "gauss_markov",
           fmt::format("sigma_dps = {:.3e}\ntau_s = {:.3g}\n", sigma_dps, factor * middle_s));
  }
}

}  // namespace

std::string corrector_toml(const AllanReport& report) {
  if (!report.noise.difference.fit) return {};
  return fmt::format("[corrector]\nwindow_s = {:.1f}\norder = {}\n", report.recommendation.window_s,
                     report.recommendation.order);
}

std::string model_toml(const AllanReport& report) {
  std::string text;
  for (std::size_t i = 0; i < 2; ++i) {
    const SeriesNoise& noise = report.noise.gyros[i];
    const Gyro gyro{i + 1, report.sensor_axis[i]};
    if (!noise.fit) continue;
    const NoiseFit& fit = *noise.fit;
    if (fit.white_dps_rthz.resolved) {
      effect(text, gyro, "white_noise",
             fmt::format("density_dps_rthz = {:.4e}\n", fit.white_dps_rthz.value));
    }
    if (fit.walk_dps_rts.resolved) {
      effect(text, gyro, "rate_random_walk",
             fmt::format("density_dps_rts = {:.4e}\n", fit.walk_dps_rts.value));
    }
    if (fit.markov) {
      effect(text, gyro, "gauss_markov",
             fmt::format("sigma_dps = {:.3e}\ntau_s = {:.3g}\n", fit.markov->sigma_dps,
                         fit.markov->tau_s));
    }
    if (fit.flicker_dps.resolved) add_flicker(text, gyro, noise);
    if (fit.ramp_significance() > analysis::kRampSigmas) {
      effect(text, gyro, "bias_ramp", fmt::format("slope_dps_s = {:.4e}\n", fit.ramp_dps_s));
    }
  }
  return text.empty() ? text : "format = 1\n\n" + text.substr(0, text.size() - 1);
}

std::string to_text(const AllanReport& report) {
  std::string text = (report.axis.empty() ? "" : fmt::format("Axis {}: ", report.axis)) +
                     report.log + "\n" + motion_text(report) + "\n" + table(report) + "\n" +
                     correlation_text(report);
  const std::string doubts = cautions(report);
  if (!doubts.empty()) text += "\n" + doubts;
  if (report.noise.difference.fit) {
    text += fmt::format("\nRecommended for the configuration:\n{}# window_s: {}\n# order: {}\n",
                        corrector_toml(report), window_reason(report), order_reason(report));
  }
  const std::string model = model_toml(report);
  if (!model.empty()) text += "\nFor the model file:\n" + model;
  return text;
}

nlohmann::ordered_json to_json(const AllanReport& report) {
  const analysis::MotionSummary& motion = report.noise.motion;
  nlohmann::ordered_json json;
  json["format"] = 1;
  json["log"] = report.log;
  if (!report.axis.empty()) json["axis"] = report.axis;
  json["at_rest"] = motion.at_rest;
  json["turned_up_to_dps"] = motion.turned_up_to_dps;
  json["rest"] = motion.rest ? nlohmann::ordered_json{{"from_s", motion.rest->from_s},
                                                      {"to_s", motion.rest->to_s}}
                             : nlohmann::ordered_json(nullptr);
  for (std::size_t i = 0; i < 2; ++i) {
    nlohmann::ordered_json gyro{{"name", report.gyro_names[i]},
                                {"resolution_dps", report.noise.step_dps[i]}};
    gyro.update(noise_json(report.noise.gyros[i]));
    json["gyros"].push_back(gyro);
  }
  json["difference"] = noise_json(report.noise.difference);
  const auto& removed = report.noise.removed;
  json["difference"]["removed"] =
      removed ? nlohmann::ordered_json{{"scale_factor", removed->scale}, {"lag_s", removed->lag_s}}
              : nlohmann::ordered_json(nullptr);
  const auto& rho = report.noise.correlation;
  json["rho"] = rho ? nlohmann::ordered_json{{"value", rho->value}, {"sigma", rho->sigma}}
                    : nlohmann::ordered_json(nullptr);
  json["recommendation"] = nullptr;
  if (report.noise.difference.fit) {
    json["recommendation"] = {{"window_s", report.recommendation.window_s},
                              {"order", report.recommendation.order},
                              {"error_dps", report.recommendation.error_dps},
                              {"why_window", window_reason(report)},
                              {"why_order", order_reason(report)}};
  }
  json["model_toml"] = model_toml(report);
  return json;
}

}  // namespace vgyro::cli
