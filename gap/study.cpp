#include "gap/study.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/core.h>

#include "gap/spikes.h"
#include "gap/wiener.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

constexpr std::size_t kRemembered = 24;
constexpr double kRecordingMin_s = 30.0;
constexpr std::size_t kSamplesMin = 500;
constexpr double kReferenceShareMin = 0.95;
// Time is cut into cells from the first frame to the last: what lies between must not be much more
// than what the gyros fill, or a clock that was set by a year would ask for a year's cells.
constexpr double kSpanPerSecond = 10.0;
constexpr double kPauseMost_s = 3600.0;
constexpr double kRestMin_s = 10.0;
/// Share of samples that repeat the last one.
constexpr double kCoarseRepeats = 0.2;
constexpr int kMotionRounds = 16;
constexpr double kMotionSame_dps = 2e-6;
constexpr double kHeldOutCell_s = 1.0;
constexpr unsigned kHeldOutOneIn = 4;

// A quarter of the seconds, scattered without a pattern that motion could have.
bool held_out(double t_s) {
  auto x = static_cast<std::uint64_t>(std::max(0.0, t_s / kHeldOutCell_s)) + 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return ((x ^ (x >> 31U)) % kHeldOutOneIn) == 0;
}

std::vector<Effect> of_gyro(const std::vector<Effect>& effects, std::size_t gyro) {
  std::vector<Effect> mine;
  for (const Effect& effect : effects) {
    if (effect.gyro == gyro) mine.push_back(effect);
  }
  return mine;
}

// White noise of a smooth quantity, from its fourth differences in the quieter half of the seconds.
double noise_variance(const ScalarSeries& series) {
  std::vector<double> seconds;
  double sum = 0.0;
  double count = 0.0;
  double begin_s = series.t_s.empty() ? 0.0 : series.t_s.front();
  for (std::size_t i = 4; i < series.value.size(); ++i) {
    const double* v = &series.value[i - 4];
    const double fourth = v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4];
    sum += fourth * fourth / 70.0;
    count += 1.0;
    if (series.t_s[i] - begin_s < 1.0) continue;
    seconds.push_back(sum / count);
    begin_s = series.t_s[i];
    sum = count = 0.0;
  }
  if (seconds.size() < 10) return 0.0;
  std::sort(seconds.begin(), seconds.end());
  return seconds[seconds.size() / 4];
}

struct Sample {
  double t_s;
  Channel channel;
  double observed_dps;
  double rate_dps;
};

// Where samples of another curve stand in what was observed: gyro 2's in a difference, the
// reference's everywhere.
struct Interpolated {
  const SampledCurve* curve = nullptr;
  std::size_t slot = 0;  ///< of the gains
};

// Of the samples' own noise, and of what is interpolated at their instants.
void set_gains(Block& block, std::span<const double> t_s, const Interpolated& other) {
  const double count = block.count;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const bool interpolated = other.slot == gyro && block.channel == Channel::kDifference;
    if (share_of(block.channel, gyro) == 0.0 || interpolated) continue;
    block.within_gain[gyro] = 1.0;
    block.mean_gain[gyro] = 1.0 / count;
  }
  if (other.curve == nullptr || (other.slot < 2 && block.channel != Channel::kDifference)) return;
  std::vector<double> sums;  // of each of its samples' weights
  std::size_t first = 0;
  double squares = 0.0;
  for (const double at_s : t_s) {
    const SampledCurve::Weights weights = other.curve->weights_at(at_s);
    if (sums.empty()) first = weights.first;
    if (weights.first < first) continue;  // times within a block increase
    sums.resize(std::max(sums.size(), weights.first - first + weights.value.size()), 0.0);
    for (std::size_t i = 0; i < weights.value.size(); ++i) {
      sums[weights.first - first + i] += weights.value[i];
      squares += weights.value[i] * weights.value[i];
    }
  }
  double of_mean = 0.0;
  for (const double sum : sums)
    of_mean += sum / count * sum / count;
  block.mean_gain[other.slot] = of_mean;
  if (block.count > 1) {
    block.within_gain[other.slot] =
        std::max(0.0, squares - count * of_mean) / static_cast<double>(block.count - 1);
  }
}

