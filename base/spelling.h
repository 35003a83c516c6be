#pragma once

// Lower case, and the valid name that a mistyped one most likely meant.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vgyro {

/// Changes ASCII letters only.
std::string lower(std::string_view text);

/// Edits (insert, delete, replace, swap of neighbours) that turn `a` into `b`, letter case ignored.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The nearest of `candidates`; nothing if none is close enough to be a typing error.
std::optional<std::string> nearest_name(std::string_view name,
                                        const std::vector<std::string>& candidates);

/// An option that the command does not have.
struct UnknownOption {
  std::string name;                 ///< as typed, without "=" and a value
  std::optional<std::string> near;  ///< the option that was most likely meant
};
/// The first of the unparsed words that looks like an option. `known` includes the dashes.
std::optional<UnknownOption> unknown_option(const std::vector<std::string>& left_over,
                                            const std::vector<std::string>& known);

/// `did you mean "X"?`, or `one of: A, B, C` if none is near; empty without candidates.
std::string suggest_name(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace vgyro
