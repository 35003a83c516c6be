#pragma once

// Do two signals feel the same motion? Compares changes of means over short times, so that neither
// a bias nor slow drift counts, at several time scales; the most significant one decides. Each
// signal has its own stamps. And: is one signal made from the other (a gateway's copy, filtered or
// rounded)? Two sensors have noise of their own, a copy has none.

#include <array>
#include <optional>
#include <vector>

namespace vgyro::analysis {

/// One signal; stamps in the order of time.
struct StampedSignal {
  std::vector<double> t_s;
  std::vector<double> value;
  double step = 0.0;  ///< resolution of the values; 0 for floats
};

struct SignalFigures {
  double interval_s = 0.0;  ///< median
  double noise = 0.0;       ///< of a sample, in the quietest tenth: √½ of the rms of its steps
  double peak = 0.0;        ///< 99.5 % of the values are within this of the median
  double median = 0.0;
  bool changes = false;  ///< at least two values
};
SignalFigures signal_figures(const StampedSignal& signal);

struct Likeness {
  double correlation = 0.0;   ///< of the changes, at lag_s
  double significance = 0.0;  ///< in standard deviations of chance
  double lag_s = 0.0;         ///< positive: the second is later
  double scale = 1.0;         ///< the second's change over the first's, total least squares
  double ratio = 1.0;         ///< the same ratio by rms: for signals of different units
  double scale_s = 0.0;       ///< most significant time scale
  /// Standard error of the scale's logarithm, from noise alone.
  [[nodiscard]] double scale_error() const;
};
/// Nothing if they share less than a few seconds, or one of them does not change.
std::optional<Likeness> likeness(const StampedSignal& first, const StampedSignal& second);

/// Input of quick_correlation(): changes over two spans of time, on a common grid. NaN where
/// samples are missing.
struct ChangeShape {
  double step_s = 0.0;
  std::array<std::vector<float>, 2> changes;
};
/// `begin_s` and `seconds`: the time that is compared. Up to five minutes, the spans are 0.4 and
/// 1.6 s, for longer times up to ten times that; of more than four hours, the first four are used.
ChangeShape change_shape(const StampedSignal& signal, double begin_s, double seconds);

/// The magnitude of the correlation at the best lag, to a few hundredths; a thirtieth of the cost
/// of likeness(). 0 if hardly any time is shared. Precondition: shapes of the same time.
double quick_correlation(const ChangeShape& first, const ChangeShape& second);

/// Can `copy` be computed from the samples of `source`, except for rounding? `lag_s`: the copy is
/// later by this.
bool is_made_of(const StampedSignal& copy, const StampedSignal& source, double lag_s);

}  // namespace vgyro::analysis
