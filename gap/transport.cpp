#include "gap/transport.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/core.h>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

// Logs and kernels count microseconds; candump's rounding is no lateness.
constexpr double kStampResolution_s = 3e-6;

// Frames over which an adapter's bunches are even; the share of their mean interval below which one
// frame follows another at once. Of bunches of two half of them do, of stamps that are late at
// random two fifths at most.
constexpr std::size_t kBunchFrames = 100;
constexpr double kAtOnce = 0.5;
constexpr double kBunchShare = 0.45;
// Where more than this share of steps are further than this from a whole number of intervals, a
// long step may be a late frame as well as a lost one: a lost one shows only beyond what all but
// one in so many steps reach.
constexpr double kUnevenSteps = 0.25;
constexpr double kUnevenShare = 0.1;
constexpr std::size_t kUnevenOneIn = 1000;

// One or two losses are told in a note: they are no property of the bus. Nor is one pause, which
// holds more than half of what is missing.
constexpr std::size_t kLostMin = 3;
constexpr double kPauseShare = 0.5;
// A silence as long as this, and as many frames, is a pause of the recording: a bus that loses
// frames lets one of so many through.
constexpr double kPause_s = 1.0;
constexpr double kPauseFrames = 20.0;
// A model without lost frames says that one in so many is lost.
constexpr double kFramesForALoss = 1e6;

// Fewer stamps show no lower envelope.
constexpr std::size_t kStampsMin = 200;
// The envelope is the earliest stamp of each of so many stretches: enough to fit a line to. Of the
// stamps in a stretch, this many at least, the earliest is hardly late.
constexpr std::size_t kStretches = 200;
constexpr std::size_t kStretchMin = 50;
// Which stamps are the earliest depends on the line; the third does not move it any more.
constexpr int kEnvelopeRounds = 3;
// Random lateness differs between neighbours as much as all over, that of a wandering clock by far
// less.
constexpr double kRoughMin = 0.3;
// Frames that scatter by more intervals than this are not late: the clock was set.
constexpr double kLateIntervals = 3.0;
// The folded normal has a skewness of 0.995, the exponential 2, the normal 0: half-way between.
constexpr double kNormalSkewness = 0.5;
constexpr double kExponentialSkewness = 1.5;
// Of a figure, which a browser is to draw at once.
constexpr std::size_t kLatePoints = 3000;
constexpr double kMilli = 1e3;

// The step of a float, which has none: below the rounding of any rate.
constexpr double kStepMin_dps = 1e-12;
// No error is told to be less.
constexpr double kSigmaMin_dps = 1e-9;
// Values nearer than this to each other, in steps of the frame, are the same one: over half a step,
// because scaling rounds.
constexpr double kSameSteps = 0.6;
// Two levels have one distance, which is a lattice always.
constexpr std::size_t kLevelsMin = 3;
// The first guess of the step is the distance that one in so many is less than: the middle of the
// least tenth.
constexpr std::size_t kLeastStepOneIn = 20;
// On three of the frame's steps or fewer every value would seem to stand on the lattice below.
constexpr double kLatticeFrameSteps = 3.5;
// The first guess of the step counts so many steps right, each better one half as many again.
constexpr double kSureSteps = 20.0;
constexpr double kSureGrowth = 1.5;
constexpr int kLatticeRounds = 3;
// A level this share of a step away is off the lattice. One in so many may be, by a frame that came
// broken.
constexpr double kOffShare = 0.2;
constexpr std::size_t kOffOneIn = 50;
constexpr std::size_t kLatticePoints = 2000;

// A frozen value repeats itself this often and for this long: by less nothing is lost, unless it
// happens again and again. Still shorter runs are chance.
constexpr std::size_t kStuckSure = 8;
constexpr double kStuckSure_s = 0.15;
constexpr std::size_t kBriefMin = 3;
constexpr std::size_t kStuckMin = 5;
// Of such a run anywhere in the recording, were the values independent.
constexpr double kChance = 1e-9;
// Runs count up to this length in the chance that a value repeats itself: longer ones are what is
// looked for.
constexpr std::size_t kRunCounted = 4;
// A chance of 1 would make no run too long.
constexpr double kRepeatsMost = 0.999;
/// Share of equal neighbours above which a sensor is coarse.
constexpr double kCoarse = 0.02;
// A coarse sensor rests on one value: frozen is what lasts this many times longer than any other.
constexpr double kCoarseRuns = 10.0;
// The share of kImpossibleNats that a frozen sample costs: for most, the truth has not moved far.
constexpr double kFrozenShare = 0.2;
// Of a figure, before and after what is frozen, and about the first value at the limit.
constexpr std::size_t kStuckAround = 200;
constexpr std::size_t kLimitBefore = 300;
constexpr std::size_t kLimitAfter = 600;