// Samples of any order → blocks, in which a sample's place is its place in the columns.
Problem assemble(std::vector<Sample> samples, std::array<double, 2> interval_s,
                 const Interpolated& other) {
  Problem problem;
  problem.layout.interval_s = interval_s;
  const double block_s = std::max(kBlock_s, 5.0 * std::max(interval_s[0], interval_s[1]));
  std::stable_sort(samples.begin(), samples.end(), [&](const Sample& a, const Sample& b) {
    const double cell_a = std::floor(a.t_s / block_s);
    const double cell_b = std::floor(b.t_s / block_s);
    if (cell_a != cell_b) return cell_a < cell_b;
    if (a.channel != b.channel) return a.channel < b.channel;
    return a.t_s < b.t_s;
  });
  const std::size_t n = samples.size();
  problem.t_s.resize(n);
  problem.channel.resize(n);
  problem.observed_dps.resize(static_cast<Eigen::Index>(n));
  problem.layout.samples = n;
  double cell = -1.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Sample& sample = samples[i];
    problem.t_s[i] = sample.t_s;
    problem.channel[i] = sample.channel;
    problem.observed_dps[static_cast<Eigen::Index>(i)] = sample.observed_dps;
    const double its_cell = std::floor(sample.t_s / block_s);
    std::vector<Block>& blocks = problem.layout.blocks;
    if (blocks.empty() || its_cell != cell || blocks.back().channel != sample.channel) {
      cell = its_cell;
      Block block;
      block.channel = sample.channel;
      block.first = static_cast<std::uint32_t>(i);
      block.held_out = held_out((its_cell + 0.5) * block_s);
      blocks.push_back(block);
    }
    Block& block = blocks.back();
    ++block.count;
    block.t_s += sample.t_s;
    block.rate_square += sample.rate_dps * sample.rate_dps;
  }
  for (Block& block : problem.layout.blocks) {
    block.t_s /= block.count;
    block.rate_square /= block.count;
    set_gains(block, std::span(problem.t_s).subspan(block.first, block.count), other);
  }
  return problem;
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

}  // namespace

Expected<void> Study::check_spans() const {
  const auto& [a, b] = recording_.gyros;
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
  if (recording_.seconds <= kSpanPerSecond * filled_s + kPauseMost_s) return {};
  return fail(
      "",
      fmt::format("from the first frame to the last it is {:.0f} s, and the gyros are there "
                  "in {:.0f} s of them: {}, {}",
                  recording_.seconds, filled_s, span_text(a), span_text(b)),
      "cut the recording at its pauses, or where the clock was set, and judge the parts");
}

Expected<void> Study::check() const {
  for (const GyroSeries& gyro : recording_.gyros) {
    if (gyro.t_s.size() < kSamplesMin || recording_.seconds < kRecordingMin_s) {
      return fail(
          "",
          fmt::format("the recording is too short: {:.1f} s, {} samples of {}", recording_.seconds,
                      gyro.t_s.size(), gyro.name),
          fmt::format("at least {:.0f} s and {} samples of each gyro; ten minutes with rest "
                      "and motion tell much more",
                      kRecordingMin_s, kSamplesMin));
    }
  }
  if (auto good = check_spans(); !good) return good;
  if (!recording_.has_reference) return {};
  const std::vector<double>& t_s = recording_.reference_dps.t_s;
  if (t_s.size() < kSamplesMin) {
    return fail("",
                fmt::format("the configuration names a reference, but the recording holds {} of "
                            "its samples",
                            t_s.size()),
                "record it too, or remove [reference] from the configuration");
  }
  if (t_s.back() - t_s.front() < kReferenceShareMin * recording_.seconds) {
    return fail("",
                fmt::format("the reference is there from {:.1f} to {:.1f} s only, the recording "
                            "lasts {:.1f} s",
                            t_s.front(), t_s.back(), recording_.seconds),
                "cut the recording to that part, or remove [reference] from the configuration");
  }
  return {};
}

