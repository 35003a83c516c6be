#pragma once

// Raw values that are not measurements: those that J1939 and NMEA 2000 reserve for "error", "not
// available" and the like, whatever range a DBC file claims, and those that the file labels so.
// Sources: SAE J1939-71, 5.1.4 (transmitted signal ranges); ISO 11783-7; the field types of NMEA
// 2000 as canboat publishes them. docs/configuration.md has the tables.
// types as canboat publishes them. docs/configuration.md has the tables.

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "dbc/database.h"

namespace vgyro::dbc {

/// A run of bit patterns at the top of a signal's raw values, both ends included; empty if the
/// protocol reserves none.
struct Codes {
  std::uint64_t first = 1;
  std::uint64_t last = 0;

  [[nodiscard]] bool empty() const { return first > last; }
  [[nodiscard]] bool contains(std::int64_t raw) const {
    const auto bits = static_cast<std::uint64_t>(raw);
    return first <= bits && bits <= last;
  }
  friend bool operator==(const Codes&, const Codes&) = default;
};

/// The codes that the rules reserve in a signal that measures. J1939: in unsigned numbers of 8 bits
/// or more, all values whose top eight bits are 0xFB or more; shorter fields are states, which only
/// labels explain, and J1939 has no signed numbers. NMEA 2000, signed or not: the three topmost
/// values from 8 bits on, the two topmost if the maximum is at least 15, the topmost if it is at
/// least 2.
Codes codes_of(const Signal& signal, CodeRules rules);

/// "error", "not available", …; empty if the raw value is not one of the codes.
std::string_view code_text(const Signal& signal, CodeRules rules, std::int64_t raw);

/// "j1939", "nmea2000", "none".
std::optional<CodeRules> code_rules_from(std::string_view name);
std::string_view to_string(CodeRules rules);

/// The rules for a J1939 message: NMEA 2000 has parameter groups of its own, and a file may declare
/// that all of it is NMEA 2000.
CodeRules code_rules_of(std::uint32_t id, bool is_j1939, std::string_view protocol);

/// Does this value of the attribute ProtocolType mean NMEA 2000? Ignores letter case, blanks and
/// punctuation.
bool names_nmea2000(std::string_view protocol);

/// Does a label of the file mark this raw value as no value: "invalid", "SNA", "nicht verfügbar"?
/// Not in a flag of one bit, nor in a signal that also labels the opposite ("valid"): there the
/// label is the meaning of the signal.
bool labelled_no_value(const Signal& signal, std::int64_t raw);

/// Codes and labels of a signal together, computed once: the raw values that a reader should treat
/// as no value. A plain whole number (no unit, no scale) may be a counter or a check value, so
/// there the protocol's codes count only if the range in the file excludes them.
class NoValues {
 public:
  NoValues(const Signal& signal, CodeRules rules);
  [[nodiscard]] bool contains(std::int64_t raw) const;

 private:
  Codes codes_;
  std::vector<std::int64_t> labelled_;
};

}  // namespace vgyro::dbc