// Values at the limit, or on 0: fewer are a chance.
constexpr std::size_t kPlateauMin = 6;
// How far inside the limit neighbours are counted: a thousandth, or some steps of the
// lattice.
constexpr double kNearShare = 0.001;
constexpr double kNearSteps = 3.0;
// A plateau holds so many times the values that its neighbours let expect, and this many more.
constexpr double kPlateauTimes = 8.0;
constexpr double kPlateauMore = 4.0;
// Relative: nothing lies beyond the limit by more than the rounding of decoded values.
constexpr double kRounding = 1e-9;
// A limit of fewer steps of the lattice is where a steady turn stands.
constexpr double kLimitSteps = 20.0;
// Relative: readings this near to the limit may be clipped ones that were rounded afterwards.
constexpr double kClippedShare = 1e-3;

// On 0 within rounding, in steps of the frame.
constexpr double kZeroSteps = 0.25;
// Of fewer values that are not 0 the least tells no width.
constexpr std::size_t kOutsideMin = 100;
// A lattice alone has its next level one step away, and as often.
constexpr double kBandSteps = 2.5;
// Values go on right beyond the band: some lie within twice its width.
constexpr double kBeyondWidths = 2.0;
constexpr std::size_t kBeyondMin = 3;
// The distance of values there: over the least so many.
constexpr std::size_t kFollowers = 10;
// Noise takes values across the edge: those near it are chosen by their noise.
constexpr double kMaskedWidths = 1.5;
// Of a figure: its height, in widths of the band.
constexpr double kBandWidths = 5.0;
constexpr std::size_t kBandPoints = 3000;

// A plateau is far beyond what noise does (30 is 5.5 sigma), and the surer the more samples stand
// on it: each at a limit counts for 10, each on 0, which every turn passes, for less.
constexpr double kPlateauStatistic = 30.0;
constexpr double kLimitStatistic = 10.0;
constexpr double kZeroStatistic = 4.0;
// The share of kImpossibleNats that a masked sample costs: those near the edge cost nothing, those
// far beyond it all.
constexpr double kMaskedShare = 0.5;

bool knows(const std::vector<Effect>& effects, Kind kind) {
  return std::any_of(effects.begin(), effects.end(),
                     [&](const Effect& effect) { return effect.kind == kind; });
}

// Standard error of what so many values tell that are rounded to a step.
double rounding_sigma_dps(double step_dps, std::size_t values) {
  return std::max(step_dps, kSigmaMin_dps) / std::sqrt(12.0 * static_cast<double>(values));
}

// An even clock.
struct Line {
  double offset_s = 0.0;
  double interval_s = 0.0;

  // Of a stamp behind the clock.
  [[nodiscard]] double late_s(double t_s, double number) const {
    return t_s - offset_s - interval_s * number;
  }
};

// Sums for a straight line through points.
struct LineSums {
  double x = 0.0;
  double y = 0.0;
  double xx = 0.0;
  double xy = 0.0;
  double count = 0.0;

  void add(double at, double value) {
    x += at, y += value, xx += at * at, xy += at * value, count += 1.0;
  }
};

// Moves a line by the one that fits what is left of it, about `pivot`. False when none is told.
bool move(Line& line, const LineSums& sums, double pivot) {
  const double determinant = sums.count * sums.xx - sums.x * sums.x;
  if (determinant <= 0.0) return false;
  const double change = (sums.count * sums.xy - sums.x * sums.y) / determinant;
  const double shift = (sums.y - change * sums.x) / sums.count;
  line.interval_s += change;
  line.offset_s += shift - change * pivot;
  return true;
}

// The line below which hardly a stamp lies: first by least squares, then through the earliest of
// each stretch. Nothing when the stamps tell none.
std::optional<Line> envelope(const std::vector<double>& t_s, const std::vector<double>& number,
                             double interval_s) {
  const std::size_t n = t_s.size();
  const std::size_t stretch = std::max(kStretchMin, n / kStretches);
  const double pivot = number[n / 2];
  Line line{t_s.front(), interval_s};
  const auto late_s = [&](std::size_t i) { return line.late_s(t_s[i], number[i]); };
  LineSums all;
  for (std::size_t i = 0; i < n; ++i)
    all.add(number[i] - pivot, late_s(i));
  if (!move(line, all, pivot)) return {};
  for (int round = 0; round < kEnvelopeRounds; ++round) {
    LineSums earliest;
    for (std::size_t from = 0; from < n; from += stretch) {
      std::size_t best = from;
      for (std::size_t i = from; i < std::min(n, from + stretch); ++i) {
        if (late_s(i) < late_s(best)) best = i;
      }
      earliest.add(number[best] - pivot, late_s(best));
    }
    if (!move(line, earliest, pivot)) return {};
  }
  return line;
}

