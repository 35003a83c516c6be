#include "gap/search.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>

#include "gap/noise_search.h"
#include "gap/robust.h"
#include "gap/steadiness.h"
#include "model/equation.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

// Statistic less penalty that a name needs; docs/gap.md says what chance brings.
constexpr double kStatisticMin = 18.0;
// What noise needs: weak noise of the wrong name would hide what grew it.
constexpr double kNoiseMin = 24.0;
// What a name needs where the noise must have grown beyond the model's to do without it: then one
// name or another is due, and the question is only which.
constexpr double kStatisticMinAgainstNoise = 13.0;
// Of great effects the arithmetic of interpolation is not sure to better than this share.
constexpr double kLeadShare = 3e-3;
// A free reference is one more parameter; the catalogue's, where it is as good, is preferred.
constexpr double kReferencePenalty = 18.0;
// Beyond that a recording is no longer explained, only described.
constexpr std::size_t kFoundMax = 10;
constexpr int kNoiseRoundsMax = 6;
// Fitting is dear: so many of the likeliest proposals are fitted, of three times as many that may
// be the same in other words.
constexpr std::size_t kRefitsMax = 7;
constexpr std::size_t kRivalsMax = 6;
constexpr std::size_t kWordsEach = 3;
// A proposal below this is not worth a fit.
constexpr double kWorthAFit = 8.0;
// A rival is fitted when the linear look gives it half of what the effect itself has, and some.
constexpr double kRivalShare = 0.5;
constexpr double kRivalMargin = 10.0;
constexpr double kTimingRivalShare = 0.2;
// Nor is one that the linear look gives less than this share of the best.
constexpr double kHopeShare = 0.3;
// Replacing one name by another that is as good would go on for ever.
constexpr double kBetter = 0.5;
// Where no model says how much a gyro drifts, a tenth of what was fitted is tried, too: slow
// effects raise it.
constexpr double kUnknownWalk = 0.1;
// A name that fell this far below what it needs is deleted; less is the noise's doubt.
constexpr double kFallen = -4.0;
// Of a drift's statistic: a smaller line in it is a part of it.
constexpr double kLineShare = 0.05;
// Held-out samples are a third of those that are fitted. A gain of 2·log-likelihood g scatters by
// 2·√g, and beside others that share its shape it is less: a fifth of it must be there. What is
// none foretells nothing.
constexpr double kHeldOutShare = 1.0 / 3.0;
constexpr double kProofSigmas = 2.5;
constexpr double kProofShare = 0.8;
// Names that did not prove themselves, one after the other: beyond that what is there is not in the
// catalogue, and only resembles one thing after another.
constexpr std::size_t kBarredMax = 3;
// A starting model's noise is known at best to a hundredth, and is written with as many digits.
constexpr double kStartingNoiseDoubt = 0.01;
// Shares of a timing effect's statistic that interpolation leaves behind.
constexpr double kTimingLeaves = 2e-3;
constexpr double kJitterLeaves = 2e-2;
constexpr double kJitterMemory_s = 1.0;
// Each turn learns the motion from the last fit. The rivals are only compared: all after as many,
// or when theirs stand still.
constexpr int kMotionTurns = 3;
// Of the log-likelihood from one turn to the next: nothing moves any more; or the motion that the
// terms give contradicts them, and further turns would only lead farther off.
constexpr double kTurnsAlike = 0.1;
constexpr double kTurnFails = 500.0;
// Of noise a low-pass takes off ω²τ², a delay of as long half of it.
constexpr double kLowPassDoubts = 2.0;
// What must be left of a bounded time: names are worth nothing before they were checked, which
// takes about as long as finding them; and what was found must be scored and drawn.
constexpr double kLeftToCheck = 0.5;
constexpr double kLeftToScore = 0.15;
// How far the whole is, for people who wait.
constexpr double kShareBegun = 0.1;
constexpr double kShareAdding = 0.6;
constexpr double kShareRivals = 0.75;
constexpr double kShareNoise = 0.85;

bool is_noise(const Found& found) {
  return row(found.effect.kind).finder == Finder::kNoise;
}

// What hangs together over less than some blocks is what late stamps make of motion, too.
bool is_like_jitter(const Effect& effect) {
  return row(effect.kind).random == Random::kMarkov && effect.parameters[1] < kJitterMemory_s;
}

bool is_timing(const Effect& effect) {
  return model::moves_in_time(effect.kind);
}

bool passes_low(const Effect& effect) {
  return effect.kind == Kind::kBandwidth || effect.kind == Kind::kBandwidthSecondOrder;
}

bool has_any(const Effects& effects, std::size_t gyro, std::initializer_list<Kind> kinds) {
  return std::any_of(effects.begin(), effects.end(), [&](const Effect& effect) {
    return effect.gyro == gyro && std::find(kinds.begin(), kinds.end(), effect.kind) != kinds.end();
  });
}

