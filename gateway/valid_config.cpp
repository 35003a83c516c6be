#include "gateway/valid_config.h"

#include <cmath>
#include <cstdlib>
#include <string>

#include <fmt/core.h>

namespace vgyro::gateway {

namespace {

// "Status == 0"
struct ComparisonText {
  std::string signal;
  Comparison comparison = Comparison::kEqual;
  double value = 0.0;
};

std::optional<ComparisonText> parse_comparison(std::string_view text) {
  struct Operator {
    std::string_view sign;
    Comparison comparison;
  };
  // Two-character operators first: "<=" begins with "<".
  constexpr Operator kOperators[] = {
      {"==", Comparison::kEqual},     {"!=", Comparison::kNotEqual},
      {"<=", Comparison::kLessEqual}, {">=", Comparison::kGreaterEqual},
      {"<", Comparison::kLess},       {">", Comparison::kGreater}};
  const auto trimmed = [](std::string_view part) {
    const std::size_t first = part.find_first_not_of(" \t");
    if (first == part.npos) return std::string();
    return std::string(part.substr(first, part.find_last_not_of(" \t") - first + 1));
  };
  for (const Operator& op : kOperators) {
    const std::size_t at = text.find(op.sign);
    if (at == text.npos) continue;
    ComparisonText result{trimmed(text.substr(0, at)), op.comparison, 0.0};
    const std::string number = trimmed(text.substr(at + op.sign.size()));
    char* end = nullptr;
    result.value = std::strtod(number.c_str(), &end);
    const bool whole = !number.empty() && end == number.c_str() + number.size();
    if (result.signal.empty() || !whole || !std::isfinite(result.value)) return std::nullopt;
    return result;
  }
  return std::nullopt;
}

}  // namespace

std::optional<NamedCondition> read_condition(TomlReader& reader, SignalResolver& resolver,
                                             const dbc::Signal& main, std::string_view key) {
  const auto text = reader.text(key);
  if (!text) return std::nullopt;
  const auto parsed = parse_comparison(*text);
  if (!parsed) {
    reader.complain(
        reader.where(key), fmt::format("\"{}\" is not a comparison", *text),
        fmt::format("for example {} = \"Status == 0\"; ==, !=, <, <=, >, >= and a number", key));
    return std::nullopt;
  }
  const dbc::Signal* signal = resolver.signal_named(parsed->signal, key);
  if (signal == nullptr || !resolver.shares_page(key, *signal, main)) return std::nullopt;
  const auto codec = resolver.codec(*signal);
  if (!codec) return std::nullopt;
  return NamedCondition{signal, {*codec, parsed->comparison, parsed->value, *text}};
}

}  // namespace vgyro::gateway
