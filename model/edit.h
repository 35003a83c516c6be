#pragma once

// Writes model files. What a user wrote survives to the byte: comments, order, spacing, line ends;
// an edit adds its lines and nothing else. Every result has been read back: it holds the effects of
// before and the new one, or an error is returned instead.

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

/// `text` with `comment` at its end, every line of it behind a "#": effects that are known and not
/// applied. An empty text becomes a whole file. An error where `text` is no model file.
Expected<std::string> append_comment(std::string_view text, std::string_view comment);

/// The effect's [[effect]] table, with `sigma` and `ambiguous` where they say something.
std::string effect_table(const Effect& effect);

/// A whole file with these effects.
std::string to_toml(const Model& model);

}  // namespace vgyro::model
