#pragma once

// Letter case, and the valid name that a mistyped one most likely meant.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vgyro {

/// ASCII letters alone are changed.
std::string lower(std::string_view text);

/// Edits (insert, delete, replace, swap of neighbours) that turn `a` into `b`, letter case ignored.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The nearest of `candidates`, or nothing when none is close enough to be a typing error.
std::optional<std::string> nearest_name(std::string_view name,
                                        const std::vector<std::string>& candidates);

/// An option that no command line may have.
struct UnknownOption {
  std::string name;                 ///< as it was typed, without a value behind "="
  std::optional<std::string> near;  ///< what it most likely meant
};
/// The first of the words that were left over which looks like an option. `known`: with dashes.
std::optional<UnknownOption> unknown_option(const std::vector<std::string>& left_over,
                                            const std::vector<std::string>& known);

/// `did you mean "X"?`, or `one of: A, B, C` when nothing is near; empty without candidates.
std::string suggest_name(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace vgyro