bool same_reading(const Reading& a, const Reading& b) {
  return a.kind == b.kind && a.gyro == b.gyro;
}

void sort_by_weight(std::vector<Found>& list) {
  std::sort(list.begin(), list.end(),
            [](const Found& a, const Found& b) { return a.adjusted() > b.adjusted(); });
}

// Of several that are as good, the plainest: the catalogue's first.
std::vector<Found>::const_iterator likeliest(const std::vector<Found>& candidates) {
  const auto top =
      std::max_element(candidates.begin(), candidates.end(),
                       [](const Found& a, const Found& b) { return a.margin() < b.margin(); });
  if (top == candidates.end()) return top;
  return std::min_element(
      candidates.begin(), candidates.end(), [&](const Found& a, const Found& b) {
        const bool a_far = a.margin() < top->margin() - kBetter;
        const bool b_far = b.margin() < top->margin() - kBetter;
        if (a_far != b_far) return b_far;
        return !a_far && (a.effect.kind != b.effect.kind ? a.effect.kind < b.effect.kind
                                                         : a.margin() > b.margin());
      });
}

// One clock that is fast, or the other one as slow.
Reading other_clock_of(const Effect& skew) {
  return {Kind::kClockSkew, 1 - skew.gyro, {-skew.parameters[0]}};
}

// Cannot be told from `best`, of an effect with such a gain.
bool is_close(double adjusted, double best, double gain) {
  return adjusted > best - kLead - kLeadShare * gain;
}

}  // namespace

// Without a caller's limit there is always time.
bool Search::is_over(double needed) const {
  return time_left && time_left() < needed;
}

void Search::leave_open(const std::string& what) {
  if (std::find(open_.begin(), open_.end(), what) == open_.end()) open_.push_back(what);
}

Search::Search(std::shared_ptr<const Study> study, Effects known)
    : known_(std::move(known)), noise_(noise_of(known_)), model_noise_(noise_) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    unknown_noise_[gyro] = model_noise_[gyro].white_dps_rthz <= 0.0;
  take(std::move(study));
}

void Search::take(std::shared_ptr<const Study> study) {
  study_ = std::move(study);
  regressions_.clear();
  for (const auto& data : study_->observations())
    regressions_.emplace_back(data, known_, Part::kFit);
  beside_.clear();
  for (std::size_t place = 0; place < regressions_.size(); ++place)
    beside_.push_back(terms(place));
  scans_.clear();
  scans_.resize(regressions_.size());
}

// Its shapes are dear: most studies are left again without a look.
const Scan& Search::scan(std::size_t place) {
  if (!scans_[place]) scans_[place].emplace(regressions_[place], beside_[place]);
  return *scans_[place];
}

Effects Search::effects() const {
  Effects all = known_;
  all.insert(all.end(), starting_noise_.begin(), starting_noise_.end());
  for (const Found& found : found_)
    all.push_back(found.effect);
  return all;
}

std::vector<Found> Search::found() const {
  std::vector<Found> names;
  std::copy_if(found_.begin(), found_.end(), std::back_inserter(names),
               [](const Found& one) { return one.is_name(); });
  // c·(T − T₀) + b is c·(T − (T₀ − b/c)).
  for (const Found& bias : found_) {
    if (!bias.of_reference) continue;
    for (Found& one : names) {
      if (one.effect.kind != Kind::kTemperatureBias || one.effect.gyro != bias.effect.gyro)
        continue;
      one.effect.parameters[1] -= bias.effect.parameters[0] / one.effect.parameters[0];
      one.sigma[1] = bias.sigma[0] / std::abs(one.effect.parameters[0]);
    }
  }
  return names;
}

std::vector<Found> Search::starting() const {
  std::vector<Found> list;
  std::copy_if(found_.begin(), found_.end(), std::back_inserter(list),
               [](const Found& one) { return one.starting; });
  for (const Effect& effect : starting_noise_) {
    list.push_back({});
    list.back().effect = effect;
    list.back().sigma[0] = effect.parameters[0] * kStartingNoiseDoubt;
  }
  return list;
}

// White noise and walk of the gyros of which the model says nothing.
Effects Search::noise_effects(const PairNoise& noise) const {
  Effects effects;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!unknown_noise_[gyro]) continue;
    effects.push_back({gyro, Kind::kWhiteNoise, {noise[gyro].white_dps_rthz}, 0});
    if (noise[gyro].walk_dps_rts > 0.0)
      effects.push_back({gyro, Kind::kRateRandomWalk, {noise[gyro].walk_dps_rts}, 0});
  }
  return effects;
}