struct Lateness {
  double mean_s = 0.0;
  double deviation_s = 0.0;
  double rough_s = 0.0;  // the deviation that neighbours' differences speak of
  double skewness = 0.0;
};

// Precondition: two stamps at least.
Lateness lateness_of(const std::vector<double>& late_s) {
  const double n = static_cast<double>(late_s.size());
  double sum = 0.0, squares = 0.0, cubes = 0.0, steps = 0.0;
  for (const double late : late_s)
    sum += late;
  const double mean_s = sum / n;
  for (const double late : late_s) {
    const double x = late - mean_s;
    squares += x * x;
    cubes += x * x * x;
  }
  for (std::size_t i = 1; i < late_s.size(); ++i) {
    const double x = late_s[i] - late_s[i - 1];
    steps += x * x;
  }
  const double deviation_s = std::sqrt(squares / n);
  return {mean_s, deviation_s, std::sqrt(0.5 * steps / (n - 1.0)),
          cubes / n / (deviation_s * deviation_s * deviation_s)};
}

// Of |N(0, σ)|, where it looks like one.
double sigma_of(const Lateness& lateness) {
  const bool folded =
      lateness.skewness > kNormalSkewness && lateness.skewness < kExponentialSkewness;
  return folded ? lateness.deviation_s / std::sqrt(1.0 - 2.0 / std::numbers::pi)
                : lateness.deviation_s;
}

// Distinct values, rising.
std::vector<double> levels_of(std::vector<double> values, double tolerance_dps) {
  std::sort(values.begin(), values.end());
  std::vector<double> levels;
  for (const double value : values) {
    if (levels.empty() || value - levels.back() > tolerance_dps) levels.push_back(value);
  }
  return levels;
}

// Levels that neighbour each other are one step apart. Precondition: two levels at least.
double least_step_dps(const std::vector<double>& levels) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < levels.size(); ++i)
    steps.push_back(levels[i] - levels[i - 1]);
  std::sort(steps.begin(), steps.end());
  return steps[steps.size() / kLeastStepOneIn];
}

// Every level is a whole number of steps; the number is sure near zero first. `sizes` rise.
double refined_step_dps(double step_dps, const std::vector<double>& sizes) {
  for (int round = 0; round < kLatticeRounds; ++round) {
    double mm = 0.0;
    double mv = 0.0;
    double reach = kSureSteps * step_dps;
    for (const double size : sizes) {
      if (size > reach) {
        step_dps = mm > 0.0 ? mv / mm : step_dps;
        reach = std::max(size, kSureGrowth * reach);
      }
      const double m = std::round(size / step_dps);
      mm += m * m;
      mv += m * size;
    }
    if (mm > 0.0) step_dps = mv / mm;
  }
  return step_dps;
}

bool stands_on(double step_dps, const std::vector<double>& sizes, double tolerance_dps) {
  std::size_t off = 0;
  for (const double size : sizes) {
    const double error = std::abs(size - step_dps * std::round(size / step_dps));
    if (error > kOffShare * step_dps + tolerance_dps) ++off;
  }
  return off * kOffOneIn <= sizes.size();
}

// Samples that repeat one value.
struct Run {
  std::size_t first = 0;
  std::size_t end = 0;

  [[nodiscard]] std::size_t length() const { return end - first; }
};

std::vector<Run> runs_of(const std::vector<double>& values) {
  std::vector<Run> runs;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0 && values[i] == values[i - 1]) {
      ++runs.back().end;
    } else {
      runs.push_back({i, i + 1});
    }
  }
  return runs;
}

// That a value repeats the last, as the short runs show it.
double repeat_chance(const std::vector<Run>& runs, std::size_t samples) {
  std::size_t repeats = 0;
  for (const Run& run : runs)
    repeats += std::min(run.length(), kRunCounted) - 1;
  const double n = static_cast<double>(samples);
  return std::clamp(static_cast<double>(repeats) / n, 1.0 / n, kRepeatsMost);
}

class Check {
 public:
  Check(const GyroSeries& series, std::size_t gyro, const std::vector<Effect>& known)
      : series_(series), gyro_(gyro), known_(known), n_(series.t_s.size()) {}

  Transport run() {
    result_.t_s = series_.t_s;
    result_.masked.assign(n_, 0);
    result_.late_s.assign(n_, 0.0);
    count_frames();
    find_lost();
    find_lateness();
    find_lattice();
    find_stuck();
    find_saturation();
    find_dead_band();
    count_repeats();
    count_masked(result_);
    return std::move(result_);
  }