Expected<std::unique_ptr<Study>> Study::begin(const Recording& recording,
                                              const std::vector<Effect>& effects) {
  std::unique_ptr<Study> study(new Study(recording));
  if (auto good = study->check(); !good) return tl::unexpected(good.error());
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const GyroSeries& series = recording.gyros[gyro];
    study->transports_[gyro] = check_transport(series, gyro, of_gyro(effects, gyro));
    smooth_temperature(series, study->signals_[gyro]);
    set_acceleration(recording.acceleration, study->signals_[gyro]);
  }
  std::vector<Finding> spikes = find_spikes(recording, study->transports_, effects);
  for (const Transport& transport : study->transports_) {
    study->findings_.insert(study->findings_.end(), transport.findings.begin(),
                            transport.findings.end());
    study->notes_.insert(study->notes_.end(), transport.notes.begin(), transport.notes.end());
  }
  std::move(spikes.begin(), spikes.end(), std::back_inserter(study->findings_));
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const GyroSeries& series = recording.gyros[gyro];
    const Transport& transport = study->transports_[gyro];
    std::vector<double> t_s;
    std::vector<double> rate;
    for (std::size_t i = 0; i < series.t_s.size(); ++i) {
      if (transport.masked[i] != 0) continue;
      t_s.push_back(transport.t_s[i]);
      rate.push_back(series.rate_dps[i]);
    }
    if (t_s.size() < kSamplesMin) {
      return fail("",
                  fmt::format("{} samples of {} are left when what is stuck, clipped or in a dead "
                              "band is set aside",
                              t_s.size(), series.name),
                  "record with a sensor that moves");
    }
    study->readings_[gyro] = SampledCurve(t_s, rate);
  }
  if (recording.has_reference) {
    const SampledCurve rate(recording.reference_dps.t_s, recording.reference_dps.value);
    for (Signals& signals : study->signals_)
      signals.motion = Motion(rate);
    study->build();
  } else {
    study->rest_ = find_rest(recording, study->transports_);
    if (study->rest_.count() < kRestMin_s) {
      return fail("", "the recording holds no rest, and there is no reference",
                  "without either nothing tells which gyro is wrong: record a minute at rest, or "
                  "name a [reference]");
    }
    study->learn_motion(effects);
  }
  return study;
}

bool Study::is_coarse(std::size_t gyro) const {
  return transports_[gyro].lattice_dps > 0.0 && transports_[gyro].repeats > kCoarseRepeats;
}

void Study::use_for_fit(double from_s, double to_s) {
  for_fit_s_.push_back({from_s, to_s});
  for (Problem& problem : problems_)
    set_aside(problem);
}

void Study::set_aside(Problem& problem) const {
  for (Block& block : problem.layout.blocks) {
    const auto holds = [&](const std::array<double, 2>& span) {
      return block.t_s >= span[0] && block.t_s <= span[1];
    };
    if (std::any_of(for_fit_s_.begin(), for_fit_s_.end(), holds)) block.held_out = false;
  }
}

std::size_t Study::problem_of(std::size_t gyro) const {
  return problems_.size() == 2 ? gyro : 0;
}

void Study::learn_motion(const std::vector<Effect>& effects) {
  if (recording_.has_reference) return;
  const PairNoise noise = noise_of(effects);
  std::array<double, 2> weight{0.5, 0.5};
  std::array<double, 2> density{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    density[gyro] = noise[gyro].white_dps_rthz;
  }
  if (density[0] > 0.0 && density[1] > 0.0) {
    const double first = 1.0 / (density[0] * density[0]);
    const double second = 1.0 / (density[1] * density[1]);
    weight = {first / (first + second), second / (first + second)};
  }
  const std::span<const double> t_s = readings_[0].times_s();
  // The first guess knows no errors; each further one takes off what the effects say at the last,
  // until nothing changes. Late readings converge by half their phase.
  const std::array<std::vector<Effect>, 2> mine{of_gyro(effects, 0), of_gyro(effects, 1)};
  std::vector<double> rate;
  for (int round = 0; round < kMotionRounds; ++round) {
    std::vector<double> next(t_s.size(), 0.0);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      std::unique_ptr<Prediction> prediction;
      if (round > 0) prediction = std::make_unique<Prediction>(mine[gyro], signals_[gyro]);
      for (std::size_t i = 0; i < t_s.size(); ++i) {
        double value = gyro == 0 ? readings_[0].values()[i] : readings_[1].at(t_s[i]).value;
        if (prediction) value -= prediction->at(t_s[i]) - signals_[gyro].motion.rate(t_s[i]).value;
        next[i] += weight[gyro] * value;
      }
    }
    double change_dps = 0.0;
    for (std::size_t i = 0; i < t_s.size(); ++i) {
      if (rest_.at(t_s[i])) next[i] = recording_.rest_rate_dps;
      if (round > 0) change_dps = std::max(change_dps, std::abs(next[i] - rate[i]));
    }
    rate = std::move(next);
    // Noise must not pass for motion, or what the effects make of it would come on top.
    const Motion motion{without_noise(SampledCurve(t_s, rate))};
    for (Signals& signals : signals_)
      signals.motion = motion;
    if (round > 0 && change_dps < kMotionSame_dps) break;
  }
  build();
}