// Every gyro has a bias and noise: where the model says nothing of them they are no names, and the
// gap counts from there.
void Search::start() {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!unknown_noise_[gyro] || has_any(known_, gyro, {Kind::kBias})) continue;
    found_.push_back({});
    found_.back().effect = {gyro, Kind::kBias, {0.0}, 0};
    found_.back().starting = true;
  }
  if (!unknown_noise_[0] && !unknown_noise_[1]) return;
  // Twice: of the first motion a bias was no part, and both gyros weighed the same in it. What is
  // late is reckoned by a mean: were it not the one with the least noise, a false low-pass would
  // seem to take some off.
  settle();
  starting_noise_ = noise_effects(noise_);
  settle();
  for (const Found& one : found_)
    first_starting_.push_back(one.effect);
  for (const Effect& effect : noise_effects(noise_))
    first_starting_.push_back(effect);
}

std::size_t Search::place_of(const Effect& effect) const {
  return study_->place_of(effect.gyro);
}

// What was found of the gyros that are observed in one place, noise left out.
Effects Search::terms(std::size_t place, std::size_t left_out) const {
  Effects mine;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    if (i != left_out && !is_noise(found_[i]) && place_of(found_[i].effect) == place)
      mine.push_back(found_[i].effect);
  }
  return mine;
}

void Search::keep_noise(std::size_t place, const PairNoise& noise) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (regressions_[place].data().holds[gyro]) noise_[gyro] = noise[gyro];
  }
}

// The rate that the found effects give, where it is not known. What is late changes every shape.
void Search::renew_motion() {
  take(study_->with_motion(effects()));
}

// The fitted noise where the model says nothing, the model's elsewhere. Slow effects raise the
// fitted drift, which hides them.
PairNoise Search::modelled(const PairNoise& fitted) const {
  PairNoise noise = fitted;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const NoiseTerms& model = model_noise_[gyro];
    const double walk =
        unknown_noise_[gyro] ? kUnknownWalk * noise[gyro].walk_dps_rts : model.walk_dps_rts;
    noise[gyro].walk_dps_rts = std::min(noise[gyro].walk_dps_rts, walk);
    noise[gyro].ratio_rthz = model.ratio_rthz;
    noise[gyro].flicker_dps = model.flicker_dps;
    noise[gyro].markov = model.markov;
    if (model.white_dps_rthz > 0.0) noise[gyro].white_dps_rthz = model.white_dps_rthz;
  }
  return noise;
}

bool Search::knows_no_noise(std::size_t place) const {
  const auto& holds = regressions_[place].data().holds;
  return (holds[0] && model_noise_[0].white_dps_rthz <= 0.0) ||
         (holds[1] && model_noise_[1].white_dps_rthz <= 0.0);
}

// Beyond the model's noise, where that says anything.
bool Search::has_grown(std::size_t place, const Fit& null) const {
  const Regression& regression = regressions_[place];
  if (knows_no_noise(place)) return false;
  const double as_modelled = regression.log_likelihood(null.terms, model_noise_);
  return 2.0 * (null.log_likelihood - as_modelled) > kStatisticMin;
}

Found Search::refitted(std::size_t place, const Fit& null, const PairNoise& start,
                       const Score& score) const {
  const Regression& regression = regressions_[place];
  Effects terms = null.terms;
  terms.push_back(row(score.effect.kind).finder == Finder::kStep
                      ? placed(regression, null, score.effect)
                      : score.effect);
  const Fit with = regression.fit_beside(std::move(terms), start, null);
  Found found;
  found.effect = with.terms.back();
  found.statistic = 2.0 * (with.log_likelihood - null.log_likelihood);
  found.penalty = score.penalty;
  found.needed = kStatisticMin;
  return found;
}

// `start`: the noise that the fits begin with. Of several starts for one kind the best is enough.
std::vector<Found> Search::refitted(std::size_t place, const Fit& null, const PairNoise& start,
                                    const std::vector<Score>& scores, std::size_t most) const {
  std::vector<Found> list;
  for (const Score& score : scores) {
    if (list.size() >= most) break;
    const bool is_line = row(score.effect.kind).finder == Finder::kLine;
    const bool again = !is_line && std::any_of(list.begin(), list.end(), [&](const Found& other) {
      return same_form(other.effect, score.effect);
    });
    if (again || score.statistic < kWorthAFit) continue;
    if (score.adjusted() < kHopeShare * scores.front().adjusted() - kRivalMargin) break;
    if (is_over(kLeftToScore)) break;
    list.push_back(refitted(place, null, start, score));
  }
  sort_by_weight(list);
  return list;
}

// Interpolation leaves a thousandth of a great timing effect, which looks like another one, and
// without a reference, where the rate itself is made of late readings, like lines and noise too.
bool Search::is_left_of_timing(const Found& one) const {
  const Effect& effect = one.effect;
  const bool knows_rate = study_->recording().has_reference;
  const bool is_quick = is_like_jitter(effect);
  if (!is_quick && (knows_rate ? !is_timing(effect) : !row(effect.kind).is_fast)) return false;
  const bool of_found = std::any_of(found_.begin(), found_.end(), [&](const Found& found) {
    return !is_quick && is_timing(found.effect) &&
           (!knows_rate || found.effect.gyro == effect.gyro) &&
           one.statistic < kTimingLeaves * found.statistic;
  });
  const auto& findings = study_->findings();
  const bool of_jitter = std::any_of(findings.begin(), findings.end(), [&](const Finding& finding) {
    if (finding.effect.kind != Kind::kTimestampJitter) return false;
    return (!knows_rate || finding.effect.gyro == effect.gyro) &&
           one.statistic < kJitterLeaves * finding.statistic;
  });
  return of_found || of_jitter;
}

