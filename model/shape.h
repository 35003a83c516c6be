#pragma once

// Curves of a kind that many recordings can determine together, because they are the same in each
// except for their size. Kinds whose phase or instant belongs to one recording (line, bias_step,
// angle_harmonic) have no shape, nor have random kinds. A kind whose form has a parameter of its
// own (the time of a warm-up) has a shape for each of several values, and the likeliest of them
// represents the kind.

#include <cstddef>
#include <span>
#include <string_view>

#include "model/effect.h"

namespace vgyro::model {

struct Shape {
  std::string_view name;  ///< in evidence files: "scale_factor", "warm_up:60", "g_sensitivity:x"
  Kind kind;
  Parameters fixed;      ///< with size 0; for a low-pass, with its cut-off
  std::size_t size = 0;  ///< index of the parameter that is the size; for a low-pass, the cut-off
  bool is_low_pass = false;  ///< the size scales its time constant: 1 is the cut-off in `fixed`
  double unit = 1.0;         ///< a small size that matters; much smaller ones are negligible
};

/// The order is stable: new shapes are added at the end.
std::span<const Shape> shapes();
inline constexpr std::size_t kShapeCount = 29;
/// kShapeCount for any other word.
std::size_t shape_index(std::string_view name);

/// The effect of a shape with this size. Precondition for a low-pass: the size is above 0, since
/// others have no cut-off.
Effect effect_of(const Shape& shape, double size);
/// 1σ of its parameters, from that of the size.
Parameters sigma_of(const Shape& shape, double size, double size_sigma);
/// The shape of an effect, regardless of its size; null if the effect has none of these forms.
const Shape* shape_of(const Effect& effect);

}  // namespace vgyro::model
