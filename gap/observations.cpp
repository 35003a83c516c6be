#include "gap/observations.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <span>

#include "model/catalogue.h"
#include "model/equation.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Nature;

// Both gyros' delays at a few values of a difference quotient, and some to spare.
constexpr std::size_t kRemembered = 24;
constexpr double kHeldOutCell_s = 1.0;
constexpr unsigned kHeldOutOneIn = 4;
// A block holds samples enough to tell white noise from drift.
constexpr double kBlockIntervalsMin = 5.0;

// A quarter of the seconds, scattered without a pattern that motion could have: the finaliser of
// splitmix64.
bool held_out(double t_s) {
  auto x = static_cast<std::uint64_t>(std::max(0.0, t_s / kHeldOutCell_s)) + 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return ((x ^ (x >> 31U)) % kHeldOutOneIn) == 0;
}

// Of what is interpolated at the instants of a block's samples: sums of the weights that each
// sample of the curve has in the block's mean, and of all weights' squares.
struct Weighing {
  std::vector<double> sums;
  double squares = 0.0;
};
Weighing weigh(const SampledCurve& curve, std::span<const double> t_s) {
  Weighing weighing;
  std::size_t first = 0;
  for (const double at_s : t_s) {
    const SampledCurve::Weights weights = curve.weights_at(at_s);
    std::vector<double>& sums = weighing.sums;
    if (sums.empty()) first = weights.first;
    // Times within a block increase, but a polynomial reaches less far back than a sinc.
    if (weights.first < first) {
      sums.insert(sums.begin(), first - weights.first, 0.0);
      first = weights.first;
    }
    sums.resize(std::max(sums.size(), weights.first - first + weights.count), 0.0);
    for (std::size_t i = 0; i < weights.count; ++i) {
      sums[weights.first - first + i] += weights.value[i];
      weighing.squares += weights.value[i] * weights.value[i];
    }
  }
  return weighing;
}

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
  const Weighing weighing = weigh(*other.curve, t_s);
  double of_mean = 0.0;
  for (const double sum : weighing.sums)
    of_mean += sum / count * sum / count;
  block.mean_gain[other.slot] = of_mean;
  if (block.count > 1) {
    block.within_gain[other.slot] =
        std::max(0.0, weighing.squares - count * of_mean) / static_cast<double>(block.count - 1);
  }
}

double block_length_s(const std::array<double, 2>& interval_s) {
  return std::max(kBlock_s, kBlockIntervalsMin * std::max(interval_s[0], interval_s[1]));
}

// By blocks' cells, in them by channel, in those by time.
void sort(std::vector<Observation>& samples, double block_s) {
  std::stable_sort(samples.begin(), samples.end(), [&](const Observation& a, const Observation& b) {
    const double cell_a = std::floor(a.t_s / block_s);
    const double cell_b = std::floor(b.t_s / block_s);
    if (cell_a != cell_b) return cell_a < cell_b;
    if (a.channel != b.channel) return a.channel < b.channel;
    return a.t_s < b.t_s;
  });
}

// Sorted samples → blocks, in which a sample's place is its place in the columns.
std::vector<Block> cut(const std::vector<Observation>& samples, double block_s) {
  std::vector<Block> blocks;
  double cell = -1.0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Observation& sample = samples[i];
    const double its_cell = std::floor(sample.t_s / block_s);
    if (blocks.empty() || its_cell != cell || blocks.back().channel != sample.channel) {
      cell = its_cell;
      Block block;
      block.channel = sample.channel;
      block.first = static_cast<std::uint32_t>(i);
      block.held_out = held_out((its_cell + 0.5) * block_s);
      blocks.push_back(block);
    }
    Block& block = blocks.back();
    block.kept = block.count++;
    block.t_s += sample.t_s;
    block.rate_square += sample.rate_dps * sample.rate_dps;
  }
  for (Block& block : blocks) {
    block.t_s /= block.count;
    block.rate_square /= block.count;
  }
  return blocks;
}

void set_for_fit(std::vector<Block>& blocks, const std::vector<Span>& spans) {
  for (Block& block : blocks) {
    const auto holds = [&](const Span& span) {
      return block.t_s >= span.from_s && block.t_s <= span.to_s;
    };
    if (std::any_of(spans.begin(), spans.end(), holds)) block.held_out = false;
  }
}

struct Extent {
  double low = std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::lowest();

