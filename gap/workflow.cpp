#include "gap/workflow.h"

#include <algorithm>
#include <cmath>

#include "gap/describe.h"
#include "gap/differences.h"
#include "gap/figures.h"
#include "gap/identifiable.h"
#include "gap/leftover.h"
#include "gap/score.h"
#include "gap/search.h"
#include "gap/study.h"
#include "gap/timing.h"
#include "gap/weigh.h"

namespace vgyro::gap {

namespace {

// One of forty right models lies outside the band of 95 %, one of some 600 outside this.
constexpr double kClosedBands = 1.5;
// Places that the search looked at, for the p-value of the largest.
constexpr double kTrials = 400.0;
// How far the whole is, for people who wait; the search says what lies between.
constexpr double kShareFrames = 0.02;
constexpr double kShareScoring = 0.9;
constexpr double kShareDrawing = 0.95;

// Of χ² with one degree of freedom.
double chi_square_tail(double statistic) {
  return std::erfc(std::sqrt(0.5 * std::max(0.0, statistic)));
}

void fill_facts(const Study& study, std::size_t& held_out, std::array<std::size_t, 2>& samples) {
  held_out = 0;
  samples = {};
  for (const auto& data : study.observations()) {
    for (const Block& block : data->layout.blocks) {
      if (block.held_out) held_out += dimensions(block);
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        if (share_of(block.channel, gyro) != 0.0) samples[gyro] += block.count;
      }
    }
  }
}

double seconds_of(const std::vector<Recording>& recordings) {
  double sum = 0.0;
  for (const Recording& recording : recordings)
    sum += recording.seconds;
  return sum;
}

NamedEffect named(const Finding& finding, bool with_reference) {
  NamedEffect named;
  named.effect = finding.effect;
  named.sigma = finding.sigma;
  named.p_value = finding.p_value;
  named.statistic = finding.statistic;
  named.where = finding.where;
  named.ambiguous_with = finding.ambiguous_with;
  if (!finding.ambiguous_with.empty()) {
    named.experiment =
        experiment_for(reading_of(finding.effect), finding.ambiguous_with.front(), with_reference);
  }
  named.evidence = finding.evidence;
  named.figure = finding.figure;
  return named;
}

NamedEffect named(const Found& one, bool with_reference) {
  NamedEffect named;
  named.effect = one.effect;
  named.sigma = one.sigma;
  named.statistic = one.statistic;
  named.p_value = std::min(1.0, kTrials * chi_square_tail(one.adjusted()));
  named.ambiguous_with = one.ambiguous_with;
  named.checked = !one.unchecked;
  named.applied = named.checked && (one.ambiguous_with.empty() || one.accepted);
  if (!one.ambiguous_with.empty()) {
    named.experiment =
        experiment_for(reading_of(one.effect), one.ambiguous_with.front(), with_reference);
  }
  return named;
}

Verdict verdict_of(const Result& result) {
  const bool closed = result.gap.after <= kClosedBands * result.gap.band95[1];
  // The reference's lateness is taken off: nothing of the gyros remains by it.
  const bool rest =
      !closed || std::any_of(result.unexplained.begin(), result.unexplained.end(),
                             [](const Unexplained& one) { return one.gyro.has_value(); });
  if (result.effects.empty()) return rest ? Verdict::kUnexplained : Verdict::kNoGap;
  return rest ? Verdict::kPartlyExplained : Verdict::kExplained;
}

Effects joined(const Effects& first, const std::vector<NamedEffect>& second) {
  Effects all = first;
  for (const NamedEffect& one : second)
    all.push_back(one.effect);
  return all;
}

// The gap before and after each effect, in the order in which they were added, against the floor of
// the model with all of them. `first`: the starting model before anything was found.
void score(const Study& study, const Effects& given, const Effects& first, std::uint64_t seed,
           Result& result) {
  Effects now = joined(given, result.starting);
  const Floor floor = simulate_floor(study, joined(now, result.effects), Part::kHeldOut, seed);
  Effects before = given;
  before.insert(before.end(), first.begin(), first.end());
  double gap = gap_of(study, before, floor, Part::kHeldOut);
  result.gap.before = gap;
  result.gap.band95 = floor.band95;
  for (NamedEffect& one : result.effects) {
    one.gap_before = gap;
    now.push_back(one.effect);
    gap = gap_of(study, now, floor, Part::kHeldOut);
    one.gap_after = gap;
  }
  result.gap.after = gap;
  // What is not applied is part of the account and not of the model.
  const bool all = now.size() == result.model.effects.size();
  result.gap.of_model = all ? gap : gap_of(study, result.model.effects, floor, Part::kHeldOut);
}

// A sensor's own filter makes its noise soft: where it is no more than the model says, in all, that
// is worth a note and no doubt.
void note_soft_noise(const Recording& recording, Result& result) {
  if (result.gap.after > result.gap.band95[1]) return;
  const auto soft = std::stable_partition(result.unexplained.begin(), result.unexplained.end(),
                                          [](const Unexplained& one) { return !one.is_soft; });
  for (auto one = soft; one != result.unexplained.end(); ++one) {
    result.notes.push_back(recording.gyros[one->gyro.value_or(0)].name + ": " + one->text +
                           ", as behind a filter; in all it is what the model says");
  }
  result.unexplained.erase(soft, result.unexplained.end());
}

// What is no fault of the gyros.
void add_reference(const Study& study, std::vector<Unexplained>& list) {
  if (study.reference_late_s() == 0.0) return;
  Unexplained late;
  late.signature = "reference_late";
  late.gyro.reset();
  late.to_s = study.recording().seconds;
  late.text = reference_late_text(study.reference_late_s());
  list.insert(list.begin(), std::move(late));
}

// What the raw frames show by themselves is in from the start.
Effects known_effects(const Effects& given, const std::vector<Finding>& findings) {
  Effects known = given;
  for (const Finding& finding : findings)
    known.push_back(finding.effect);
  return known;
}

}  // namespace

