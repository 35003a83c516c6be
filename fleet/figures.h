#pragma once

// Figures for people: as many digits as their σ has a use for, powers of ten in thousands.

#include <string>

namespace vgyro::fleet {

/// "0.0194 ± 0.0012", "(501.1 ± 3.7)·10⁻⁶".
std::string figure(double value, double sigma);
/// The value alone, to the digit of that σ: "0.0194", "0".
std::string rounded_figure(double value, double sigma);
/// Three digits: "0.00346", "12.3·10⁻⁶".
std::string figure(double value);

}  // namespace vgyro::fleet
