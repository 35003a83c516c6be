#include "gap/study.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/core.h>

#include "gap/rest.h"
#include "gap/spikes.h"
#include "gap/timing.h"
#include "gap/wiener.h"

namespace vgyro::gap {

// What no motion changes.
struct Study::Facts {
  explicit Facts(const Recording& from) : recording(from) {}

  const Recording& recording;
  std::array<Transport, 2> transports;
  std::array<SampledCurve, 2> readings;  ///< samples that are not masked
  std::vector<double> second_dps;        ///< gyro 2 at the instants of gyro 1
  SampledCurve reference;                ///< as it was sampled
  std::array<double, 3> quiet{};         ///< variance of a sample of each gyro and of the reference
  std::array<FastMotion, 2> fast;        ///< as each gyro is compared; without a reference alike
  Timing timing;
  RestingSeconds rest;
  std::vector<Finding> findings;
  std::vector<std::string> notes;

  // What transport, timing and spikes found, in this order.
  void gather(const std::vector<Finding>& spikes) {
    const auto append = [](auto& list, const auto& more) {
      list.insert(list.end(), more.begin(), more.end());
    };
    append(notes, timing.notes);
    for (const Transport& transport : transports) {
      append(findings, transport.findings);
      append(notes, transport.notes);
    }
    append(findings, timing.findings);
    append(findings, spikes);
  }