std::string_view verdict_name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNoGap:
      return "no_gap";
    case Verdict::kExplained:
      return "explained";
    case Verdict::kPartlyExplained:
      return "partly_explained";
    case Verdict::kUnexplained:
      break;
  }
  return "unexplained";
}

Expected<Result> find_gap(const std::vector<Recording>& recordings, const model::Model& model,
                          const Settings& settings) {
  const auto tell = [&](std::string_view what, double share) {
    if (settings.progress) settings.progress(what, share);
  };
  tell("checking frames and stamps", kShareFrames);
  auto begun = Study::begin(recordings, model.effects);
  if (!begun) return tl::unexpected(begun.error());
  Search search(*begun, known_effects(model.effects, (*begun)->findings()));
  search.progress = settings.progress;
  search.time_left = settings.time_left;
  search.run();
  search.accept(settings.accept);
  const Study& study = search.study();

  tell("scoring held-out samples", kShareScoring);
  Result result;
  result.seconds = seconds_of(recordings);
  result.drives = study.drives();
  result.with_reference = study.recording().has_reference;
  result.notes = study.notes();
  result.open = search.open();
  result.model = model;
  result.not_identifiable = not_identifiable(study);
  fill_facts(study, result.held_out, result.samples);
  std::vector<Found> found = search.found();
  result.unexplained = leftovers(search, found);
  Effects others = known_effects(model.effects, study.findings());
  for (const Found& one : search.starting())
    others.push_back(one.effect);
  for (Unexplained& one : unproven(study, others, found))
    result.unexplained.push_back(std::move(one));
  add_reference(study, result.unexplained);
  for (const Finding& finding : study.findings())
    result.effects.push_back(named(finding, result.with_reference));
  for (const Found& one : found)
    result.effects.push_back(named(one, result.with_reference));
  for (const Found& one : search.starting())
    result.starting.push_back(named(one, result.with_reference));
  const Effects given = joined(model.effects, result.starting);
  result.model.effects = given;
  for (const NamedEffect& effect : result.effects) {
    if (effect.applied) result.model.effects.push_back(effect.effect);
  }
  score(study, model.effects, search.first_starting(), settings.seed, result);
  note_soft_noise(study.recording(), result);
  result.verdict = verdict_of(result);

  if (settings.with_evidence) {
    std::vector<Found> all = search.starting();
    all.insert(all.end(), found.begin(), found.end());
    result.evidence = weigh(study, known_effects(model.effects, study.findings()), all);
  }

  tell("drawing", kShareDrawing);
  describe_effects(study, given, result);
  result.figures = gyro_figures(study, given, joined(given, result.effects), settings.seed);
  tell("done", 1.0);
  return result;
}

Expected<Comparison> compare(const std::vector<Recording>& recordings, const model::Model& model,
                             const Settings& settings) {
  auto begun = Study::begin(recordings, model.effects);
  if (!begun) return tl::unexpected(begun.error());
  const Study& study = **begun;
  Comparison comparison;
  const Floor floor = simulate_floor(study, model.effects, Part::kHeldOut, settings.seed);
  const double gap = gap_of(study, model.effects, floor, Part::kHeldOut);
  comparison.gap = {gap, gap, floor.band95};
  comparison.seconds = seconds_of(recordings);
  comparison.drives = study.drives();
  comparison.with_reference = study.recording().has_reference;
  comparison.notes = study.notes();
  fill_facts(study, comparison.held_out, comparison.samples);
  comparison.differences = differences(study, model.effects);
  comparison.figures = gyro_figures(study, model.effects, model.effects, settings.seed);
  return comparison;
}

}  // namespace vgyro::gap
