#pragma once

// Raw values that are no measurement: those that J1939 and NMEA 2000 keep for "error", "not
// available" and the like, whatever range a DBC file claims, and those that the file labels so.
// Sources: SAE J1939-71, 5.1.4 (transmitted signal ranges); ISO 11783-7; for NMEA 2000 its field
// types as canboat publishes them. docs/configuration.md has the tables.

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "dbc/database.h"

namespace vgyro::dbc {

/// One run of bit patterns at the top of a signal's raw values, both ends included; empty where the
/// protocol keeps none.
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

/// What the rules keep of a signal that measures. J1939: of unsigned numbers from 8 bits on all
/// whose top eight bits are 0xFB or more; its shorter fields are states, whose meaning only labels
/// give, and it has no signed numbers. NMEA 2000: the topmost values, signed or not: three from 8
/// bits on, two where at least 15 is reached, one where at least 2 is.
Codes codes_of(const Signal& signal, CodeRules rules);

/// "error", "not available", …; empty for a raw value that is none of the codes.
std::string_view code_text(const Signal& signal, CodeRules rules, std::int64_t raw);

/// "j1939", "nmea2000", "none".
std::optional<CodeRules> code_rules_from(std::string_view name);
std::string_view to_string(CodeRules rules);

/// The rules that fit a J1939 message: NMEA 2000 has parameter groups of its own, and a file may
/// say that it is all NMEA 2000.
CodeRules code_rules_of(std::uint32_t id, bool is_j1939, std::string_view protocol);

/// Is this the value of the attribute ProtocolType for NMEA 2000? Letter case, blanks and signs do
/// not matter.
bool names_nmea2000(std::string_view protocol);

/// Does a label of the file say that this raw value stands for no value: "invalid", "SNA", "nicht
/// verfügbar"? Not of a flag of one bit, nor where the signal names the opposite as well ("valid"):
/// there the label is what the signal says.
bool labelled_no_value(const Signal& signal, std::int64_t raw);

/// Either, made once for a signal: what a reader of values should be told is none. A plain whole
/// number (no unit, no scale) may be a counter or a check value, so that the protocol's codes count
/// there only as far as the file gives the signal a range that leaves them out.
class NoValues {
 public:
  NoValues(const Signal& signal, CodeRules rules);
  [[nodiscard]] bool contains(std::int64_t raw) const;

 private:
  Codes codes_;
  std::vector<std::int64_t> labelled_;
};

}  // namespace vgyro::dbc