  void learn_fast_motion() {
    quiet = {quiet_variance(readings[0]), quiet_variance(readings[1]), quiet_variance(reference)};
    if (!recording.has_reference) {
      for (const double t_s : readings[0].times_s())
        second_dps.push_back(readings[1].value_at(t_s));
      fast[0] = FastMotion(readings[0], readings[1]);
      return;
    }
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      fast[gyro] = FastMotion(readings[gyro], reference);
  }
};

// What several recordings have in common.
struct Study::Joint {
  Recording summary;
  std::vector<double> from_s;
  std::vector<Finding> findings;
  std::vector<std::string> notes;
};

namespace {

using model::Effect;

constexpr double kRecordingMin_s = 30.0;
constexpr std::size_t kSamplesMin = 500;
constexpr double kReferenceShareMin = 0.95;
// Time is cut into cells from the first frame to the last: what lies between must not be much more
// than what the gyros fill, or a clock that was set by a year would ask for a year's cells.
constexpr double kSpanPerSecond = 10.0;
constexpr double kPauseMost_s = 3600.0;
constexpr double kRestMin_s = 10.0;
// Share of samples that repeat the last one.
constexpr double kCoarseRepeats = 0.2;
// Where both come late each round takes off what the other's lateness left of the last.
constexpr int kMotionRounds = 8;
constexpr double kMotionSame_dps = 2e-6;
constexpr double kMotionSameShare = 0.03;  // of the noise of a sample
// Of samples a curve may lack before what lies between is not known: a reference is smooth, a gyro
// is not.
constexpr double kReferenceHole = 3.0;
constexpr double kGyroHole = 1.5;
// Between two recordings, and in whole tens of seconds: stretches of time that are judged as one
// then hold samples of one recording only.
constexpr double kBetween_s = 10.0;
// A gyro's intervals in several recordings are one clock's, or it was not set up alike.
constexpr double kOtherInterval = 0.1;

Effects of_gyro(const Effects& effects, std::size_t gyro) {
  Effects mine;
  for (const Effect& effect : effects) {
    if (effect.gyro == gyro) mine.push_back(effect);
  }
  return mine;
}

std::string span_text(const GyroSeries& gyro) {
  return fmt::format("{} from {:.1f} to {:.1f} s", gyro.name, gyro.t_s.front(), gyro.t_s.back());
}

// Whole seconds in which the gyro is there; its stamps never decrease.
double seconds_filled(const std::vector<double>& t_s) {
  double filled = 0.0;
  double newest = -1.0;
  for (const double t : t_s) {
    const double second = std::floor(t);
    if (second > newest || filled == 0.0) filled += 1.0;
    newest = second;
  }
  return filled;
}

Expected<void> check_spans(const Recording& recording) {
  const auto& [a, b] = recording.gyros;
  const double common_s =
      std::min(a.t_s.back(), b.t_s.back()) - std::max(a.t_s.front(), b.t_s.front());
  if (common_s < kRecordingMin_s) {
    return fail(
        "",
        fmt::format("the gyros are not there at the same time, or too shortly: {}, {}",
                    span_text(a), span_text(b)),
        fmt::format("at least {:.0f} s of both, with the stamps of one clock", kRecordingMin_s));
  }
  const double filled_s = std::max(seconds_filled(a.t_s), seconds_filled(b.t_s));
  if (recording.seconds <= kSpanPerSecond * filled_s + kPauseMost_s) return {};
  return fail(
      "",
      fmt::format("from the first frame to the last it is {:.0f} s, and the gyros are there "
                  "in {:.0f} s of them: {}, {}",
                  recording.seconds, filled_s, span_text(a), span_text(b)),
      "cut the recording at its pauses, or where the clock was set, and judge the parts");
}

Expected<void> check(const Recording& recording) {
  for (const GyroSeries& gyro : recording.gyros) {
    if (gyro.t_s.size() < kSamplesMin || recording.seconds < kRecordingMin_s) {
      return fail(
          "",
          fmt::format("the recording is too short: {:.1f} s, {} samples of {}", recording.seconds,
                      gyro.t_s.size(), gyro.name),
          fmt::format("at least {:.0f} s and {} samples of each gyro; ten minutes with rest "
                      "and motion tell much more",
                      kRecordingMin_s, kSamplesMin));
    }
  }
  if (auto good = check_spans(recording); !good) return good;
  if (!recording.has_reference) return {};
  const std::vector<double>& t_s = recording.reference_dps.t_s;
  if (t_s.size() < kSamplesMin) {
    return fail("",
                fmt::format("the configuration names a reference, but the recording holds {} of "
                            "its samples",
                            t_s.size()),
                "record it too, or remove [reference] from the configuration");
  }
  if (t_s.back() - t_s.front() < kReferenceShareMin * recording.seconds) {
    return fail("",
                fmt::format("the reference is there from {:.1f} to {:.1f} s only, the recording "
                            "lasts {:.1f} s",
                            t_s.front(), t_s.back(), recording.seconds),
                "cut the recording to that part, or remove [reference] from the configuration");
  }
  return {};
}

// Weights of the two readings in their mean: by their noise, where it is known.
std::array<double, 2> weights(const PairNoise& noise, const std::array<double, 2>& interval_s) {
  std::array<double, 2> density{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (noise[gyro].white_dps_rthz <= 0.0) return {0.5, 0.5};
    density[gyro] = noise[gyro].variance(0.0, interval_s[gyro]) * interval_s[gyro];
  }
  const double sum = density[0] + density[1];
  return {density[1] / sum, density[0] / sum};
}

double greatest_change(const std::vector<double>& a, const std::vector<double>& b) {
  double change = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    change = std::max(change, std::abs(a[i] - b[i]));
  return change;
}

Channel channel_of(std::size_t gyro) {
  return gyro == 0 ? Channel::kGyro1 : Channel::kGyro2;
}

}  // namespace

const Recording& Study::recording() const {
  return joint_ ? joint_->summary : facts_->recording;
}
const Transport& Study::transport(std::size_t gyro) const {
  return facts_->transports[gyro];
}
const std::vector<Finding>& Study::findings() const {
  return joint_ ? joint_->findings : facts_->findings;
}
const std::vector<std::string>& Study::notes() const {
  return joint_ ? joint_->notes : facts_->notes;
}
double Study::reference_late_s() const {
  if (!joint_) return facts_->timing.reference_late_s;
  for (const auto& part : parts_)
    if (part->reference_late_s() != 0.0) return part->reference_late_s();
  return 0.0;
}

bool Study::is_coarse(std::size_t gyro) const {
  if (joint_) {
    return std::any_of(parts_.begin(), parts_.end(),
                       [&](const auto& part) { return part->is_coarse(gyro); });
  }
  const Transport& its = transport(gyro);
  return its.lattice_dps > 0.0 && its.repeats > kCoarseRepeats;
}

std::size_t Study::place_of(std::size_t gyro) const {
  return observations_.size() == 2 ? gyro : 0;
}

// Each gyro's, and the reference's motion.
void Study::set_signals(const Recording& recording) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    auto signals = std::make_shared<Signals>();
    set_circumstances(recording.gyros[gyro], recording.acceleration, *signals);
    signals_[gyro] = std::move(signals);
  }
}