 private:
  [[nodiscard]] Where whole() const {
    return {series_.t_s.front(), series_.t_s.back(), 0.0, 0.5 / result_.interval_s};
  }

  // What is known of a finding as numbers.
  struct Told {
    Kind kind = Kind::kBias;
    model::Parameters parameters{};
    model::Parameters sigma{};
    double statistic = 0.0;
    double cost_nats = 0.0;
  };

  void add(const Told& told, Where where, std::string evidence, Figure figure) {
    Finding finding;
    finding.effect = Effect{gyro_, told.kind, told.parameters, 0};
    finding.sigma = told.sigma;
    finding.statistic = told.statistic;
    finding.p_value = std::min(kFoundPValue, std::exp(-0.5 * told.statistic));
    finding.cost_nats = told.cost_nats;
    finding.where = where;
    finding.evidence = std::move(evidence);
    finding.figure = std::move(figure);
    result_.findings.push_back(std::move(finding));
  }

  // Every so manieth reading of some, as far as there are.
  [[nodiscard]] Curve readings(std::string label, std::size_t from, std::size_t to,
                               std::size_t every, bool points) const {
    Curve curve{std::move(label), {}, {}, {}, points};
    for (std::size_t i = from; i < std::min(n_, to); i += every) {
      curve.x.push_back(series_.t_s[i]);
      curve.y.push_back(series_.rate_dps[i]);
    }
    return curve;
  }

  void count_repeats() {
    std::size_t good = 0;
    std::size_t same = 0;
    for (std::size_t i = 1; i < n_; ++i) {
      if (result_.masked[i] + result_.masked[i - 1] > 0) continue;
      ++good;
      if (series_.rate_dps[i] == series_.rate_dps[i - 1]) ++same;
    }
    if (good > 0) result_.repeats = static_cast<double>(same) / static_cast<double>(good);
  }

  [[nodiscard]] bool is_counted() const {
    return series_.counter.size() == n_ && series_.counter_modulus > 1;
  }

  // Frames from the one before, whole turns of the counter left out; without a counter, by time.
  [[nodiscard]] double frames_to(std::size_t i) const {
    if (is_counted()) {
      return static_cast<double>(
          (series_.counter[i] + series_.counter_modulus - series_.counter[i - 1]) %
          series_.counter_modulus);
    }
    // What comes in bunches says nothing of what is missing.
    if (bunch_ > 0.0) return 1.0;
    return std::round((series_.t_s[i] - series_.t_s[i - 1]) / result_.interval_s - late_intervals_);
  }

  // Stamps that scatter by much of the interval. Their median step is not the clock's, and a frame
  // that is late is no frame lost.
  void allow_for_scatter(const std::vector<double>& steps_s, double mean_s) {
    if (is_counted()) return;
    const auto uneven = std::count_if(steps_s.begin(), steps_s.end(), [&](double step_s) {
      const double intervals = step_s / result_.interval_s;
      return std::abs(intervals - std::round(intervals)) > kUnevenSteps;
    });
    if (static_cast<double>(uneven) < kUnevenShare * static_cast<double>(steps_s.size())) return;
    std::vector<double> longest_s = steps_s;
    const auto reach =
        longest_s.begin() +
        static_cast<std::ptrdiff_t>(longest_s.size() - 1 - longest_s.size() / kUnevenOneIn);
    std::nth_element(longest_s.begin(), reach, longest_s.end());
    result_.interval_s = mean_s;
    late_intervals_ = std::max(0.0, *reach / mean_s - 1.0);
    result_.notes.push_back(
        fmt::format("{}: the stamps scatter by more than a quarter of their interval of {:.4g} ms: "
                    "single missing frames cannot be told from late ones; name the frame's alive "
                    "counter, if it has one",
                    series_.name, kMilli * mean_s));
  }

