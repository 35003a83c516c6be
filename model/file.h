#pragma once

// The model file (TOML): a list of effects. docs/model-file.md describes it. All errors of a file
// are reported at once, each with its line and a remedy.

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

#include "base/error.h"
#include "model/catalogue.h"
#include "model/effect.h"

namespace vgyro::model {

struct Model {
  std::string file;
  std::vector<Effect> effects;  ///< in the order of the file

  friend bool operator==(const Model&, const Model&) = default;
};

using ModelResult = tl::expected<Model, std::vector<Error>>;

inline constexpr std::size_t kEffectsMax = 256;

/// Key for the axis of a unit that has the effect.
inline constexpr std::string_view kAxisKey = "axis";
/// A parameter's key in the file. If `axis` names the unit's axis, the axis that g_sensitivity
/// depends on is called `from`, as that of cross_axis always is.
std::string_view key_of(const Parameter& parameter, bool has_unit_axis);

/// The names of gyros that an effect may use besides 1 and 2.
struct GyroNames {
  std::array<std::string, 2> names{};  ///< in the configuration; empty: no name
  /// Any name is accepted and read as gyro 1, and effects are not counted per gyro: for an edit or
  /// a check that does not know the configuration.
  bool any = false;
};

ModelResult load_model(const std::string& path, const GyroNames& names = {});
/// `file` names the text in errors.
ModelResult parse_model(std::string_view text, const std::string& file,
                        const GyroNames& names = {});

}  // namespace vgyro::model