Expected<std::shared_ptr<const Study>> Study::begin(const Recording& recording,
                                                    const Effects& effects) {
  if (auto good = check(recording); !good) return tl::unexpected(good.error());
  auto facts = std::make_shared<Facts>(recording);
  const std::shared_ptr<Study> study(new Study);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    facts->transports[gyro] = check_transport(recording.gyros[gyro], gyro, of_gyro(effects, gyro));
  // Lateness before spikes: what stands out at the wrong instant is none.
  facts->timing = find_timing(recording, facts->transports, effects);
  study->set_signals(recording);
  // What a finding costs is known when the spikes are masked too.
  const std::vector<Finding> spikes =
      find_spikes(recording, facts->timing, facts->transports, effects);
  facts->gather(spikes);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const ScalarSeries good = usable(recording.gyros[gyro], facts->transports[gyro]);
    facts->readings[gyro] = SampledCurve(good.t_s, good.value);
    const std::size_t left = facts->readings[gyro].times_s().size();
    if (left >= kSamplesMin) continue;
    return fail("",
                fmt::format("{} samples of {} are left when what is stuck, clipped or in a dead "
                            "band is set aside",
                            left, recording.gyros[gyro].name),
                "record with a sensor that moves");
  }
  facts->reference =
      SampledCurve(facts->timing.reference_dps.t_s, facts->timing.reference_dps.value);
  if (!recording.has_reference) facts->rest = find_rest(recording, facts->transports);
  // A rest that is too short tells no bias, and might be none.
  if (!recording.has_reference && facts->rest.count() < kRestMin_s) {
    facts->rest = RestingSeconds();
    facts->notes.emplace_back(
        "the recording holds no rest, and there is no reference: only the difference of the gyros "
        "is judged, which does not tell which of them an effect is of; a minute at rest or a "
        "[reference] would");
  }
  facts->learn_fast_motion();
  // A clock that runs away moves all that is learnt of the motion.
  Effects known = effects;
  for (const Finding& finding : facts->timing.findings)
    known.push_back(finding.effect);
  study->facts_ = std::move(facts);
  study->learn_motion(known);
  study->observe(study->observed(), known);
  return std::shared_ptr<const Study>(study);
}

namespace {

// What two recordings show of one thing is told once, as the one has it that shows it best.
void add_finding(Finding finding, double from_s, std::vector<Finding>& findings) {
  finding.where.from_s += from_s;
  finding.where.to_s += from_s;
  const auto same = std::find_if(findings.begin(), findings.end(), [&](const Finding& other) {
    return other.effect.kind == finding.effect.kind && other.effect.gyro == finding.effect.gyro;
  });
  if (same == findings.end()) {
    findings.push_back(std::move(finding));
    return;
  }
  const double cost_nats = same->cost_nats + finding.cost_nats;
  if (finding.statistic > same->statistic) *same = std::move(finding);
  same->cost_nats = cost_nats;
}

Expected<void> check_alike(const Study& first, const Study& other, std::size_t number) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double interval_s = first.transport(gyro).interval_s;
    const double other_s = other.transport(gyro).interval_s;
    if (std::abs(other_s - interval_s) <= kOtherInterval * interval_s) continue;
    return fail("",
                fmt::format("{} sends every {:.4g} s in recording 1 and every {:.4g} s in "
                            "recording {}",
                            first.recording().gyros[gyro].name, interval_s, other_s, number),
                "judge recordings of another rate by themselves");
  }
  return {};
}

// A recording by its number; they have no names here.
Error of_recording(Error error, std::size_t number) {
  error.what = fmt::format("recording {}: {}", number, error.what);
  return error;
}

}  // namespace

