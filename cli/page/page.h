#pragma once

// One self-contained page: a shell (style, dygraphs, helpers, dark and print) around a page's own
// style, script and data. Everything that comes from a user's file is part of the data, which the
// page's script shows as text, never as markup.

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace vgyro::cli {

/// All of it is markup: no text of a user may be in it.
struct PageParts {
  std::string_view title;     ///< until the script sets another
  std::string_view noscript;  ///< for a reader whose browser runs no script
  std::string_view made_by;   ///< a sentence at the foot
  std::string_view style;
  std::string_view script;
};

/// The whole file.
std::string page_of(const PageParts& parts, const nlohmann::ordered_json& data);

/// With this many significant digits; null if not finite.
nlohmann::ordered_json page_number(double value, int digits);
nlohmann::ordered_json page_numbers(const std::vector<double>& values, int digits);

}  // namespace vgyro::cli