Problem Study::build_against_reference(std::size_t gyro) {
  const GyroSeries& series = recording_.gyros[gyro];
  const Transport& transport = transports_[gyro];
  const Motion& motion = signals_[gyro].motion;
  std::vector<Sample> samples;
  samples.reserve(series.t_s.size());
  const double reach_s = 3.0 * motion.curve().interval_s();
  for (std::size_t i = 0; i < series.t_s.size(); ++i) {
    if (transport.masked[i] != 0 || motion.curve().hole_at(transport.t_s[i], reach_s)) continue;
    if (transport.t_s[i] < motion.curve().from_s() || transport.t_s[i] > motion.curve().to_s())
      continue;
    const double rate_dps = motion.rate(transport.t_s[i]).value;
    samples.push_back({transport.t_s[i], gyro == 0 ? Channel::kGyro1 : Channel::kGyro2,
                       series.rate_dps[i] - rate_dps, rate_dps});
  }
  Problem problem =
      assemble(std::move(samples), {transports_[0].interval_s, transports_[1].interval_s},
               {&motion.curve(), 2});
  problem.holds[gyro] = true;
  problem.layout.reference_variance = noise_variance(recording_.reference_dps);
  return problem;
}

Problem Study::build_pair() {
  const Motion& motion = signals_[0].motion;
  std::vector<Sample> samples;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::span<const double> t_s = readings_[gyro].times_s();
    for (std::size_t i = 0; i < t_s.size(); ++i) {
      if (!rest_.at(t_s[i])) continue;
      samples.push_back({t_s[i], gyro == 0 ? Channel::kGyro1 : Channel::kGyro2,
                         readings_[gyro].values()[i] - recording_.rest_rate_dps,
                         recording_.rest_rate_dps});
    }
  }
  const std::span<const double> t_s = readings_[0].times_s();
  const double reach_s = 1.5 * readings_[1].interval_s();
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    if (rest_.at(t_s[i]) || readings_[1].hole_at(t_s[i], reach_s)) continue;
    samples.push_back({t_s[i], Channel::kDifference,
                       readings_[0].values()[i] - readings_[1].at(t_s[i]).value,
                       motion.rate(t_s[i]).value});
  }
  Problem problem =
      assemble(std::move(samples), {transports_[0].interval_s, transports_[1].interval_s},
               {&readings_[1], 1});
  problem.holds = {true, true};
  return problem;
}

void Study::build() {
  problems_.clear();
  remembered_.clear();
  forget_next_ = 0;
  // Reserved, because what is remembered points at them.
  problems_.reserve(2);
  if (recording_.has_reference) {
    problems_.push_back(build_against_reference(0));
    problems_.push_back(build_against_reference(1));
  } else {
    problems_.push_back(build_pair());
  }
  excitations_ = {};
  for (Problem& problem : problems_) {
    cache(problem);
    set_aside(problem);
  }
}

