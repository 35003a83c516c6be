#include "gap/workflow.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "gap/describe.h"
#include "gap/differences.h"
#include "gap/figures.h"
#include "gap/leftover.h"
#include "gap/score.h"
#include "gap/search.h"
#include "gap/study.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Effect;

double chi_square_tail(double statistic) {
  return std::erfc(std::sqrt(0.5 * std::max(0.0, statistic)));
}

// Places that the search looked at, for the p-value of the largest.
// One of forty right models lies outside the band of 95 %, one of some 600 outside this.
constexpr double kClosedBands = 1.5;
constexpr double kTrials = 400.0;

std::vector<Effect> with_transport(std::vector<Effect> effects,
                                   const std::vector<Finding>& findings) {
  for (const Finding& finding : findings)
    effects.push_back(finding.effect);
  return effects;
}

void fill_problem_facts(const Study& study, std::size_t& held_out,
                        std::array<std::size_t, 2>& samples) {
  held_out = 0;
  samples = {};
  for (const Problem& problem : study.problems()) {
    for (const Block& block : problem.layout.blocks) {
      if (block.held_out) held_out += block.count;
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        if (share_of(block.channel, gyro) != 0.0) samples[gyro] += block.count;
      }
    }
  }
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

Expected<Result> find_gap(const Recording& recording, const model::Model& model,
                          const Settings& settings) {
  const auto tell = [&](std::string_view what, double share) {
    if (settings.progress) settings.progress(what, share);
  };
  tell("checking frames and stamps", 0.02);
  auto study = Study::begin(recording, model.effects);
  if (!study) return tl::unexpected(study.error());
  Study& data = **study;

  // What the raw frames show by themselves is in from the start.
  const std::vector<Effect> known = with_transport(model.effects, data.findings());
  Search search(data, known);
  search.progress = settings.progress;
  search.run();

  Result result;
  result.seconds = recording.seconds;
  result.with_reference = recording.has_reference;
  result.notes = data.notes();
  result.model = model;
  result.not_identifiable = not_identifiable(data);
  fill_problem_facts(data, result.held_out, result.samples);

  tell("scoring held-out samples", 0.9);
  std::vector<Found> found = search.found();
  std::vector<Unexplained> leftover = leftovers(data, search, found);
  std::vector<Effect> last = known;
  for (const Found& one : found)
    last.push_back(one.term.effect);
  const Floor floor = simulate_floor(data, last, Part::kHeldOut, settings.seed);
  std::vector<Effect> now = model.effects;
  double gap = gap_of(data, now, floor, Part::kHeldOut);
  result.gap.before = gap;
  result.gap.band95 = floor.band95;
  for (const Finding& finding : data.findings()) {
    NamedEffect named;
    named.effect = finding.effect;
    named.sigma = finding.sigma;
    named.p_value = finding.p_value;
    named.statistic = finding.statistic;
    named.where = finding.where;
    named.evidence = finding.evidence;
    named.figure = finding.figure;
    named.gap_before = gap;
    now.push_back(finding.effect);
    gap = gap_of(data, now, floor, Part::kHeldOut);
    named.gap_after = gap;
    result.effects.push_back(std::move(named));
  }
  for (const Found& one : found) {
    NamedEffect named;
    named.effect = one.term.effect;
    named.sigma = one.sigma;
    named.statistic = one.statistic;
    named.p_value = std::min(1.0, kTrials * chi_square_tail(one.statistic - one.penalty));
    named.ambiguous_with = one.ambiguous_with;
    if (!one.ambiguous_with.empty()) {
      named.experiment = experiment_for({one.term.effect.kind, one.term.effect.gyro},
                                        one.ambiguous_with.front(), recording.has_reference);
    }
    named.gap_before = gap;
    now.push_back(one.term.effect);
    gap = gap_of(data, now, floor, Part::kHeldOut);
    named.gap_after = gap;
    result.effects.push_back(std::move(named));
  }
  result.gap.after = gap;
  result.unexplained = std::move(leftover);
  for (const NamedEffect& effect : result.effects)
    result.model.effects.push_back(effect.effect);
  const bool closed = result.gap.after <= kClosedBands * floor.band95[1];
  const bool rest = !result.unexplained.empty() || !closed;
  if (result.effects.empty()) {
    result.verdict = rest ? Verdict::kUnexplained : Verdict::kNoGap;
  } else {
    result.verdict = rest ? Verdict::kPartlyExplained : Verdict::kExplained;
  }
  tell("drawing", 0.95);
  describe_effects(data, model.effects, result);
  result.figures = gyro_figures(data, model.effects, result.model.effects, settings.seed);
  tell("done", 1.0);
  return result;
}

Expected<Comparison> compare(const Recording& recording, const model::Model& model,
                             const Settings& settings) {
  auto study = Study::begin(recording, model.effects);
  if (!study) return tl::unexpected(study.error());
  const Study& data = **study;
  Comparison comparison;
  const Floor floor = simulate_floor(data, model.effects, Part::kHeldOut, settings.seed);
  const double gap = gap_of(data, model.effects, floor, Part::kHeldOut);
  comparison.gap = {gap, gap, 0.0, floor.band95};
  comparison.seconds = recording.seconds;
  comparison.with_reference = recording.has_reference;
  comparison.notes = data.notes();
  std::size_t held_out = 0;
  fill_problem_facts(data, held_out, comparison.samples);
  comparison.differences = differences(data, model.effects);
  comparison.figures = gyro_figures(data, model.effects, model.effects, settings.seed);
  return comparison;
}

}  // namespace vgyro::gap