  // An adapter that waits hands out its frames in bunches: most follow at once, and a pause is no
  // loss. The even clock's interval is then what many frames took. Nothing changes where they come
  // one by one.
  void find_bunches() {
    std::vector<double> steps_s;
    for (std::size_t i = 1; i < n_; ++i)
      steps_s.push_back(series_.t_s[i] - series_.t_s[i - 1]);
    std::vector<double> unordered_s = steps_s;
    result_.interval_s = median_of(unordered_s);
    std::vector<double> means_s;
    for (std::size_t i = kBunchFrames; i < n_; i += kBunchFrames) {
      double frames = is_counted() ? 0.0 : static_cast<double>(kBunchFrames);
      for (std::size_t k = i - kBunchFrames + 1; is_counted() && k <= i; ++k)
        frames += frames_to(k);
      if (frames > 0.0)
        means_s.push_back((series_.t_s[i] - series_.t_s[i - kBunchFrames]) / frames);
    }
    if (means_s.empty()) return;
    const double mean_s = median_of(means_s);
    if (mean_s <= 0.0) return;
    const auto at_once = std::count_if(steps_s.begin(), steps_s.end(),
                                       [&](double step_s) { return step_s < kAtOnce * mean_s; });
    if (static_cast<double>(at_once) < kBunchShare * static_cast<double>(steps_s.size()))
      return allow_for_scatter(steps_s, mean_s);
    result_.interval_s = mean_s;
    std::vector<double> pauses_s;
    for (const double step_s : steps_s) {
      if (step_s > mean_s) pauses_s.push_back(step_s);
    }
    if (pauses_s.empty()) return;
    bunch_ = std::round(median_of(pauses_s) / mean_s);
    result_.notes.push_back(
        fmt::format("{}: the stamps come in bunches of {:.0f}, as an adapter hands them out: each "
                    "sample is taken for its place on an even clock of {:.4g} ms",
                    series_.name, bunch_, kMilli * mean_s));
  }

  // Number of the sample on the even clock: by the alive counter where there is one.
  void count_frames() {
    find_bunches();
    number_.assign(n_, 0.0);
    for (std::size_t i = 1; i < n_; ++i) {
      double step = frames_to(i);
      if (is_counted()) {
        const double modulus = series_.counter_modulus;
        const double by_time = (series_.t_s[i] - series_.t_s[i - 1]) / result_.interval_s - bunch_;
        // Whole turns of the counter are told by time.
        step += std::max(0.0, std::round((by_time - step) / modulus)) * modulus;
      }
      number_[i] = number_[i - 1] + std::max(1.0, step);
    }
  }

  void find_lost() {
    double lost = 0.0;
    double paused = 0.0;
    std::size_t events = 0;
    double longest = 0.0;
    double longest_pause = 0.0;
    Curve marks{"frames missing at once", {}, {}, {}, true};
    for (std::size_t i = 1; i < n_; ++i) {
      const double missing = number_[i] - number_[i - 1] - 1.0;
      if (missing < 1.0) continue;
      if (missing >= kPauseFrames && series_.t_s[i] - series_.t_s[i - 1] >= kPause_s) {
        paused += missing;
        longest_pause = std::max(longest_pause, missing);
        continue;
      }
      lost += missing;
      longest = std::max(longest, missing);
      ++events;
      marks.x.push_back(series_.t_s[i]);
      marks.y.push_back(missing);
    }
    const double sent = lost + static_cast<double>(n_);
    const double share = lost / sent;
    result_.lost_share = (lost + paused) / (sent + paused);
    if (lost + paused == 0.0 || knows(known_, Kind::kDroppedFrames)) return;
    const bool is_property = events >= kLostMin && longest <= kPauseShare * lost;
    if (paused > 0.0 || !is_property) {
      result_.notes.push_back(fmt::format("{}: {:.0f} frames are missing, {:.0f} of them at once",
                                          series_.name, lost + paused,
                                          std::max(longest, longest_pause)));
    }
    if (!is_property) return;
    const double frames = static_cast<double>(n_);
    add({.kind = Kind::kDroppedFrames,
         .parameters = {share},
         .sigma = {std::sqrt(share * (1.0 - share) / sent)},
         .statistic = 2.0 * lost * std::log(kFramesForALoss * share + 1.0),
         .cost_nats = frames * share * std::log(kFramesForALoss)},
        whole(),
        fmt::format("the counter of {} skips {:.0f} of {:.0f} frames, at {} places", series_.name,
                    lost, sent, events),
        Figure{"Frames that the counter says are missing",
               "time / s",
               "frames",
               false,
               false,
               {marks}});
  }