void Study::cache(Problem& problem) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!problem.holds[gyro]) continue;
    const Signals& signals = signals_[gyro];
    Excitation& excitation = excitations_[gyro];
    excitation.knows_temperature = !signals.temperature_c.empty();
    excitation.knows_acceleration = !signals.vibration_g2.empty();
    const std::size_t n = problem.t_s.size();
    problem.rate[gyro].resize(n);
    problem.surroundings[gyro].resize(n);
    std::array<std::array<double, 2>, 6> range;
    range.fill({1e300, -1e300});
    const auto extend = [](std::array<double, 2>& r, double value) {
      if (std::isnan(value)) return;
      r[0] = std::min(r[0], value);
      r[1] = std::max(r[1], value);
    };
    for (std::size_t i = 0; i < n; ++i) {
      problem.rate[gyro][i] = signals.motion.rate(problem.t_s[i]);
      const model::Surroundings s = signals.at(problem.t_s[i]);
      problem.surroundings[gyro][i] = s;
      if (share_of(problem.channel[i], gyro) == 0.0) continue;
      excitation.rate_max_dps =
          std::max(excitation.rate_max_dps, std::abs(problem.rate[gyro][i].value));
      extend(range[0], s.temperature_c);
      extend(range[1], s.temperature_slope_c_s);
      for (std::size_t axis = 0; axis < 3; ++axis)
        extend(range[2 + axis], s.acceleration_g[axis]);
      extend(range[5], s.vibration_g2);
    }
    const auto width = [](const std::array<double, 2>& r) { return std::max(0.0, r[1] - r[0]); };
    excitation.temperature_range_c = width(range[0]);
    excitation.temperature_slope_range_c_s = width(range[1]);
    for (std::size_t axis = 0; axis < 3; ++axis)
      excitation.acceleration_range_g[axis] = width(range[2 + axis]);
    excitation.vibration_range_g2 = width(range[5]);
  }
}

Eigen::VectorXd Study::lateness_dps(const Problem& problem, std::size_t gyro,
                                    const std::vector<Effect>& moving) const {
  const auto same = [&](const Remembered& one) {
    return one.problem == &problem && one.effect.kind == moving[0].kind &&
           one.effect.gyro == moving[0].gyro && one.effect.parameters == moving[0].parameters;
  };
  if (moving.size() == 1) {
    const auto found = std::find_if(remembered_.begin(), remembered_.end(), same);
    if (found != remembered_.end()) return found->values;
  }
  Eigen::VectorXd lateness = Eigen::VectorXd::Zero(problem.size());
  if (moving.empty()) return lateness;
  const Prediction prediction(moving, signals_[gyro]);
  for (Eigen::Index i = 0; i < problem.size(); ++i) {
    const auto place = static_cast<std::size_t>(i);
    if (share_of(problem.channel[place], gyro) == 0.0) continue;
    lateness[i] = prediction.at(problem.t_s[place]) - problem.rate[gyro][place].value;
  }
  if (moving.size() > 1) return lateness;
  const Remembered one{&problem, moving[0], lateness};
  if (remembered_.size() < kRemembered) {
    remembered_.push_back(one);
  } else {
    remembered_[forget_next_++ % kRemembered] = one;
  }
  return lateness;
}

// The rate comes late first, and every response is to what has come.
Eigen::VectorXd Study::contribution(const Problem& problem, std::size_t gyro,
                                    const std::vector<Effect>& effects) const {
  if (!problem.holds[gyro]) return Eigen::VectorXd::Zero(problem.size());
  std::vector<Effect> moving;
  std::vector<Effect> added;
  for (const Effect& effect : effects) {
    if (effect.gyro != gyro) continue;
    const model::Nature nature = model::info(effect.kind).nature;
    if (nature == model::Nature::kLag || effect.kind == Kind::kClockSkew) moving.push_back(effect);
    if (nature == model::Nature::kOffset || nature == model::Nature::kResponse)
      added.push_back(effect);
  }
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(problem.size());
  const Eigen::VectorXd lateness = lateness_dps(problem, gyro, moving);
  for (Eigen::Index i = 0; i < problem.size(); ++i) {
    const auto place = static_cast<std::size_t>(i);
    const double share = share_of(problem.channel[place], gyro);
    if (share == 0.0) continue;
    const double late_dps = problem.rate[gyro][place].value + lateness[i];
    sum[i] = share * lateness[i];
    for (const Effect& effect : added) {
      sum[i] += share * model::added_dps(effect, late_dps, problem.surroundings[gyro][place]);
    }
  }
  return sum;
}

Eigen::VectorXd Study::residual(const Problem& problem, const std::vector<Effect>& effects) const {
  Eigen::VectorXd residual = problem.observed_dps;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (problem.holds[gyro]) residual -= contribution(problem, gyro, effects);
  }
  return residual;
}

}  // namespace vgyro::gap