// A line over the temperature with a bias beside it: where a gyro's own zero is at another
// temperature than the catalogue's, the line alone is none of its best names.
void Search::look_at_temperature(std::size_t place, const Fit& null, const PairNoise& start,
                                 std::vector<Found>& found) const {
  const Regression& regression = regressions_[place];
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    Effect line{gyro, Kind::kTemperatureBias, (*row(Kind::kTemperatureBias).starts)[0], 0};
    line.parameters[0] = 0.0;
    const Effect bias{gyro, Kind::kBias, {0.0}, 0};
    if (has_any(null.terms, gyro, {bias.kind, line.kind}) || regression.data().about.coarse[gyro] ||
        !could_show(regression.data(), line) || is_over(kLeftToScore))
      continue;
    Effects with = null.terms;
    with.push_back(bias);
    with.push_back(line);
    const Fit fit = regression.fit_beside(std::move(with), start, null);
    Found one;
    one.effect = fit.terms.back();
    one.companion = fit.terms[fit.terms.size() - 2];
    one.statistic = 2.0 * (fit.log_likelihood - null.log_likelihood);
    one.penalty = kReferencePenalty;
    one.needed = kStatisticMin;
    found.push_back(std::move(one));
  }
}

// At the fitted noise and at the model's.
void Search::look(std::size_t place, Round& round) {
  const Regression& regression = regressions_[place];
  const Fit null = regression.fit(terms(place), noise_);
  keep_noise(place, null.noise);
  std::vector<Score> scores = scan(place).scores(null, null.noise);
  for (const Score& one : scores) {
    if (is_timing(one.effect)) round.timing.push_back(one);
  }
  if (scores.size() > kWordsEach * kRefitsMax) scores.resize(kWordsEach * kRefitsMax);
  std::vector<Found> found = refitted(place, null, null.noise, scores, kRefitsMax);
  look_at_temperature(place, null, null.noise, found);
  const bool grown = has_grown(place, null);
  // Where the noise has not grown the model's would show the same.
  if (grown || knows_no_noise(place)) {
    const PairNoise modelled = this->modelled(null.noise);
    const std::vector<Score> more = scan(place).scores(null, modelled);
    for (Found& one : refitted(place, null, modelled, more, kRefitsMax))
      found.push_back(std::move(one));
  }
  for (Found& one : found) {
    if (!is_plausible(one.effect)) continue;
    if (grown) one.needed = kStatisticMinAgainstNoise;
    round.candidates.push_back(std::move(one));
  }
}

bool Search::is_barred(const Effect& effect) const {
  return std::any_of(barred_.begin(), barred_.end(),
                     [&](const Reading& one) { return same_reading(one, reading_of(effect)); });
}

// The likeliest that proves itself. What does not is left out until another name is found, beside
// which it may.
bool Search::add_round() {
  Round round;
  for (std::size_t place = 0; place < regressions_.size(); ++place) {
    if (!is_over(kLeftToCheck)) look(place, round);
  }
  barred_.clear();
  while (barred_.size() < kBarredMax) {
    // The best of some of the proposals may be none of all of them.
    if (is_over(kLeftToCheck)) {
      leave_open("whether there are further effects");
      return false;
    }
    const auto best = likeliest(round.candidates);
    if (best == round.candidates.end() || best->margin() < 0.0) return false;
    const bool judged = is_timing(best->effect) && !study_->recording().has_reference;
    Found taken = judged ? judge_timing(*best, round.timing) : *best;
    // What is weaker than what interpolation leaves may be a piece of it.
    if (is_left_of_timing(taken)) return false;
    const Effect looked_likeliest = best->effect;
    leave_out(taken.effect, round);
    leave_out(looked_likeliest, round);
    if (taken.margin() >= 0.0 && add(std::move(taken))) return true;
  }
  return false;
}

void Search::leave_out(const Effect& effect, Round& round) {
  if (is_barred(effect)) return;
  barred_.push_back(reading_of(effect));
  const auto erase_from = [&](auto& list) {
    list.erase(std::remove_if(list.begin(), list.end(),
                              [&](const auto& one) { return is_barred(one.effect); }),
               list.end());
  };
  erase_from(round.candidates);
  erase_from(round.timing);
}