  void extend(double value) {
    if (std::isnan(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] bool any() const { return high >= low; }
};

Excitation excitation_of(const Observations& data, std::size_t gyro) {
  std::array<Extent, kInputCount> extent;
  for (std::size_t i = 0; i < data.t_s.size(); ++i) {
    if (share_of(data.channel[i], gyro) == 0.0) continue;
    for (const InputRow& input : inputs()) {
      const double value = input.value(data.rate[gyro][i].value, data.surroundings[gyro][i]);
      extent[static_cast<std::size_t>(input.input)].extend(value);
    }
  }
  Excitation excitation;
  for (std::size_t i = 0; i < kInputCount; ++i) {
    excitation.known[i] = extent[i].any();
    if (extent[i].any()) excitation.range[i] = extent[i].high - extent[i].low;
  }
  const Extent& rate = extent[static_cast<std::size_t>(Input::kRate)];
  if (rate.any()) {
    excitation.range[static_cast<std::size_t>(Input::kRate)] =
        std::max(std::abs(rate.low), std::abs(rate.high));
  }
  return excitation;
}

bool is_same(const SampledCurve& a, const SampledCurve& b) {
  return std::ranges::equal(a.times_s(), b.times_s()) && std::ranges::equal(a.values(), b.values());
}

// Without a reference both gyros are judged by one motion.
bool has_motion_of_first(const Observations& data, std::size_t gyro) {
  return gyro == 1 && data.holds[0] &&
         is_same(data.about.signals[0]->motion.curve(), data.about.signals[1]->motion.curve());
}

void set_motion(Observations& data, std::size_t gyro) {
  const Signals& signals = *data.about.signals[gyro];
  const std::size_t n = data.t_s.size();
  const bool is_known = has_motion_of_first(data, gyro);
  data.rate[gyro].resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double t_s = data.t_s[i];
    data.rate[gyro][i] = is_known ? data.rate[0][i] : signals.motion.rate(t_s);
    data.surroundings[gyro][i].angle_rad =
        is_known ? data.surroundings[0][i].angle_rad : signals.motion.angle_rad(t_s);
  }
  data.rate_by_other_dps[gyro].clear();
  if (!signals.other_reading_dps.empty()) {
    data.rate_by_other_dps[gyro].reserve(n);
    for (const double t_s : data.t_s)
      data.rate_by_other_dps[gyro].push_back(signals.other_reading_dps.value_at(t_s));
  }
  data.excitation[gyro] = excitation_of(data, gyro);
}

void set_surroundings(Observations& data, std::size_t gyro) {
  data.surroundings[gyro].reserve(data.t_s.size());
  for (const double t_s : data.t_s)
    data.surroundings[gyro].push_back(data.about.signals[gyro]->without_motion_at(t_s));
  set_motion(data, gyro);
}

bool is_moving(const Effect& effect) {
  return model::moves_in_time(effect.kind);
}

bool is_added(const Effect& effect) {
  const Nature nature = model::info(effect.kind).nature;
  return nature == Nature::kOffset || nature == Nature::kResponse;
}

bool is_response(const Effect& effect) {
  return model::info(effect.kind).nature == Nature::kResponse;
}

template <class Predicate>
Effects only(const Effects& effects, std::size_t gyro, const Predicate& is) {
  Effects mine;
  for (const Effect& effect : effects) {
    if (effect.gyro == gyro && is(effect)) mine.push_back(effect);
  }
  return mine;
}

// Of a gyro's effects those that another lateness moves, and those that make it.
Effects late_part(const Effects& effects, std::size_t gyro) {
  return only(effects, gyro,
              [](const Effect& effect) { return is_moving(effect) || is_response(effect); });
}

}  // namespace

bool Excitation::moves(Inputs needs) const {
  return std::all_of(inputs().begin(), inputs().end(), [&](const InputRow& input) {
    return (needs & bit(input.input)) == 0 || of(input.input) >= input.least;
  });
}

Observations make_observations(std::vector<Observation> samples, const Circumstances& about,
                               std::array<bool, 2> holds, const Interpolated& other,
                               double reference_variance, const std::vector<Span>& for_fit) {
  const double block_s = block_length_s(about.interval_s);
  sort(samples, block_s);
  Observations data;
  data.holds = holds;
  data.about = about;
  data.layout.interval_s = about.interval_s;
  data.layout.reference_variance = reference_variance;
  data.layout.samples = samples.size();
  data.layout.block_s = block_s;
  data.layout.blocks = cut(samples, block_s);
  data.observed_dps.resize(static_cast<Eigen::Index>(samples.size()));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    data.t_s.push_back(samples[i].t_s);
    data.channel.push_back(samples[i].channel);
    data.observed_dps[static_cast<Eigen::Index>(i)] = samples[i].observed_dps;
  }
  for (Block& block : data.layout.blocks)
    set_gains(block, std::span(data.t_s).subspan(block.first, block.count), other);
  set_for_fit(data.layout.blocks, for_fit);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (holds[gyro]) set_surroundings(data, gyro);
  }
  return data;
}

