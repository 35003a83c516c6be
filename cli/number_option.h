#pragma once

// Options that are numbers, read in the same way by all commands. A number is finite, in its range
// and the whole of its word; whole numbers are decimal. Everything else is wrong usage, reported
// with the option, the word and the range. Included by main.cpp alone, like CLI11.

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "base/printable.h"

namespace vgyro::cli {

template <class T>
struct NumberRange {
  T minimum = std::numeric_limits<T>::lowest();
  T maximum = std::numeric_limits<T>::max();
};

/// The shortest exact text.
template <class T>
std::string number_text(T value) {
  if constexpr (std::is_integral_v<T>) {
    return fmt::format("{}", value);
  } else {
    return fmt::format("{:.15g}", value);
  }
}

/// "FLOAT in [0.1 - 10000]"; no range for a whole number.
template <class T>
std::string type_text(const NumberRange<T>& range) {
  if (std::is_integral_v<T>) return "UINT";
  return fmt::format("FLOAT in [{} - {}]", number_text(range.minimum), number_text(range.maximum));
}

/// Throws CLI::ValidationError, as CLI11 requires.
template <class T>
T number_from(const std::string& option, const std::string& word, const NumberRange<T>& range) {
  T value{};
  const char* end = word.data() + word.size();
  const auto [at, code] = std::from_chars(word.data(), end, value);
  bool good = code == std::errc() && at == end;
  good = good && value >= range.minimum && value <= range.maximum;  // false for NaN
  if (good) return value;
  throw CLI::ValidationError(option,
                             fmt::format("\"{}\" is not a {} from {} to {}", printable(word),
                                         std::is_integral_v<T> ? "whole number" : "number",
                                         number_text(range.minimum), number_text(range.maximum)));
}

/// Adds an option of one number; its present value is the default that help shows.
template <class T>
CLI::Option* add_number(CLI::App& command, const std::string& name, T& value,
                        const NumberRange<T>& range, const std::string& help) {
  return command
      .add_option_function<std::string>(
          name,
          [&value, range, name](const std::string& word) {
            value = number_from(name, word, range);
          },
          help)
      ->type_name(type_text(range))
      ->default_str(number_text(value));
}

/// Adds an option of one to `most` numbers with commas between them.
template <class T>
CLI::Option* add_numbers(CLI::App& command, const std::string& name, std::vector<T>& values,
                         int most, const NumberRange<T>& range, const std::string& help) {
  std::string preset;
  for (const T& value : values)
    preset += (preset.empty() ? "" : ",") + number_text(value);
  return command
      .add_option_function<std::vector<std::string>>(
          name,
          [&values, range, name](const std::vector<std::string>& words) {
            values.clear();
            for (const std::string& word : words)
              values.push_back(number_from(name, word, range));
          },
          help)
      ->delimiter(',')
      ->expected(1, most)
      ->type_name(type_text(range))
      ->default_str(preset);
}

}  // namespace vgyro::cli
