#pragma once

// Writes model files. What a user wrote survives to the byte: comments, order, spacing, line ends;
// an edit adds its lines or changes its number, and nothing else. Every result has been read back:
// it holds the effects of before and the change, or an error is returned instead.

#include <string>
#include <string_view>

#include "base/error.h"
#include "model/file.h"

namespace vgyro::model {

/// `text` with one more [[effect]] table at its end, with all its parameters in the shortest digits
/// that read back to the same value. `comment` stands above the table, every line behind a "#";
/// empty: none. An empty text becomes a whole file. An error where `text` is no model file, where
/// its effects are not written as [[effect]] tables, or where the effect is out of its limits.
Expected<std::string> append_effect(std::string_view text, const Effect& effect,
                                    std::string_view comment);

/// `text` with another value for the parameter `name` of the effect whose table begins on line
/// `line_of_table` (Effect::line). A parameter that is left to its preset is added to the table.
Expected<std::string> replace_parameter(std::string_view text, unsigned line_of_table,
                                        std::string_view name, double value);

/// A whole file with these effects.
std::string to_toml(const Model& model);

}  // namespace vgyro::model
