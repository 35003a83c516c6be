#include "cli/init/choice.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cli/output/progress.h"

namespace vgyro::cli {

namespace {

constexpr double kCorrelationLeast = 0.6;   // coarse or noisy ones on a straight road
constexpr double kSignificanceLeast = 6.0;  // hundreds of pairs and lags are looked at
constexpr double kCopyCorrelation = 0.9;
constexpr std::size_t kJudgedMost = 60;

/// A signal that repeats another one is later, or is what cannot be undone: filtered, rounded.
void mark_copies(std::vector<Candidate>& candidates, const std::vector<PairFigures>& pairs) {
  for (const PairFigures& pair : pairs) {
    Candidate& a = candidates[pair.first];
    Candidate& b = candidates[pair.second];
    if (!pair.alike() || std::abs(pair.likeness.correlation) < kCopyCorrelation) continue;
    const bool b_of_a = analysis::is_made_of(b.series, a.series, pair.likeness.lag_s);
    const bool a_of_b = analysis::is_made_of(a.series, b.series, -pair.likeness.lag_s);
    if (!b_of_a && !a_of_b) continue;
    bool b_is_copy = b_of_a;
    if (a_of_b && b_of_a) {
      const double tie_s = 0.1 * a.figures.interval_s;
      b_is_copy = std::abs(pair.likeness.lag_s) > tie_s ? pair.likeness.lag_s > 0.0
                                                        : a.series.step <= b.series.step;
    }
    Candidate& copy = b_is_copy ? b : a;
    const Candidate& source = b_is_copy ? a : b;
    if (copy.why_not.empty())
      copy.why_not = "the same sensor as " + source.place() + ", repeated: no second gyro";
  }
}

double score(const std::vector<Candidate>& candidates, const PairFigures& pair) {
  const Candidate& a = candidates[pair.first];
  const Candidate& b = candidates[pair.second];
  const double correlation = std::min(std::abs(pair.likeness.correlation), 0.9999);
  const bool scaled = !a.guessed && !b.guessed;
  const double off_scale = scaled ? std::abs(std::log(std::abs(pair.likeness.scale))) : 0.0;
  const double slower_s = std::max(a.figures.interval_s, b.figures.interval_s);
  return 0.5 * std::atanh(correlation) + a.name_score + b.name_score -
         3.0 * std::min(off_scale, 1.0) - 0.3 * std::log10(slower_s / 0.01);
}

bool usable(const Candidate& candidate) {
  return candidate.why_not.empty();
}

}  // namespace

bool PairFigures::alike() const {
  return std::abs(likeness.correlation) >= kCorrelationLeast &&
         likeness.significance >= kSignificanceLeast;
}

Choice choose(std::vector<Candidate>& candidates) {
  Choice choice;
  std::vector<std::size_t> judged;
  for (std::size_t i = 0; i < candidates.size() && judged.size() < kJudgedMost; ++i) {
    if (usable(candidates[i])) judged.push_back(i);
  }
  Progress progress("comparing");
  for (std::size_t i = 0; i < judged.size(); ++i) {
    progress.update("signals", static_cast<double>(i) / static_cast<double>(judged.size()));
    for (std::size_t k = i + 1; k < judged.size(); ++k) {
      const auto found =
          analysis::likeness(candidates[judged[i]].series, candidates[judged[k]].series);
      if (!found) continue;
      PairFigures pair{judged[i], judged[k], *found};
      const bool raw = candidates[judged[i]].guessed || candidates[judged[k]].guessed;
      if (raw) pair.likeness.scale = pair.likeness.ratio;
      choice.pairs.push_back(pair);
    }
  }
  mark_copies(candidates, choice.pairs);
  std::vector<std::pair<double, PairFigures>> alike;
  for (const PairFigures& pair : choice.pairs) {
    const Candidate& a = candidates[pair.first];
    const Candidate& b = candidates[pair.second];
    if (!pair.alike() || !usable(a) || !usable(b)) continue;
    if (a.found.stream == b.found.stream) continue;  // one frame is one sensor's
    alike.emplace_back(score(candidates, pair), pair);
  }
  std::stable_sort(alike.begin(), alike.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  if (!alike.empty()) choice.pair = alike.front().second;
  for (std::size_t i = 1; i < alike.size(); ++i)
    choice.others.push_back(alike[i].second);
  for (const std::size_t i : judged) {
    const bool better =
        !choice.alone || candidates[i].name_score > candidates[*choice.alone].name_score;
    if (usable(candidates[i]) && better && !candidates[i].guessed) choice.alone = i;
  }
  if (!choice.pair) return choice;
  for (const PairFigures& pair : choice.pairs) {
    const std::size_t gyro = choice.pair->first;
    const std::size_t other = pair.first == gyro ? pair.second : pair.first;
    if (!pair.alike() || (pair.first != gyro && pair.second != gyro)) continue;
    if (other == choice.pair->second || !usable(candidates[other])) continue;
    choice.followers.push_back(other);
  }
  return choice;
}

}  // namespace vgyro::cli