Expected<std::shared_ptr<const Study>> Study::begin(const std::vector<Recording>& recordings,
                                                    const Effects& effects) {
  if (recordings.size() == 1) return begin(recordings.front(), effects);
  auto joint = std::make_shared<Joint>();
  std::vector<std::shared_ptr<const Study>> parts;
  double end_s = 0.0;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    auto part = begin(recordings[i], effects);
    if (!part) return tl::unexpected(of_recording(part.error(), i + 1));
    if (i > 0) end_s = kBetween_s * std::ceil(end_s / kBetween_s + 1.0);
    joint->from_s.push_back(end_s);
    for (const Finding& finding : (*part)->findings())
      add_finding(finding, end_s, joint->findings);
    for (const std::string& note : (*part)->notes())
      joint->notes.push_back(fmt::format("recording {}: {}", i + 1, note));
    end_s += recordings[i].seconds;
    parts.push_back(*std::move(part));
    if (auto alike = check_alike(*parts.front(), *parts.back(), i + 1); !alike) {
      return tl::unexpected(alike.error());
    }
  }
  joint->summary.seconds = end_s;
  joint->summary.has_reference = recordings.front().has_reference;
  joint->summary.has_acceleration = recordings.front().has_acceleration;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    joint->summary.gyros[gyro].name = recordings.front().gyros[gyro].name;
  joint->notes.emplace_back(
      "steps and lines are not looked for in several recordings together: no instant comes twice, "
      "and no phase is kept; judge the recording that shows one by itself");
  return joined(std::move(parts), std::move(joint), effects);
}

std::shared_ptr<const Study> Study::joined(std::vector<std::shared_ptr<const Study>> parts,
                                           std::shared_ptr<const Joint> joint,
                                           const Effects& effects) {
  const std::shared_ptr<Study> study(new Study);
  for (std::size_t place = 0; place < parts.front()->observations().size(); ++place) {
    std::vector<const Observations*> each;
    each.reserve(parts.size());
    for (const auto& part : parts)
      each.push_back(part->observations()[place].get());
    study->observations_.push_back(
        std::make_shared<Observations>(join(each, joint->from_s, effects)));
  }
  study->parts_ = std::move(parts);
  study->joint_ = std::move(joint);
  return study;
}

std::vector<Span> Study::drives() const {
  std::vector<Span> spans;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const double from_s = joint_->from_s[i];
    spans.push_back({from_s, from_s + parts_[i]->recording().seconds});
  }
  return spans;
}

std::shared_ptr<const Study> Study::with_motion(const Effects& effects) const {
  if (joint_) {
    std::vector<std::shared_ptr<const Study>> parts;
    parts.reserve(parts_.size());
    for (const auto& part : parts_)
      parts.push_back(part->with_motion(effects));
    // No step is looked for, and so none has taken seconds for the fit.
    return joined(std::move(parts), joint_, effects);
  }
  const std::shared_ptr<Study> study(new Study(*this));
  if (!recording().has_reference) study->learn_motion(effects);
  study->observe(study->observed_with_motion(), effects);
  return study;
}

std::shared_ptr<const Study> Study::with_motion_on_trial(const Effects& effects) const {
  return on_trial(effects, true);
}
std::shared_ptr<const Study> Study::with_motion_moved(const Effects& effects) const {
  return on_trial(effects, false);
}

std::shared_ptr<const Study> Study::on_trial(const Effects& effects, bool anew) const {
  if (joint_) return with_motion(effects);
  const std::shared_ptr<Study> study(new Study(*this));
  study->learn_motion(effects, anew);
  std::vector<Observations> list = study->observed_with_motion();
  for (std::size_t place = 0; place < list.size(); ++place) {
    list[place].layout = observations_[place]->layout;
    study->observations_[place] = std::make_shared<Observations>(std::move(list[place]));
  }
  return study;
}

std::shared_ptr<const Study> Study::with_used_for_fit(Span span) const {
  const std::shared_ptr<Study> study(new Study(*this));
  study->for_fit_.push_back(span);
  for (auto& data : study->observations_)
    data = std::make_shared<Observations>(data->with_for_fit(study->for_fit_));
  return study;
}

namespace {

// What one gyro's effects add to the rate, at the same instants again and again while the motion is
// being learned.
class Beside {
 public:
  Beside(const Effects& effects, const Signals& signals, std::span<const double> t_s)
      : effects_(effects), equation_(effects), t_s_(t_s) {
    needs_angle_ = std::any_of(effects.begin(), effects.end(), [](const Effect& effect) {
      return effect.kind == model::Kind::kAngleHarmonic;
    });
    if (!equation_.adds()) return;
    surroundings_.reserve(t_s.size());
    for (const double at_s : t_s)
      surroundings_.push_back(signals.without_motion_at(equation_.true_time_s(at_s)));
  }

  // Lateness is reckoned by the other gyro's motion.
  [[nodiscard]] bool is_by_other() const {
    return equation_.is_late() && equation_.cutoffs_hz().empty() &&
           equation_.second_orders().empty();
  }

