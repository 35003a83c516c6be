#pragma once

// A result with every kind of entry, and names that are hostile to a page, for the tests of its
// output.

#include <cmath>
#include <numbers>

#include "cli/gap/report.h"
#include "gap/result.h"

namespace vgyro::cli {

inline constexpr const char* kHostile =
    "</script><img src=x onerror=\"console.error('in')\">&amp; {{data}}";

inline GapSubject made_up_subject() {
  GapSubject subject{"vgyro.toml", "", kHostile, {kHostile, "b"}};
  const std::string sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
  subject.provenance = {"vgyro gap --config vgyro.toml --measured '" + std::string(kHostile) + "'",
                        {{"vgyro.toml", sum, {}}, {kHostile, sum, "2026-05-04 08:00:12 UTC"}}};
  return subject;
}

// A slow wave, and a band or bars of the given σ.
inline gap::Curve made_up_curve(const char* label, double amplitude, double sigma, bool points) {
  gap::Curve curve{label, {}, {}, {}, points};
  for (int i = 1; i <= 100; ++i) {
    curve.x.push_back(i);
    curve.y.push_back(amplitude * (1.5 + std::sin(2.0 * std::numbers::pi * i / 60.0)));
    if (sigma > 0.0) curve.y_sigma.push_back(sigma);
  }
  return curve;
}

inline gap::Figure made_up_figure(const char* title, bool logarithmic, bool points) {
  return {title,
          "time, s",
          "rate, deg/s",
          logarithmic,
          logarithmic,
          {made_up_curve("before", 2e-3, 2e-4, points), made_up_curve("after", 4e-4, 1e-4, points),
           made_up_curve("simulated", 9e-4, 2e-4, false)}};
}

inline gap::Result made_up_result() {
  gap::Result result;
  result.verdict = gap::Verdict::kPartlyExplained;
  result.gap = {.before = 0.81, .after = 0.014, .band95 = {-0.006, 0.007}, .of_model = 0.7};
  gap::NamedEffect scale;
  scale.effect = {1, model::Kind::kScaleFactor, {-4.2123456e-4}};
  scale.sigma = {3.123e-6};
  scale.p_value = 1e-9;
  scale.gap_before = 0.81;
  scale.gap_after = 0.09;
  scale.where = {60.0, 340.0, 0.0, 8.0};
  scale.ambiguous_with = {{model::Kind::kScaleFactor, 0, {4.2e-4}}};
  scale.applied = false;
  scale.evidence = "What it reads too little grows with the rate.";
  scale.experiment = "record a rate table";
  scale.figure = made_up_figure("Against the rate", false, true);
  gap::NamedEffect tilt;
  tilt.effect = {0, model::Kind::kGSensitivity, {2.0, 0.00123}};
  tilt.sigma = {0.0, 2e-5};
  tilt.gap_before = 0.09;
  tilt.gap_after = 0.014;
  tilt.where = {100.0, 300.0, 0.0, 2.0};
  tilt.figure = made_up_figure("Against the acceleration", false, false);
  result.effects = {scale, tilt};
  result.unexplained = {{"line", 0, 37.02, 0.001, 0.0, 300.0, "line at 37.02 ± 0.01 Hz"},
                        {"slow", 1, {}, {}, 10.0, 20.0, kHostile}};
  for (const std::size_t gyro : {0U, 1U}) {
    for (const model::Kind kind :
         {model::Kind::kTemperatureBias, model::Kind::kScaleFactorTemperature}) {
      result.not_identifiable.push_back(
          {kind, gyro, "temperature is constant", "let it change by 10 K"});
    }
  }
  result.not_identifiable.push_back({model::Kind::kSaturation, 1, "the rate stays low", ""});
  result.model.effects = {scale.effect, tilt.effect};
  for (gap::GyroFigures& gyro : result.figures) {
    gyro = {made_up_figure("over time", false, false), made_up_figure("spectrum", true, false),
            made_up_figure("Allan deviation", true, true)};
  }
  gap::Figure& hostile = result.figures[0].time;
  hostile.title = hostile.x_label = hostile.y_label = kHostile;
  hostile.curves[0].label = std::string("before ") + kHostile;
  result.seconds = 400.0;
  result.samples = {40'000, 40'001};
  result.held_out = 12'000;
  result.notes = {"3 samples were left out"};
  return result;
}

}  // namespace vgyro::cli