namespace {

template <class T>
void append(std::vector<T>& to, const std::vector<T>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

void append_blocks(const Layout& part, double from_s, Layout& layout) {
  const std::size_t first = layout.blocks.size();
  for (Block block : part.blocks) {
    block.first += static_cast<std::uint32_t>(layout.samples);
    block.t_s += from_s;
    // One figure stands for all references: what each was worth is in the gains.
    if (layout.reference_variance > 0.0) {
      const double share = part.reference_variance / layout.reference_variance;
      block.within_gain[2] *= share;
      block.mean_gain[2] *= share;
    }
    layout.blocks.push_back(block);
  }
  if (first > 0 && first < layout.blocks.size()) layout.blocks[first].begins = true;
  layout.samples += part.samples;
}

void append_part(const Observations& part, double from_s, Observations& all) {
  all.drives.push_back({all.t_s.size(), part.t_s.size(), from_s, part.about.signals});
  append_blocks(part.layout, from_s, all.layout);
  for (const double t_s : part.t_s)
    all.t_s.push_back(t_s + from_s);
  append(all.channel, part.channel);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    append(all.rate[gyro], part.rate[gyro]);
    append(all.surroundings[gyro], part.surroundings[gyro]);
    append(all.rate_by_other_dps[gyro], part.rate_by_other_dps[gyro]);
    all.about.coarse[gyro] = all.about.coarse[gyro] || part.about.coarse[gyro];
  }
  const Eigen::Index before = all.observed_dps.size();
  all.observed_dps.conservativeResize(before + part.observed_dps.size());
  all.observed_dps.tail(part.observed_dps.size()) = part.observed_dps;
  all.about.seconds = from_s + part.about.seconds;
}

}  // namespace

Observations join(const std::vector<const Observations*>& parts, const std::vector<double>& from_s,
                  const Effects& effects) {
  Observations all;
  all.holds = parts.front()->holds;
  all.about = parts.front()->about;
  all.layout.interval_s = parts.front()->layout.interval_s;
  all.layout.block_s = parts.front()->layout.block_s;
  for (const Observations* part : parts) {
    all.layout.reference_variance =
        std::max(all.layout.reference_variance, part->layout.reference_variance);
  }
  for (std::size_t i = 0; i < parts.size(); ++i)
    append_part(*parts[i], from_s[i], all);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (all.holds[gyro]) all.excitation[gyro] = excitation_of(all, gyro);
  }
  // What each has learned of it is in the blocks' powers; how much of that is unseen, all tell.
  all.learn_unseen_motion(effects);
  return all;
}

double Observations::most_of(const Limit& limit, std::size_t gyro) const {
  return limit.share * (limit.of ? excitation[gyro].of(*limit.of) : about.seconds);
}

void Observations::learn_unseen_motion(const FastMotion& motion, const Effects& effects) {
  for (Block& block : layout.blocks) {
    block.kept = block.count - 1;
    block.compared = about.with_reference || block.channel == Channel::kDifference;
    block.motion_power = block.compared ? motion.power(block.t_s) : 0.0;
  }
  learn_unseen_motion(effects);
}

void Observations::learn_unseen_motion(const Effects& effects) {
  const std::size_t gyro = holds[0] ? 0 : 1;
  Matrix columns(size(), 3);
  columns.col(0) = residual(effects);
  for (Eigen::Index i = 0; i < size(); ++i) {
    const SampledCurve::Point point = rate[gyro][static_cast<std::size_t>(i)];
    columns(i, 1) = point.value;
    columns(i, 2) = point.slope;
  }
  gap::learn_unseen_motion(columns, layout);
}

Observations Observations::with_motion(
    const std::array<std::shared_ptr<const Signals>, 2>& signals) const {
  Observations other = *this;
  other.remembered_.clear();
  other.forget_next_ = 0;
  other.about.signals = signals;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (holds[gyro]) set_motion(other, gyro);
  }
  for (Block& block : other.layout.blocks) {
    // At rest the rate is what it was.
    if (block.channel != Channel::kDifference) continue;
    block.rate_square = 0.0;
    for (std::size_t i = block.first; i < block.first + block.count; ++i)
      block.rate_square += other.rate[0][i].value * other.rate[0][i].value;
    block.rate_square /= block.count;
  }
  return other;
}

Observations Observations::with_for_fit(const std::vector<Span>& spans) const {
  Observations other = *this;
  set_for_fit(other.layout.blocks, spans);
  return other;
}

Drive Observations::whole() const {
  return {0, t_s.size(), 0.0, about.signals};
}