  // The readings without it. Of the first guess, which knows no motion, without the offsets.
  [[nodiscard]] std::vector<double> taken_off(std::vector<double> values, const Signals& signals) {
    if (effects_.empty()) return values;
    const SampledCurve& on_time = signals.on_time(equation_).curve();
    if (on_time.empty()) {
      for (std::size_t i = 0; i < surroundings_.size(); ++i)
        values[i] -= equation_.offset_dps(surroundings_[i]);
      return values;
    }
    const Prediction prediction(effects_, signals);
    for (std::size_t i = 0; i < values.size(); ++i) {
      double added_dps =
          equation_.is_late() ? prediction.late_dps(t_s_[i]) - on_time.value_at(t_s_[i]) : 0.0;
      if (equation_.adds()) {
        const double late_dps = signals.motion.curve().value_at(t_s_[i]) + added_dps;
        if (needs_angle_)
          surroundings_[i].angle_rad = signals.motion.angle_rad(equation_.true_time_s(t_s_[i]));
        added_dps += equation_.added_dps(late_dps, surroundings_[i]);
      }
      values[i] -= added_dps;
    }
    return values;
  }

 private:
  const Effects& effects_;
  model::Equation equation_;
  std::span<const double> t_s_;
  std::vector<model::Surroundings> surroundings_;
  bool needs_angle_ = false;
};

}  // namespace

// Noise of the reference must not pass for motion, or a low-pass would seem to take it off.
void Study::learn_motion_of_reference() {
  const Motion motion{without_noise(facts_->reference, facts_->quiet[2])};
  for (auto& its : signals_) {
    const auto signals = std::make_shared<Signals>(*its);
    signals->motion = motion;
    its = signals;
  }
}

// The first guess knows no lateness; each further one takes off what the effects say at the last,
// until nothing changes. What one gyro says is what the other one's lateness is reckoned by.
void Study::learn_motion_of_pair(const Effects& effects, bool anew) {
  const std::array<double, 2> weight =
      weights(noise_of(effects), {transport(0).interval_s, transport(1).interval_s});
  const std::array<Effects, 2> mine{of_gyro(effects, 0), of_gyro(effects, 1)};
  const std::span<const double> t_s = facts_->readings[0].times_s();
  const std::array<std::vector<double>, 2> readings{
      std::vector<double>(facts_->readings[0].values().begin(), facts_->readings[0].values().end()),
      facts_->second_dps};
  std::array<std::shared_ptr<Signals>, 2> signals;
  std::vector<Beside> beside;
  double quiet = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    signals[gyro] = std::make_shared<Signals>(*signals_[gyro]);
    if (anew) signals[gyro]->motion = signals[gyro]->motion_by_other = Motion();
    signals_[gyro] = signals[gyro];
    beside.emplace_back(mine[gyro], *signals[gyro], t_s);
    quiet += weight[gyro] * weight[gyro] * facts_->quiet[gyro];
  }
  // Noise must not pass for motion, or what the effects make of it would come on top.
  const auto motion_of = [&](std::vector<double>& rate_dps, double variance) {
    for (std::size_t i = 0; i < t_s.size(); ++i)
      if (facts_->rest.at(t_s[i])) rate_dps[i] = recording().rest_rate_dps;
    return Motion{without_noise(facts_->readings[0].with_values(rate_dps), variance)};
  };
  const double same_dps = std::max(kMotionSame_dps, kMotionSameShare * std::sqrt(quiet));
  std::vector<double> rate_dps;
  for (int round = 0; round < kMotionRounds; ++round) {
    std::array<std::vector<double>, 2> told;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      told[gyro] = beside[gyro].taken_off(readings[gyro], *signals[gyro]);
      // The rate is set to the known one at rest: a drift would be an edge there, which looks late.
      // What a coarse gyro reads at rest is not what it reads too much elsewhere.
      if (!is_coarse(gyro))
        take_off_drift_at_rest(facts_->rest, t_s, recording().rest_rate_dps, told[gyro]);
    }
    std::vector<double> next_dps(t_s.size());
    for (std::size_t i = 0; i < t_s.size(); ++i)
      next_dps[i] = weight[0] * told[0][i] + weight[1] * told[1][i];
    const Motion motion = motion_of(next_dps, quiet);
    const bool settled = round > 0 && greatest_change(next_dps, rate_dps) < same_dps;
    const bool is_last = settled || round + 1 == kMotionRounds;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      signals[gyro]->motion = motion;
      if (is_last || beside[gyro].is_by_other())
        signals[gyro]->motion_by_other = motion_of(told[1 - gyro], facts_->quiet[1 - gyro]);
    }
    rate_dps = std::move(next_dps);
    if (!is_last) continue;
    // As motion_of() left them: at rest they stand on the known rate.
    const std::array<SampledCurve, 2> read{facts_->readings[0].with_values(told[0]),
                                           facts_->readings[0].with_values(told[1])};
    const std::array<double, 3>& noise = facts_->quiet;
    const std::size_t judge = noise[0] <= noise[1] ? 0 : 1;
    // There half of what the readings could tell of a lateness is told by their difference.
    const double least = noise[judge] + noise[0] * noise[1] / (noise[0] + noise[1]);
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      signals[gyro]->other_reading_dps = where_it_moves(read[1 - gyro], read[judge], least);
    break;
  }
}

