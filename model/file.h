#pragma once

// The model file (TOML): a list of effects. docs/model-file.md describes it. All complaints of a
// file are reported at once, each with its line and what would be right.

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

/// Of a unit of several axes: which of them an effect is of.
inline constexpr std::string_view kAxisKey = "axis";
/// A parameter's key in the file. Where `axis` is the unit's, the axis of what g_sensitivity
/// depends on is called `from`, as that of cross_axis always is.
std::string_view key_of(const Parameter& parameter, bool has_unit_axis);

/// What an effect may call its gyro besides 1 and 2.
struct GyroNames {
  std::array<std::string, 2> names{};  ///< in the configuration; empty: no name
  /// Any name is accepted and read as gyro 1, and effects are not counted per gyro: for an edit or
  /// a check that does not know the configuration.
  bool any = false;
};

ModelResult load_model(const std::string& path, const GyroNames& names = {});
/// `file` names the text in complaints.
ModelResult parse_model(std::string_view text, const std::string& file,
                        const GyroNames& names = {});

}  // namespace vgyro::model
