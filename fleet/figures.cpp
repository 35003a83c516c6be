#include "fleet/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <fmt/core.h>

namespace vgyro::fleet {

namespace {

// From a thousandth to a million a number is read as it stands.
constexpr int kPlainLeast = -3;
constexpr int kPlainMost = 5;

int decade_of(double value) {
  return value == 0.0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(value))));
}

/// The power of ten that is taken out.
int power_of(double value) {
  const int decade = decade_of(value);
  if (decade >= kPlainLeast && decade <= kPlainMost) return 0;
  return static_cast<int>(std::floor(decade / 3.0)) * 3;
}

std::string times_ten_to(int power) {
  constexpr std::array<std::string_view, 10> kRaised{"⁰", "¹", "²", "³", "⁴",
                                                     "⁵", "⁶", "⁷", "⁸", "⁹"};
  if (power == 0) return "";
  std::string text = power < 0 ? "·10⁻" : "·10";
  for (const char digit : std::to_string(std::abs(power)))
    text += kRaised[static_cast<std::size_t>(digit - '0')];
  return text;
}

// Decimals of a number with this σ: one digit of σ, two where it begins with a 1.
int decimals_of(double sigma) {
  const int decade = decade_of(sigma);
  const bool begins_with_one = sigma < 2.0 * std::pow(10.0, decade);
  return std::max(0, -decade + (begins_with_one ? 1 : 0));
}

}  // namespace

std::string figure(double value, double sigma) {
  if (!(sigma > 0.0) || !std::isfinite(sigma)) return figure(value);
  const int power = power_of(std::max(std::abs(value), sigma));
  const double scale = std::pow(10.0, power);
  const int decimals = decimals_of(sigma / scale);
  const std::string text =
      fmt::format("{:.{}f} ± {:.{}f}", value / scale, decimals, sigma / scale, decimals);
  return power == 0 ? text : "(" + text + ")" + times_ten_to(power);
}

std::string rounded_figure(double value, double sigma) {
  if (!(sigma > 0.0) || !std::isfinite(sigma)) return figure(value);
  if (std::abs(value) < 0.5 * std::pow(10.0, decade_of(sigma))) return "0";
  const int power = power_of(value);
  const double scale = std::pow(10.0, power);
  return fmt::format("{:.{}f}", value / scale, decimals_of(sigma / scale)) + times_ten_to(power);
}

std::string figure(double value) {
  const int power = power_of(value);
  return fmt::format("{:.3g}", value / std::pow(10.0, power)) + times_ten_to(power);
}

}  // namespace vgyro::fleet
