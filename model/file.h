#pragma once

// The model file (TOML): a list of effects. docs/model-file.md describes it. All complaints of a
// file are reported at once, each with its line and what would be right.

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

ModelResult load_model(const std::string& path);
/// `file` names the text in complaints.
ModelResult parse_model(std::string_view text, const std::string& file);

}  // namespace vgyro::model