// What a gyro feels less the true rate, at each sample that holds it: what delay, low-passes and
// clock skew make of the motion.
Eigen::VectorXd Observations::lateness_dps(std::size_t gyro, const Effects& moving, By by) const {
  if (moving.empty()) return Eigen::VectorXd::Zero(size());
  const auto found =
      std::find_if(remembered_.begin(), remembered_.end(), [&](const Remembered& one) {
        return one.gyro == gyro && one.by == by && one.moving == moving;
      });
  if (found != remembered_.end()) return found->values;
  Eigen::VectorXd lateness = Eigen::VectorXd::Zero(size());
  for (const Drive& drive : is_one() ? std::vector<Drive>{whole()} : drives) {
    const Prediction prediction(moving, *drive.signals[gyro]);
    const SampledCurve& other_dps = drive.signals[gyro]->other_reading_dps;
    const bool by_other = by == By::kReadings && !prediction.passes_low() && !other_dps.empty();
    // Of a low-pass what it makes of the motion is known to the prediction.
    const SampledCurve* felt_dps = by_other ? &other_dps : &drive.signals[gyro]->motion.curve();
    for (std::size_t place = drive.first; place < drive.first + drive.count; ++place) {
      if (share_of(channel[place], gyro) == 0.0) continue;
      const double at_s = t_s[place] - drive.from_s;
      const double late_dps = prediction.passes_low() ? prediction.late_dps(at_s)
                                                      : prediction.late_dps(at_s, *felt_dps);
      lateness[static_cast<Eigen::Index>(place)] =
          late_dps - (by_other ? rate_by_other_dps[gyro][place] : rate[gyro][place].value);
    }
  }
  Remembered one{gyro, by, moving, lateness};
  if (remembered_.size() < kRemembered) {
    remembered_.push_back(std::move(one));
  } else {
    remembered_[forget_next_++ % kRemembered] = std::move(one);
  }
  return lateness;
}

// Every response is to what has come.
void Observations::add(std::size_t gyro, const Effects& added, const Eigen::VectorXd& lateness,
                       Eigen::VectorXd& sum) const {
  const model::Equation equation(added);
  for (Eigen::Index i = 0; i < size(); ++i) {
    const auto place = static_cast<std::size_t>(i);
    const double share = share_of(channel[place], gyro);
    if (share == 0.0) continue;
    const double late_dps = rate[gyro][place].value + lateness[i];
    sum[i] += share * equation.added_dps(late_dps, surroundings[gyro][place]);
  }
}

Eigen::VectorXd Observations::contribution(std::size_t gyro, const Effects& effects) const {
  return contribution(gyro, effects, By::kReadings);
}

Eigen::VectorXd Observations::contribution(std::size_t gyro, const Effects& effects, By by) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(size());
  if (!holds[gyro]) return sum;
  const Effects moving = only(effects, gyro, is_moving);
  const Eigen::VectorXd lateness = lateness_dps(gyro, moving, by);
  if (!moving.empty()) {
    for (Eigen::Index i = 0; i < size(); ++i)
      sum[i] = share_of(channel[static_cast<std::size_t>(i)], gyro) * lateness[i];
  }
  const Effects added = only(effects, gyro, is_added);
  if (!added.empty()) add(gyro, added, lateness, sum);
  return sum;
}

Eigen::VectorXd Observations::late_with(const Effects& others, const Effect& effect, By by) const {
  Effects with = late_part(others, effect.gyro);
  with.push_back(effect);
  return contribution(effect.gyro, with, by);
}

// An offset or a response sees what is late already; what is late moves what responds to it.
Eigen::VectorXd Observations::contribution_beside(const Effects& others,
                                                  const Effect& effect) const {
  if (is_moving(effect)) {
    return late_with(others, effect, By::kReadings) -
           contribution(effect.gyro, late_part(others, effect.gyro));
  }
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(size());
  if (holds[effect.gyro]) {
    add(effect.gyro, {effect},
        lateness_dps(effect.gyro, only(others, effect.gyro, is_moving), By::kReadings), sum);
  }
  return sum;
}

Eigen::VectorXd Observations::derivative(const Effects& others, const Effect& effect,
                                         const Free& free) const {
  Effect above = effect;
  if (free.linear) {
    above.parameters[free.parameter] = 1.0;
    return contribution_beside(others, above);
  }
  const double step = free.relative ? free.step * effect.parameters[free.parameter] : free.step;
  Effect below = effect;
  above.parameters[free.parameter] += step;
  below.parameters[free.parameter] -= step;
  const auto at = [&](const Effect& moved) {
    return is_moving(moved) ? late_with(others, moved, By::kMotion)
                            : contribution_beside(others, moved);
  };
  return (at(above) - at(below)) / (2.0 * step);
}

Eigen::VectorXd Observations::residual(const Effects& effects) const {
  return residual(effects, By::kReadings);
}

Eigen::VectorXd Observations::residual_by_motion(const Effects& effects) const {
  return residual(effects, By::kMotion);
}

Eigen::VectorXd Observations::residual(const Effects& effects, By by) const {
  Eigen::VectorXd residual = observed_dps;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (holds[gyro]) residual -= contribution(gyro, effects, by);
  }
  return residual;
}

}  // namespace vgyro::gap
