#include "cli/init/choice.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "cli/output/progress.h"

namespace vgyro::cli {

namespace {

constexpr double kCorrelationLeast = 0.6;   // coarse or noisy gyros on a straight road
constexpr double kSignificanceLeast = 6.0;  // hundreds of pairs and lags are compared
constexpr double kCopyCorrelation = 0.9;
constexpr std::size_t kJudgedMost = 300;
constexpr std::size_t kAllCompared = 12;  // with more, only pairs with at least kQuickLeast:
constexpr double kQuickLeast = 0.4;

/// A copy of another signal is late, or has been filtered or rounded, which cannot be undone.
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

/// If there are too many candidates, the likeliest by name; in the candidates' order.
std::vector<std::size_t> to_judge(const std::vector<Candidate>& candidates) {
  std::vector<std::size_t> judged;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (usable(candidates[i])) judged.push_back(i);
  }
  if (judged.size() > kJudgedMost) {
    std::stable_sort(judged.begin(), judged.end(), [&](std::size_t a, std::size_t b) {
      return candidates[a].name_score > candidates[b].name_score;
    });
    judged.resize(kJudgedMost);
    std::sort(judged.begin(), judged.end());
  }
  return judged;
}

std::vector<analysis::ChangeShape> shapes_of(const std::vector<Candidate>& candidates,
                                             const std::vector<std::size_t>& judged) {
  double begin_s = 1e300;
  double end_s = -1e300;
  for (const std::size_t i : judged) {
    begin_s = std::min(begin_s, candidates[i].series.t_s.front());
    end_s = std::max(end_s, candidates[i].series.t_s.back());
  }
  std::vector<analysis::ChangeShape> shapes;
  shapes.reserve(judged.size());
  for (const std::size_t i : judged)
    shapes.push_back(analysis::change_shape(candidates[i].series, begin_s, end_s - begin_s));
  return shapes;
}

/// Figures of all pairs; with many signals, only of those that a quick comparison finds promising.
std::vector<PairFigures> compare(const std::vector<Candidate>& candidates,
                                 const std::vector<std::size_t>& judged) {
  std::vector<analysis::ChangeShape> shapes;
  if (judged.size() > kAllCompared) shapes = shapes_of(candidates, judged);
  std::vector<PairFigures> pairs;
  Progress progress("comparing");
  for (std::size_t i = 0; i < judged.size(); ++i) {
    progress.update("signals", static_cast<double>(i) / static_cast<double>(judged.size()));
    const Candidate& a = candidates[judged[i]];
    for (std::size_t k = i + 1; k < judged.size(); ++k) {
      const Candidate& b = candidates[judged[k]];
      if (!shapes.empty() && analysis::quick_correlation(shapes[i], shapes[k]) < kQuickLeast)
        continue;
      const auto found = analysis::likeness(a.series, b.series);
      if (!found) continue;
      PairFigures pair{judged[i], judged[k], *found};
      if (a.guessed || b.guessed) pair.likeness.scale = pair.likeness.ratio;
      pairs.push_back(pair);
    }
  }
  return pairs;
}

}  // namespace

bool PairFigures::alike() const {
  return std::abs(likeness.correlation) >= kCorrelationLeast &&
         likeness.significance >= kSignificanceLeast;
}

Choice choose(std::vector<Candidate>& candidates) {
  Choice choice;
  const std::vector<std::size_t> judged = to_judge(candidates);
  choice.pairs = compare(candidates, judged);
  mark_copies(candidates, choice.pairs);
  std::vector<std::pair<double, PairFigures>> alike;
  for (const PairFigures& pair : choice.pairs) {
    const Candidate& a = candidates[pair.first];
    const Candidate& b = candidates[pair.second];
    if (!pair.alike() || !usable(a) || !usable(b)) continue;
    if (a.found.stream == b.found.stream) continue;  // both are from one sensor
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