// False, and all as before, when it does not prove itself.
bool Search::add(Found taken) {
  const std::vector<Found> before = found_;
  const std::shared_ptr<const Study> study = study_;
  const PairNoise noise = noise_;
  if (taken.companion) {
    found_.push_back(taken);
    found_.back().effect = *taken.companion;
    found_.back().of_reference = true;
  }
  found_.push_back(std::move(taken));
  free_reference();
  const bool is_step = row(found_.back().effect.kind).finder == Finder::kStep;
  settle();
  if (is_step) place_again();
  const std::size_t last = found_.size() - 1;
  if (found_.size() > before.size() + 1 || (keeps_its_size(last) && is_proven(last))) return true;
  doubtful_.push_back(found_.back());
  found_ = before;
  noise_ = noise;
  take(study);
  return false;
}

// Of what goes with the temperature the zero is no gyro's own: where a line, or a line and a
// parabola, with a bias beside them are far better, the one that was found last is a piece of them.
void Search::free_reference() {
  const Effect last = found_.back().effect;
  if (last.kind != Kind::kTemperatureBias && last.kind != Kind::kTemperatureBiasQuadratic) return;
  const std::size_t place = place_of(last);
  const Regression& regression = regressions_[place];
  const Effects before = terms(place, found_.size() - 1);
  if (has_any(before, last.gyro, {Kind::kBias, last.kind})) return;
  const Effect line{last.gyro, Kind::kTemperatureBias, {0.0, last.parameters[1]}, 0};
  const Effect parabola{last.gyro, Kind::kTemperatureBiasQuadratic, {0.0, last.parameters[1]}, 0};
  const Effect bias{last.gyro, Kind::kBias, {0.0}, 0};
  const double single = regression.fit(terms(place), noise_).log_likelihood;
  double best_gain = 0.0;
  Effects best;
  for (const Effects& more : {Effects{line, bias}, Effects{line, parabola, bias}}) {
    Effects with = before;
    with.insert(with.end(), more.begin(), more.end());
    const double gain = 2.0 * (regression.fit(with, noise_).log_likelihood - single) -
                        kStatisticMin * (static_cast<double>(more.size()) - 1.0);
    if (gain <= best_gain) continue;
    best_gain = gain;
    best = more;
  }
  if (best.empty()) return;
  const Found found = found_.back();
  found_.pop_back();
  for (const Effect& effect : best) {
    found_.push_back(found);
    found_.back().effect = effect;
    found_.back().of_reference = effect.kind == Kind::kBias;
  }
}

// Without a line there is no reference to be told.
void Search::drop_lone_references() {
  const auto is_lone = [&](const Found& bias) {
    return bias.of_reference && std::none_of(found_.begin(), found_.end(), [&](const Found& one) {
             return one.effect.kind == Kind::kTemperatureBias &&
                    one.effect.gyro == bias.effect.gyro;
           });
  };
  std::vector<Found> kept;
  std::copy_if(found_.begin(), found_.end(), std::back_inserter(kept),
               [&](const Found& one) { return !is_lone(one); });
  found_ = std::move(kept);
}

// The terms with the motion that they give, each from the other in turn, on studies of their own.
Search::Trial Search::fit_with_motion(Effects terms) const {
  Trial tried;
  Fit& fitted = tried.fit;
  fitted.terms = std::move(terms);
  std::shared_ptr<const Study> trial;
  for (int turn = 0; turn < kMotionTurns; ++turn) {
    Effects effects = regressions_.front().with_known(fitted.terms);
    effects.insert(effects.end(), starting_noise_.begin(), starting_noise_.end());
    trial = trial ? trial->with_motion_moved(effects) : study_->with_motion_on_trial(effects);
    const Regression regression(trial->observations().front(), known_, Part::kFit);
    const double before = fitted.log_likelihood;
    fitted = regression.fit_beside(fitted.terms, noise_, Fit{{}, noise_, 0.0, {}});
    const double gained = fitted.log_likelihood - before;
    tried.by_motion = regression.log_likelihood_by_motion(fitted.terms, fitted.noise);
    if (turn > 0 && (std::abs(gained) < kTurnsAlike || gained < -kTurnFails)) break;
  }
  return tried;
}

// `scores`: the likeliest of each reading comes first.
std::vector<Search::Rival> Search::timing_rivals(const Found& best,
                                                 const std::vector<Score>& scores) const {
  std::vector<Rival> rivals;
  for (const Score& score : scores) {
    const bool again = std::any_of(rivals.begin(), rivals.end(), [&](const Rival& one) {
      return same_reading(reading_of(one.found.effect), reading_of(score.effect));
    });
    if (again || score.adjusted() < kTimingRivalShare * scores.front().adjusted()) continue;
    if (rivals.size() >= kRivalsMax) break;
    Effects with = terms(0);
    with.push_back(score.effect);
    const Trial tried = fit_with_motion(std::move(with));
    Rival rival{best, 0.0};
    rival.found.effect = tried.fit.terms.back();
    rival.found.penalty = score.penalty;
    rival.found.statistic = 2.0 * tried.fit.log_likelihood;
    rival.by_motion = 2.0 * tried.by_motion - score.penalty;
    rivals.push_back(std::move(rival));
  }
  std::sort(rivals.begin(), rivals.end(),
            [](const Rival& a, const Rival& b) { return a.found.adjusted() > b.found.adjusted(); });
  return rivals;
}