void Study::learn_motion(const Effects& effects, bool anew) {
  if (recording().has_reference) {
    learn_motion_of_reference();
  } else {
    learn_motion_of_pair(effects, anew);
  }
}

Circumstances Study::circumstances() const {
  return {recording().seconds,
          recording().has_reference,
          {transport(0).interval_s, transport(1).interval_s},
          {is_coarse(0), is_coarse(1)},
          signals_};
}

Observations Study::against_reference(std::size_t gyro) const {
  const GyroSeries& series = recording().gyros[gyro];
  const Motion& motion = signals_[gyro]->motion;
  const SampledCurve& reference = facts_->reference;
  const double reach_s = kReferenceHole * reference.interval_s();
  std::vector<Observation> samples;
  samples.reserve(series.t_s.size());
  for (std::size_t i = 0; i < series.t_s.size(); ++i) {
    const double t_s = transport(gyro).t_s[i];
    if (transport(gyro).masked[i] != 0 || reference.hole_at(t_s, reach_s)) continue;
    if (t_s < reference.from_s() || t_s > reference.to_s()) continue;
    samples.push_back({t_s, channel_of(gyro), series.rate_dps[i] - reference.value_at(t_s),
                       motion.curve().value_at(t_s)});
  }
  return make_observations(std::move(samples), circumstances(), {gyro == 0, gyro == 1},
                           {&reference, 2}, facts_->quiet[2], for_fit_);
}

// Each gyro at rest, the difference elsewhere.
Observations Study::of_pair() const {
  const auto& readings = facts_->readings;
  std::vector<Observation> samples;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::span<const double> t_s = readings[gyro].times_s();
    const double rest_dps = recording().rest_rate_dps;
    for (std::size_t i = 0; i < t_s.size(); ++i) {
      if (!facts_->rest.deep_at(t_s[i])) continue;
      samples.push_back(
          {t_s[i], channel_of(gyro), readings[gyro].values()[i] - rest_dps, rest_dps});
    }
  }
  const std::span<const double> t_s = readings[0].times_s();
  const double reach_s = kGyroHole * readings[1].interval_s();
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    if (facts_->rest.deep_at(t_s[i]) || readings[1].hole_at(t_s[i], reach_s)) continue;
    samples.push_back({t_s[i], Channel::kDifference,
                       readings[0].values()[i] - facts_->second_dps[i],
                       signals_[0]->motion.curve().value_at(t_s[i])});
  }
  return make_observations(std::move(samples), circumstances(), {true, true}, {&readings[1], 1},
                           0.0, for_fit_);
}

std::vector<Observations> Study::observed() const {
  if (!recording().has_reference) return {of_pair()};
  return {against_reference(0), against_reference(1)};
}

// What is observed already, by the motion as it is now: a reference's is always the same.
std::vector<Observations> Study::observed_with_motion() const {
  std::vector<Observations> list;
  for (const auto& data : observations_)
    list.push_back(recording().has_reference ? *data : data->with_motion(signals_));
  return list;
}

void Study::observe(std::vector<Observations> list, const Effects& effects) {
  observations_.clear();
  for (std::size_t place = 0; place < list.size(); ++place) {
    list[place].learn_unseen_motion(facts_->fast[place], effects);
    observations_.push_back(std::make_shared<Observations>(std::move(list[place])));
  }
}

}  // namespace vgyro::gap
