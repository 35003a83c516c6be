#pragma once

// What many recordings can say of a kind together: a curve that is the same in each of them but for
// its size. Kinds whose phase or instant belongs to one recording (line, bias_step, angle_harmonic)
// have none, nor has what is random. A kind whose form has a parameter of its own (the time of a
// warm-up) has a shape for each of some values, and the likeliest of them stands for the kind.

#include <cstddef>
#include <span>
#include <string_view>

#include "model/effect.h"

namespace vgyro::model {

struct Shape {
  std::string_view name;  ///< in evidence files: "scale_factor", "warm_up:60", "g_sensitivity:x"
  Kind kind;
  Parameters fixed;      ///< of size 0; of a low-pass with its cut-off
  std::size_t size = 0;  ///< the parameter that the size is; of a low-pass none is
  bool is_low_pass =
      false;          ///< its size is how much of it is there: 1 is the cut-off that it names
  double unit = 1.0;  ///< a small size that matters; a size that is far below is nothing
};

/// In an order that only grows at its end.
std::span<const Shape> shapes();
inline constexpr std::size_t kShapeCount = 29;
/// kShapeCount for any other word.
std::size_t shape_index(std::string_view name);

/// The effect of a shape with this size. A low-pass of less than nothing is one beyond all that
/// matters: its size must be above 0.
Effect effect_of(const Shape& shape, double size);
/// 1σ of its parameters, from that of the size.
Parameters sigma_of(const Shape& shape, double size, double size_sigma);
/// The shape that an effect is, whatever its size; null where the effect's form is another.
const Shape* shape_of(const Effect& effect);

}  // namespace vgyro::model
