#pragma once

// What the workflow found: numbers for gap.json, curves for the report.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gap/drive_evidence.h"
#include "model/effect.h"
#include "model/file.h"

namespace vgyro::gap {

enum class Verdict : std::uint8_t { kNoGap, kExplained, kPartlyExplained, kUnexplained };
/// "no_gap", "explained", "partly_explained", "unexplained"
std::string_view verdict_name(Verdict verdict);

/// Negative log-likelihood per sample of the held-out samples, less what simulations of the final
/// model score there: the floor, which is 0.
struct Gap {
  double before = 0.0;
  double after = 0.0;              ///< with all that was found, applied or not
  std::array<double, 2> band95{};  ///< of simulations of the final model
  double of_model = 0.0;           ///< with what is applied: of Result::model
};

/// A stretch of time.
struct Span {
  double from_s = 0.0;
  double to_s = 0.0;
};

struct Where {
  double from_s = 0.0;
  double to_s = 0.0;
  double low_hz = 0.0;
  double high_hz = 0.0;
};

struct Reading {
  model::Kind kind = model::Kind::kBias;
  std::size_t gyro = 0;
  model::Parameters parameters{};  ///< as fitted; all 0 where nobody fitted it

  [[nodiscard]] bool is_fitted() const { return parameters != model::Parameters{}; }
};

struct Curve {
  std::string label;
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> y_sigma;  ///< 1σ of each y; empty: none to show
  bool points = false;          ///< single marks instead of a line
};

struct Figure {
  std::string title;  ///< what is to be seen, in one sentence
  std::string x_label;
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  std::vector<Curve> curves;
};

/// One round of the workflow.
struct NamedEffect {
  model::Effect effect;
  model::Parameters sigma{};  ///< in the order of the catalogue; 0 where nothing was estimated
  double p_value = 0.0;       ///< of such a score anywhere in the search, were nothing there
  double statistic = 0.0;     ///< 2·ΔlogL, noise fitted again on both sides
  double gap_before = 0.0;
  double gap_after = 0.0;
  Where where;
  std::vector<Reading> ambiguous_with;
  /// It stands in the model. One that is ambiguous does so only where the caller accepts a reading,
  /// one that was not checked never.
  bool applied = true;
  bool checked = true;     ///< false: the time was over before all that speaks against it was tried
  std::string evidence;    ///< one sentence for people: what gave it away
  std::string experiment;  ///< what would tell the ambiguous readings apart; empty: nothing to tell
  Figure figure;           ///< that shows it: before and after
};

struct Unexplained {
  /// "line", "noise", "step", "slow", "outliers", "rate", …; "reference_late"
  std::string signature;
  std::optional<std::size_t> gyro = 0;  ///< nothing: it is the reference's
  std::optional<double> frequency_hz;
  std::optional<double> amplitude_dps;
  double from_s = 0.0;
  double to_s = 0.0;
  std::string text;  ///< "line at 37.02 ± 0.01 Hz, 0.001 deg/s, 0 to 300 s"
  bool is_soft =
      false;  ///< noise that hangs together, as behind a filter, and is not too much else
};

struct NotIdentifiable {
  model::Kind kind = model::Kind::kBias;
  std::size_t gyro = 0;
  std::string why;         ///< "temperature is constant in this recording"
  std::string experiment;  ///< "let the temperature change by 10 K"
};

/// Residuals of one gyro against the rate as far as it is known: what the report draws.
struct GyroFigures {
  Figure time;      ///< measured less predicted: before, after, and the 2σ of a simulation
  Figure spectrum;  ///< √PSD: measured less predicted before, after, simulated with the final model
  Figure allan;     ///< Allan deviation of the same three
};

struct Result {
  Verdict verdict = Verdict::kNoGap;
  Gap gap;
  /// Bias and noise of the gyros of which the given model says neither, fitted beside the effects:
  /// what the gap before is counted with. Part of the model.
  std::vector<NamedEffect> starting;
  std::vector<NamedEffect> effects;  ///< in the order in which they were added
  std::vector<Unexplained> unexplained;
  std::vector<NotIdentifiable> not_identifiable;
  model::Model model;  ///< the given one and what is applied
  std::array<GyroFigures, 2> figures;
  double seconds = 0.0;      ///< of the recording, or of all
  std::vector<Span> drives;  ///< when each of several begins and ends; empty for one
  std::array<std::size_t, 2> samples{};
  std::size_t held_out = 0;  ///< samples that took no part in naming or fitting
  bool with_reference = false;
  std::vector<std::string> notes;  ///< what a reader must know: masked samples, parts left out
  std::vector<std::string> open;   ///< what the time was too short for
  std::optional<DriveEvidence> evidence;  ///< where it was asked for
};

/// `vgyro compare`: one model against one recording.
struct Difference {
  std::size_t gyro = 0;
  Where where;
  std::string against;  ///< "rate", "temperature", "time", "frequency", …
  double nats = 0.0;    ///< of the whole recording that this accounts for
  std::string text;
};

struct Comparison {
  Gap gap;                              ///< before and after are both the value
  std::vector<Difference> differences;  ///< largest first
  std::array<GyroFigures, 2> figures;
  double seconds = 0.0;      ///< of the recording, or of all
  std::vector<Span> drives;  ///< when each of several begins and ends; empty for one
  std::array<std::size_t, 2> samples{};
  std::size_t held_out = 0;  ///< samples that the gap is counted on
  bool with_reference = false;
  std::vector<std::string> notes;
};

}  // namespace vgyro::gap