// A delay is reckoned by what the other gyro reads, a low-pass by the motion in it: what these ways
// differ by for one delay is noise that it takes off, no reason to prefer it to a low-pass; and a
// low-pass takes off twice as much.
bool Search::is_close_to(const Rival& first, const Rival& other, double gain) {
  const bool one_way = passes_low(other.found.effect) == passes_low(first.found.effect);
  const double doubt =
      one_way ? 0.0
              : kLowPassDoubts * std::max(std::abs(first.by_ways()), std::abs(other.by_ways()));
  return is_close(other.found.adjusted(), first.found.adjusted() - doubt, gain);
}

// Without a reference the rate is a mean of readings, late ones among them: what is late, and how,
// is judged by the rate that each answer gives.
Found Search::judge_timing(Found best, const std::vector<Score>& scores) const {
  const std::vector<Rival> rivals = timing_rivals(best, scores);
  if (rivals.empty()) return best;
  const double gain = best.adjusted();
  const Found& first = rivals.front().found;
  // Which of two clocks is the wrong one, no reading says.
  const bool is_clock = first.effect.kind == Kind::kClockSkew;
  if (is_clock) best.ambiguous_with.push_back(other_clock_of(first.effect));
  best.effect = first.effect;
  best.penalty = first.penalty;
  // At the motion of the present terms any other lateness looks great: each has its own.
  best.statistic = first.statistic - 2.0 * fit_with_motion(terms(0)).fit.log_likelihood;
  for (std::size_t i = 1; i < rivals.size(); ++i) {
    const Effect& effect = rivals[i].found.effect;
    const bool other_clock = is_clock && effect.kind == Kind::kClockSkew;
    if (!other_clock && is_close_to(rivals.front(), rivals[i], gain))
      best.ambiguous_with.push_back(reading_of(effect));
  }
  return best;
}

// All found terms together, with their noise.
void Search::settle() {
  drop_lone_references();
  renew_motion();
  for (std::size_t place = 0; place < regressions_.size(); ++place)
    settle(place);
}

void Search::settle(std::size_t place) {
  const Regression& regression = regressions_[place];
  Fit all = regression.fit(terms(place), noise_);
  keep_noise(place, all.noise);
  // A drift that happened to be small once is no smaller than the model says: values and their
  // errors would seem surer than they are.
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    all.noise[gyro].walk_dps_rts =
        std::max(all.noise[gyro].walk_dps_rts, model_noise_[gyro].walk_dps_rts);
  }
  regression.improve(all);
  const std::vector<model::Parameters> sigmas = sigmas_of(all);
  std::size_t term = 0;
  for (Found& found : found_) {
    if (is_noise(found) || place_of(found.effect) != place) continue;
    found.effect = all.terms[term];
    tidy_phase(found.effect);
    found.sigma = sigmas[term++];
  }
}

// A step's instant, now that the noise is known that is left with it. What was set aside about it
// is needed to see it.
void Search::place_again() {
  bool any = false;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    if (row(found_[i].effect.kind).finder != Finder::kStep) continue;
    const double at_s = found_[i].effect.parameters[1];
    take(study_->with_used_for_fit({at_s - kStepReach_s, at_s + kStepReach_s}));
    const std::size_t place = place_of(found_[i].effect);
    const Fit null{terms(place, i), noise_, 0.0, {}};
    found_[i].effect = placed(regressions_[place], null, found_[i].effect);
    any = true;
  }
  if (any) settle();
}

// Each found effect against all others in its place.
void Search::replace_round() {
  for (std::size_t i = 0; i < found_.size(); ++i) {
    if (!is_over(kLeftToScore)) replace(i);
    if (is_over(kLeftToScore)) found_[i].unchecked = true;
  }
}

