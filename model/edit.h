#pragma once

// Writes model files. The user's text survives to the byte: comments, order, spacing, line ends; an
// edit only adds its lines. Every result is read back: it holds the previous effects and the new
// one, otherwise an error is returned.

#include <string>
#include <string_view>

#include "base/error.h"
#include "model/file.h"

namespace vgyro::model {

/// `text` with one more [[effect]] table at its end, with all its parameters in the shortest digits
/// that read back to the same value. `comment` precedes the table, with "#" before every line;
/// empty: none. An empty text becomes a whole file. Error if `text` is no model file, if its
/// effects are not written as [[effect]] tables, or if the effect is out of its limits.
Expected<std::string> append_effect(std::string_view text, const Effect& effect,
                                    std::string_view comment);

/// `text` with `comment` at its end, with "#" before every line: effects that are known but not
/// applied. An empty text becomes a whole file. Error if `text` is no model file.
Expected<std::string> append_comment(std::string_view text, std::string_view comment);

/// The effect's [[effect]] table, with `sigma` and `ambiguous` if they are set.
std::string effect_table(const Effect& effect);

/// A whole file with these effects.
std::string to_toml(const Model& model);

}  // namespace vgyro::model