  // The even clock is the line below which no stamp lies, up to the stamps' resolution: nothing
  // comes early.
  void find_lateness() {
    if (n_ < kStampsMin) return;
    const std::optional<Line> clock = envelope(series_.t_s, number_, result_.interval_s);
    if (!clock) return;
    double earliest_s = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n_; ++i)
      earliest_s = std::min(earliest_s, clock->late_s(series_.t_s[i], number_[i]));
    for (std::size_t i = 0; i < n_; ++i)
      result_.late_s[i] = clock->late_s(series_.t_s[i], number_[i]) - earliest_s;
    result_.interval_s = clock->interval_s;
    const Lateness lateness = lateness_of(result_.late_s);
    // A clock that wanders is no random lateness: neighbours then agree.
    if (lateness.deviation_s < kStampResolution_s ||
        lateness.rough_s < kRoughMin * lateness.deviation_s ||
        lateness.deviation_s > std::max(kLateIntervals, bunch_) * clock->interval_s)
      return;
    for (std::size_t i = 0; i < n_; ++i)
      result_.t_s[i] = clock->offset_s + earliest_s + clock->interval_s * number_[i];
    // What waited in a bunch is told in a note; the last of it did not wait.
    if (bunch_ > 0.0) return;
    // Of symmetrical lateness the mean is the place of the clock.
    if (lateness.skewness < kNormalSkewness) {
      for (double& t_s : result_.t_s)
        t_s += lateness.mean_s;
    }
    if (!knows(known_, Kind::kTimestampJitter)) tell_lateness(sigma_of(lateness));
  }

  void tell_lateness(double sigma_s) {
    Curve curve{"lateness of each stamp", {}, {}, {}, true};
    for (std::size_t i = 0; i < n_; i += std::max<std::size_t>(1, n_ / kLatePoints)) {
      curve.x.push_back(series_.t_s[i]);
      curve.y.push_back(result_.late_s[i] * kMilli);
    }
    double cost_nats = 0.0;
    for (const double late_s : result_.late_s) {
      const double z = late_s / kStampResolution_s;
      cost_nats += std::min(kImpossibleNats, 0.5 * z * z);
    }
    const double most_s = *std::max_element(result_.late_s.begin(), result_.late_s.end());
    add({.kind = Kind::kTimestampJitter,
         .parameters = {sigma_s},
         .sigma = {sigma_s / std::sqrt(static_cast<double>(n_))},
         .statistic = static_cast<double>(n_),
         .cost_nats = cost_nats},
        whole(),
        fmt::format("stamps of {} stand up to {:.3g} ms behind an even clock of {:.6g} ms",
                    series_.name, kMilli * most_s, kMilli * result_.interval_s),
        Figure{"How late each stamp is behind the even clock",
               "time / s",
               "lateness / ms",
               false,
               false,
               {curve}});
  }

  void find_lattice() {
    result_.lattice_dps = series_.step_dps;
    const double frame_step_dps = std::max(series_.step_dps, kStepMin_dps);
    const double tolerance_dps = std::max(kSameSteps * series_.step_dps, kStepMin_dps);
    const std::vector<double> levels = levels_of(series_.rate_dps, tolerance_dps);
    if (levels.size() < kLevelsMin) return;
    double step_dps = least_step_dps(levels);
    if (step_dps < kLatticeFrameSteps * frame_step_dps) return;
    std::vector<double> sizes;
    for (const double level : levels)
      sizes.push_back(std::abs(level));
    std::sort(sizes.begin(), sizes.end());
    step_dps = refined_step_dps(step_dps, sizes);
    if (!stands_on(step_dps, sizes, tolerance_dps)) return;
    result_.lattice_dps = step_dps;
    if (knows(known_, Kind::kQuantization)) return;
    // White noise of step²/12 is in the samples already, so that it costs nothing here: what a
    // lattice saves is its own.
    add({.kind = Kind::kQuantization,
         .parameters = {step_dps},
         .sigma = {rounding_sigma_dps(series_.step_dps, levels.size())},
         .statistic = 2.0 * static_cast<double>(n_) * std::log(step_dps / frame_step_dps)},
        whole(),
        fmt::format(
            "all values of {} lie on multiples of {:.6g} deg/s, the frame could carry steps "
            "of {:.2g}",
            series_.name, step_dps, series_.step_dps),
        Figure{"The readings stand on a lattice",
               "time / s",
               "deg/s",
               false,
               false,
               {readings("values near zero", 0, n_, std::max<std::size_t>(1, n_ / kLatticePoints),
                         true)}});
  }

  void find_stuck() {
    const std::vector<Run> runs = runs_of(series_.rate_dps);
    const double chance = repeat_chance(runs, n_);
    coarse_ = chance > kCoarse;
    const double least_s = coarse_ ? kCoarseRuns * second_longest_s(runs) : 0.0;
    std::tie(least_, most_) = std::minmax_element(series_.rate_dps.begin(), series_.rate_dps.end());
    std::vector<Run> frozen;
    std::size_t brief = 0;
    for (const Run& run : runs) {
      if (length_s(run) < least_s || !is_frozen(run, chance)) continue;
      frozen.push_back(run);
      if (is_brief(run)) ++brief;
    }
    for (const Run& run : frozen) {
      if (is_brief(run) && brief < kBriefMin) continue;
      // The first value may be a fresh one.
      for (std::size_t i = run.first + 1; i < run.end; ++i)
        result_.masked[i] = kSetAside;
      tell_stuck(run, log_chance(run, chance));
    }
  }

  // Of such a run anywhere in the recording.
  [[nodiscard]] double log_chance(const Run& run, double chance) const {
    return static_cast<double>(run.length() - 1) * std::log(chance) +
           std::log(static_cast<double>(n_));
  }

  [[nodiscard]] bool is_frozen(const Run& run, double chance) const {
    const double value = series_.rate_dps[run.first];
    // At its ends a gyro is clipped, and on 0 in a dead band.
    if (value == *least_ || value == *most_ || value == 0.0) return false;
    return run.length() >= kStuckMin && log_chance(run, chance) < std::log(kChance);
  }

  [[nodiscard]] bool is_brief(const Run& run) const {
    return run.length() < kStuckSure || length_s(run) < kStuckSure_s;
  }

  [[nodiscard]] double length_s(const Run& run) const {
    return series_.t_s[run.end - 1] - series_.t_s[run.first];
  }

  // 0 when there are no two.
  [[nodiscard]] double second_longest_s(const std::vector<Run>& runs) const {
    if (runs.size() < 2) return 0.0;
    std::vector<double> lengths_s;
    for (const Run& run : runs)
      lengths_s.push_back(length_s(run));
    std::nth_element(lengths_s.begin(), lengths_s.end() - 2, lengths_s.end());
    return lengths_s[lengths_s.size() - 2];
  }

  void tell_stuck(const Run& run, double log_chance) {
    // Frozen from some instant between its first sample and the next.
    const double from_s = 0.5 * (series_.t_s[run.first] + series_.t_s[run.first + 1]);
    const double to_s = series_.t_s[std::min(run.end, n_ - 1)];
    for (const Effect& effect : known_) {
      if (effect.kind == Kind::kStuck && effect.parameters[0] < to_s &&
          effect.parameters[1] > from_s)
        return;
    }
    const double sigma_s = 0.5 * result_.interval_s;
    add({.kind = Kind::kStuck,
         .parameters = {from_s, to_s},
         .sigma = {sigma_s, sigma_s},
         .statistic = -2.0 * log_chance,
         .cost_nats = (to_s - from_s) / result_.interval_s * kFrozenShare * kImpossibleNats},
        {from_s, to_s, 0.0, 0.5 / result_.interval_s},
        fmt::format("{} repeats the value {:.6g} {} times", series_.name,
                    series_.rate_dps[run.first], run.length()),
        Figure{"The value freezes",
               "time / s",
               "deg/s",
               false,
               false,
               {readings("reading", run.first - std::min(run.first, kStuckAround),
                         run.end + kStuckAround, 1, true)}});
  }

  void find_saturation() {
    const auto [bottom, top] =
        std::minmax_element(series_.rate_dps.begin(), series_.rate_dps.end());
    double limit_dps = 0.0;
    std::size_t most = 0;
    std::size_t total = 0;
    for (const double level : {*top, *bottom}) {
      const std::size_t at = plateau_at(level);
      total += at;
      if (at > most) most = at, limit_dps = std::abs(level);
    }
    for (const Effect& effect : known_) {
      if (effect.kind != Kind::kSaturation) continue;
      mask_beyond(effect.parameters[0]);
      return;
    }
    if (most == 0) return;
    // Nothing lies beyond the limit on the other side either.
    if (std::max(std::abs(*top), std::abs(*bottom)) > limit_dps * (1.0 + kRounding)) return;
    // On a coarse lattice a steady turn stands on one value.
    if (limit_dps < kLimitSteps * result_.lattice_dps || coarse_) return;
    mask_beyond(limit_dps);
    tell_saturation(limit_dps, total);
  }

  // Values that are exactly this one, its extreme; 0 when they are no more than chance would place
  // there.
  [[nodiscard]] std::size_t plateau_at(double level_dps) const {
    const double lattice_dps = result_.lattice_dps;
    const double reach_dps = std::max(kNearSteps * lattice_dps, kNearShare * std::abs(level_dps));
    std::size_t at = 0;
    std::size_t near = 0;
    for (const double value : series_.rate_dps) {
      if (value == level_dps) {
        ++at;
      } else if (std::abs(value - level_dps) <= reach_dps) {
        ++near;
      }
    }
    const double expected =
        lattice_dps > 0.0 ? static_cast<double>(near) * lattice_dps / reach_dps : 0.0;
    const bool stands =
        at >= kPlateauMin && static_cast<double>(at) > kPlateauTimes * expected + kPlateauMore;
    return stands ? at : 0;
  }

  void tell_saturation(double limit_dps, std::size_t samples) {
    std::size_t at = 0;
    while (std::abs(series_.rate_dps[at]) < limit_dps)
      ++at;
    add({.kind = Kind::kSaturation,
         .parameters = {limit_dps},
         .sigma = {rounding_sigma_dps(series_.step_dps, 1)},
         .statistic = kPlateauStatistic + kLimitStatistic * static_cast<double>(samples)},
        whole(),
        fmt::format("{} samples of {} read exactly {:.6g} deg/s, none more", samples, series_.name,
                    limit_dps),
        Figure{"Readings end at a limit",
               "time / s",
               "deg/s",
               false,
               false,
               {readings("reading", at - std::min(at, kLimitBefore), at + kLimitAfter, 1, false)}});
  }

  void mask_beyond(double limit_dps) {
    for (std::size_t i = 0; i < n_; ++i) {
      if (std::abs(series_.rate_dps[i]) >= limit_dps * (1.0 - kClippedShare))
        result_.masked[i] = kSetAside;
    }
  }

  void find_dead_band() {
    std::size_t zeros = 0;
    std::vector<double> sizes;
    for (const double value : series_.rate_dps) {
      if (std::abs(value) <= kZeroSteps * series_.step_dps) {
        ++zeros;
      } else {
        sizes.push_back(std::abs(value));
      }
    }
    for (const Effect& effect : known_) {
      if (effect.kind != Kind::kDeadBand) continue;
      mask_below(effect.parameters[0]);
      return;
    }
    if (zeros < kPlateauMin || sizes.size() < kOutsideMin) return;
    std::sort(sizes.begin(), sizes.end());
    const double width_dps = sizes.front();
    if (width_dps < kBandSteps * result_.lattice_dps) return;
    const auto beyond = std::lower_bound(sizes.begin(), sizes.end(), kBeyondWidths * width_dps);
    if (static_cast<std::size_t>(beyond - sizes.begin()) < kBeyondMin) return;
    // The edge lies below the least size, by the distance of its followers.
    const std::size_t followers = std::min(sizes.size() - 1, kFollowers);
    const double spacing_dps = (sizes[followers] - sizes[0]) / static_cast<double>(followers);
    mask_below(width_dps);
    tell_dead_band(width_dps, spacing_dps, zeros);
  }

  void tell_dead_band(double width_dps, double spacing_dps, std::size_t zeros) {
    const std::vector<double>& y = series_.rate_dps;
    Curve curve{"reading", {}, {}, {}, true};
    for (std::size_t i = 0; i < n_ && curve.x.size() < kBandPoints; ++i) {
      if (std::abs(y[i]) > kBandWidths * width_dps) continue;
      curve.x.push_back(series_.t_s[i]);
      curve.y.push_back(y[i]);
    }
    add({.kind = Kind::kDeadBand,
         .parameters = {std::max(width_dps - spacing_dps, 0.0)},
         .sigma = {std::max(spacing_dps, kSigmaMin_dps)},
         .statistic = kPlateauStatistic + kZeroStatistic * static_cast<double>(zeros)},
        whole(),
        fmt::format("{} samples of {} are exactly 0 and none lies between 0 and {:.4g} deg/s",
                    zeros, series_.name, width_dps),
        Figure{"Nothing is read near zero", "time / s", "deg/s", false, false, {curve}});
  }

  void mask_below(double width_dps) {
    for (std::size_t i = 0; i < n_; ++i) {
      if (std::abs(series_.rate_dps[i]) < kMaskedWidths * width_dps) result_.masked[i] = kSetAside;
    }
  }

  const GyroSeries& series_;
  std::size_t gyro_;
  const std::vector<Effect>& known_;
  std::size_t n_;
  std::vector<double> number_;                 ///< on the even clock
  std::vector<double>::const_iterator least_;  ///< values; of the whole recording
  std::vector<double>::const_iterator most_;
  double bunch_ = 0.0;  ///< frames that are handed out at once; 0: each by itself
  // How late a frame may be, in intervals, before one counts as missing.
  double late_intervals_ = 0.0;
  bool coarse_ = false;
  Transport result_;
};

}  // namespace

void count_masked(Transport& transport) {
  double masked = 0.0;
  for (const std::uint8_t mask : transport.masked)
    masked += mask != 0 ? 1.0 : 0.0;
  for (Finding& finding : transport.findings) {
    if (finding.effect.kind == Kind::kSaturation || finding.effect.kind == Kind::kDeadBand)
      finding.cost_nats = masked * kMaskedShare * kImpossibleNats;
  }
}

Transport check_transport(const GyroSeries& series, std::size_t gyro,
                          const std::vector<Effect>& known) {
  return Check(series, gyro, known).run();
}

ScalarSeries usable(const GyroSeries& series, const Transport& transport) {
  ScalarSeries good;
  for (std::size_t i = 0; i < series.t_s.size(); ++i) {
    if (transport.masked[i] != 0) continue;
    good.t_s.push_back(transport.t_s[i]);
    good.value.push_back(series.rate_dps[i]);
  }
  return good;
}

}  // namespace vgyro::gap