void Search::replace(std::size_t index) {
  if (!found_[index].is_name()) return;
  Found& mine = found_[index];
  const std::size_t place = place_of(mine.effect);
  const Regression& regression = regressions_[place];
  const Fit null = regression.fit(terms(place, index), noise_);
  const std::vector<Score> scores = scan(place).scores(null, noise_);
  Effects with = null.terms;
  with.push_back(mine.effect);
  mine.statistic =
      2.0 * (regression.fit(std::move(with), noise_).log_likelihood - null.log_likelihood);
  if (is_timing(mine.effect) && !study_->recording().has_reference) return;
  mine.ambiguous_with.clear();
  std::vector<Score> rivals;
  for (const Score& score : scores) {
    const bool same = same_reading(reading_of(score.effect), reading_of(mine.effect));
    if (same && !row(mine.effect.kind).forms_differ) continue;
    if (score.adjusted() > kRivalShare * mine.adjusted() - kRivalMargin) rivals.push_back(score);
  }
  const Found own = mine;
  bool replaced = false;
  for (const Found& other : refitted(place, null, noise_, rivals, kRivalsMax)) {
    const Reading reading = reading_of(other.effect);
    if (same_reading(reading, reading_of(own.effect)) || !is_plausible(other.effect)) continue;
    if (is_left_of_timing(other)) continue;
    if (same_reading(reading, reading_of(mine.effect))) continue;
    if (!replaced && other.adjusted() > own.adjusted() + kBetter) {
      mine = other;
      mine.needed = own.needed;
      if (is_close(own.adjusted(), other.adjusted(), other.adjusted()))
        mine.ambiguous_with.push_back(reading_of(own.effect));
      replaced = true;
    } else if (is_close(other.adjusted(), mine.adjusted(), mine.adjusted())) {
      mine.ambiguous_with.push_back(reading);
    }
  }
  if (replaced) settle();
}

void Search::delete_backward() {
  for (std::size_t i = 0; i < found_.size();) {
    if (!found_[i].is_name() || found_[i].margin() >= kFallen) {
      ++i;
      continue;
    }
    found_.erase(found_.begin() + static_cast<std::ptrdiff_t>(i));
    if (is_over(kLeftToScore)) continue;
    settle();
    replace_round();
    i = 0;
  }
}

bool Search::keeps_its_size(std::size_t index) const {
  const Found& one = found_[index];
  if (!row(one.effect.kind).keeps_size) return true;
  const std::size_t place = place_of(one.effect);
  const Effects all = terms(place);
  const auto at =
      static_cast<std::size_t>(std::find(all.begin(), all.end(), one.effect) - all.begin());
  return !change_over_time(regressions_[place], all, at, noise_).is_beyond_chance(one.statistic);
}

// What is in the catalogue keeps its size throughout; what only resembles it does not.
void Search::reject_unsteady() {
  std::vector<bool> wrong = pieces_of_something_else(found_);
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const Found& one = found_[i];
    if (is_over(kLeftToScore)) found_[i].unchecked = true;
    if (wrong[i] || !one.is_name() || found_[i].unchecked) continue;
    wrong[i] = !keeps_its_size(i);
  }
  if (std::none_of(wrong.begin(), wrong.end(), [](bool one) { return one; })) return;
  std::vector<Found> kept;
  for (std::size_t i = 0; i < found_.size(); ++i)
    (wrong[i] ? rejected_ : kept).push_back(found_[i]);
  found_ = std::move(kept);
  settle();
}

// What 2·log-likelihood gains on held-out samples.
double Search::held_out_gain(std::size_t index) const {
  const std::size_t place = place_of(found_[index].effect);
  const Regression& regression = regressions_[place];
  Fit without{terms(place, index), noise_, 0.0, {}};
  regression.improve(without);
  const Regression held_out(study_->observations()[place], known_, Part::kHeldOut);
  return 2.0 * (held_out.log_likelihood(terms(place), noise_) -
                held_out.log_likelihood(without.terms, noise_));
}

// Beyond what it needs, too, where the residual and not the noise's model says how sure it is.
bool Search::is_sure_by_residual(std::size_t index) {
  Found& one = found_[index];
  const std::size_t place = place_of(one.effect);
  const Effects all = terms(place);
  const auto at =
      static_cast<std::size_t>(std::find(all.begin(), all.end(), one.effect) - all.begin());
  const double more = inflation(regressions_[place], Fit{all, noise_, 0.0, {}}, at);
  for (double& sigma : one.sigma)
    sigma *= std::sqrt(more);
  return one.statistic / more - one.penalty >= std::min(one.needed, kStatisticMin) + kFallen;
}

// A name foretells samples that had no part in it: of what the fit gains a third, for they are a
// quarter of all. One that does not, within what chance does to such a gain, is none.
bool Search::is_proven(std::size_t index) {
  const double expected = found_[index].statistic * kHeldOutShare;
  const double chance = 2.0 * kProofSigmas * std::sqrt(std::max(0.0, expected));
  const double needed = std::max(0.0, expected - std::max(chance, kProofShare * expected));
  return is_sure_by_residual(index) && held_out_gain(index) >= needed;
}

void Search::reject_unproven() {
  bool any = false;
  for (std::size_t i = 0; i < found_.size();) {
    if (!found_[i].is_name() || is_noise(found_[i]) || is_proven(i)) {
      ++i;
      continue;
    }
    rejected_.push_back(found_[i]);
    found_.erase(found_.begin() + static_cast<std::ptrdiff_t>(i));
    settle();
    any = true;
    i = 0;
  }
  if (any) replace_round();
}

// What was left out when it was tried, and is in nothing that was found since.
void Search::keep_doubtful() {
  for (const Found& one : doubtful_) {
    const auto is_it = [&](const Found& other) {
      return same_reading(reading_of(other.effect), reading_of(one.effect));
    };
    if (std::none_of(found_.begin(), found_.end(), is_it) &&
        std::none_of(rejected_.begin(), rejected_.end(), is_it) && is_barred(one.effect))
      rejected_.push_back(one);
  }
}

void Search::noise_rounds() {
  std::array<bool, 2> may{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    // What is left of something unknown is no noise.
    const bool unknown = std::any_of(rejected_.begin(), rejected_.end(), [&](const Found& one) {
      return one.effect.gyro == gyro || regressions_.size() == 1;
    });
    may[gyro] = !unknown && !study_->is_coarse(gyro);
  }
  for (int round = 0; round < kNoiseRoundsMax; ++round) {
    if (is_over(kLeftToScore)) return leave_open("what noise the model lacks");
    std::vector<NoiseQuestion> questions;
    for (std::size_t place = 0; place < regressions_.size(); ++place)
      questions.push_back({&regressions_[place], terms(place)});
    auto best = find_noise(questions, model_noise_, may);
    if (!best || best->found.adjusted() < kNoiseMin || is_left_of_timing(best->found)) return;
    model_noise_[best->found.effect.gyro] = best->terms;
    found_.push_back(std::move(best->found));
  }
}

double Search::drift_statistic(std::size_t gyro) const {
  double sum = 0.0;
  for (const Found& one : found_) {
    if (one.effect.gyro == gyro && is_drift(row(one.effect.kind).random)) sum += one.statistic;
  }
  return sum;
}

// Names that were taken because noise beyond the model's was no better: now that such noise has a
// name beside them, they must stand by themselves. A small line in much drift is a part of it.
bool Search::reject_beside_noise() {
  std::vector<Found> kept;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const Found& one = found_[i];
    const double drift = drift_statistic(one.effect.gyro);
    if (drift == 0.0 || is_noise(one) || !one.is_name() || one.needed >= kStatisticMin) {
      kept.push_back(one);
      continue;
    }
    const double statistic = statistic_beside(i);
    if (row(one.effect.kind).finder == Finder::kLine && statistic < kLineShare * drift) {
      rejected_.push_back(one);
    } else if (statistic - one.penalty >= kStatisticMin) {
      kept.push_back(one);
    }
  }
  if (kept.size() == found_.size()) return false;
  found_ = std::move(kept);
  return true;
}

// Of one found effect, beside all others and the noise with what was named.
double Search::statistic_beside(std::size_t index) const {
  const std::size_t place = place_of(found_[index].effect);
  const auto fitted = [&](Effects terms) {
    Fit fit{std::move(terms), model_noise_, 0.0, {}};
    regressions_[place].improve(fit);
    return regressions_[place].log_likelihood(fit.terms, fit.noise);
  };
  return 2.0 * (fitted(terms(place)) - fitted(terms(place, index)));
}

// All that may speak against the names; a name that the time was too short for stays unchecked.
void Search::check() {
  if (!is_over(kLeftToScore)) place_again();
  replace_round();
  delete_backward();
  reject_unsteady();
  if (!is_over(kLeftToScore)) reject_unproven();
  const bool all =
      std::none_of(found_.begin(), found_.end(), [](const Found& one) { return one.unchecked; });
  if (!all) leave_open("whether what was found may also be something else");
}

void Search::run() {
  const auto tell = [&](std::string_view what, double share) {
    if (progress) progress(what, share);
  };
  start();
  for (std::size_t round = 0; round < kFoundMax; ++round) {
    const auto done = static_cast<double>(round);
    tell("scoring candidates", kShareBegun + kShareAdding * done / (done + 2.0));
    if (!add_round()) break;
    if (found().size() > 1) replace_round();
  }
  keep_doubtful();
  tell("weighing rivals", kShareRivals);
  check();
  tell("fitting the noise", kShareNoise);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!unknown_noise_[gyro]) continue;
    model_noise_[gyro] = noise_[gyro];
    model_noise_[gyro].ratio_rthz = 0.0;
    model_noise_[gyro].markov.clear();
  }
  starting_noise_ = noise_effects(model_noise_);
  const PairNoise model_noise = model_noise_;
  noise_rounds();
  while (reject_beside_noise()) {
    found_.erase(std::remove_if(found_.begin(), found_.end(), is_noise), found_.end());
    model_noise_ = model_noise;
    settle();
    noise_rounds();
  }
  // The last values and the noise belong to the motion too.
  renew_motion();
}

void Search::accept(const std::vector<Acceptance>& accept) {
  if (!accept_readings(accept, found_)) return;
  model_noise_ = noise_of(effects());
  settle();
  renew_motion();
}

}  // namespace vgyro::gap
