#include "dbc/codes.h"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace vgyro::dbc {

namespace {

constexpr unsigned kBitsMax = 64;
constexpr unsigned kByteBits = 8;
// J1939: the top byte decides. 0xFB has a meaning specific to the parameter, 0xFC and 0xFD are
// reserved.
constexpr std::uint64_t kJ1939First = 0xFB;
constexpr std::uint64_t kJ1939Reserved = 0xFC;
constexpr std::uint64_t kJ1939Error = 0xFE;
constexpr std::uint64_t kJ1939NotAvailable = 0xFF;

// NMEA 2000's parameter groups: data page 1, PDU formats from 0xED on. SAE gave this part of the
// page to NMEA; J1939's own proprietary groups (0xEF, 0xFF) lie on page 0.
constexpr std::uint32_t kNmeaPgnFirst = 0x1ED00;
constexpr std::uint32_t kNmeaPgnLast = 0x1FFFF;
constexpr std::uint32_t kPgnMask = 0x3FFFF;

std::uint64_t largest(const Signal& signal) {
  const bool is_signed = signal.type == ValueType::kSigned;
  const unsigned bits = signal.length_bits - (is_signed ? 1U : 0U);
  return bits == 0 ? 0 : ~std::uint64_t{0} >> (kBitsMax - bits);
}

std::uint64_t nmea_count(std::uint64_t most, unsigned bits) {
  if (bits >= kByteBits) return 3;
  if (most >= 15) return 2;
  return most >= 2 ? 1 : 0;
}

bool has_codes(const Signal& signal) {
  return signal.is_integer() && signal.length_bits > 0 && signal.length_bits <= kBitsMax;
}

// --- labels --------------------------------------------------------------------------------------

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || static_cast<unsigned char>(c) >= 0x80;
}

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

bool is_word(char c) {
  return is_letter(c) || is_digit(c);
}

bool begins_word(char before, char c) {
  return c >= 'A' && c <= 'Z' && before >= 'a' && before <= 'z';
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t at = text.find(from); at != text.npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

/// Lower case, with a blank before each word of "NotAvailable" (not inside "0xFFFF"), umlauts
/// written out, and "n/a" and "n.a." as "na".
std::string plain_text(std::string_view label) {
  std::string text;
  bool in_number = false;
  for (std::size_t i = 0; i < label.size(); ++i) {
    const char c = label[i];
    const bool upper = c >= 'A' && c <= 'Z';
    const char lower = upper ? static_cast<char>(c - 'A' + 'a') : c;
    const bool in_word = i > 0 && text.back() != ' ' && is_word(text.back());
    if (!in_word) in_number = is_digit(c);
    if (i > 0 && !in_number && begins_word(label[i - 1], c)) text += ' ';
    text += lower;
  }
  constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kSpelled{
      {{"ü", "ue"}, {"Ü", "ue"}, {"n/a", "na"}, {"n.a.", "na"}, {"n.v.", "nv"}}};
  for (const auto& [from, to] : kSpelled)
    replace_all(text, from, to);
  return text;
}

/// The words of a label without its numbers.
std::vector<std::string> words_of(std::string_view label) {
  std::vector<std::string> words;
  std::string word;
  for (const char c : plain_text(label) + ' ') {
    if (is_word(c)) {
      word += c;
      continue;
    }
    if (!word.empty() && !is_digit(word[0])) words.push_back(word);
    word.clear();
  }
  return words;
}

template <std::size_t N>
bool is_one_of(std::string_view text, const std::array<std::string_view, N>& list) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

/// The label without words that carry no meaning.
std::string core_of(std::string_view label) {
  constexpr std::array<std::string_view, 22> kSaysNothing{
      "signal",    "value",     "data",        "sensor",    "measurement", "reading",
      "parameter", "the",       "is",          "indicator", "state",       "status",
      "code",      "wert",      "daten",       "messwert",  "ist",         "information",
      "info",      "currently", "temporarily", "momentan"};
  const std::vector<std::string> words = words_of(label);
  std::string core;
  for (const std::string& word : words) {
    if (is_one_of(std::string_view(word), kSaysNothing)) continue;
    core += (core.empty() ? "" : " ") + word;
  }
  // "Signal not available (SNA)" repeats its meaning.
  constexpr std::string_view kTwice = " sna";
  if (core.size() > kTwice.size() && core.ends_with(kTwice))
    core.resize(core.size() - kTwice.size());
  return core;
}

bool says_unavailable(std::string_view core) {
  constexpr std::array<std::string_view, 15> kSaid{
      "not available",   "na",           "sna",         "unavailable",      "not avail",
      "not availible",   "notavailable", "no",          "nicht verfuegbar", "nicht verfgbar",
      "nicht vorhanden", "nv",           "not present", "missing",          "keine"};
  // "no data", "keine Daten" and "Signal missing" have lost their noun above.
  return is_one_of(core, kSaid);
}

bool says_invalid(std::string_view core) {
  constexpr std::array<std::string_view, 13> kSaid{
      "invalid", "not valid", "unvalid", "ungueltig", "ungueltiger", "nicht gueltig", "error",
      "fehler",  "fault",     "failure", "defekt",    "invalide",    "fehlerhaft"};
  return is_one_of(core, kSaid);
}

bool says_opposite(std::string_view core) {
  constexpr std::array<std::string_view, 16> kSaid{
      "valid",      "ok",          "good",       "available", "no error", "no fault",
      "gueltig",    "kein fehler", "verfuegbar", "normal",    "io",       "in ordnung",
      "no failure", "error free",  "fault free", "present"};
  return is_one_of(core, kSaid);
}

}  // namespace

Codes codes_of(const Signal& signal, CodeRules rules) {
  if (rules == CodeRules::kNone || !has_codes(signal)) return {};
  const std::uint64_t most = largest(signal);
  if (rules == CodeRules::kJ1939) {
    const bool measures = signal.type == ValueType::kUnsigned && signal.length_bits >= kByteBits;
    if (!measures) return {};
    return {kJ1939First << (signal.length_bits - kByteBits), most};
  }
  const std::uint64_t count = nmea_count(most, signal.length_bits);
  return count == 0 ? Codes{} : Codes{most - count + 1, most};
}

std::string_view code_text(const Signal& signal, CodeRules rules, std::int64_t raw) {
  const Codes codes = codes_of(signal, rules);
  if (!codes.contains(raw)) return {};
  const auto bits = static_cast<std::uint64_t>(raw);
  if (rules == CodeRules::kNmea2000) {
    constexpr std::array<std::string_view, 3> kFromTheTop{"not available", "out of range",
                                                          "reserved"};
    return kFromTheTop[codes.last - bits];
  }
  const std::uint64_t top = bits >> (signal.length_bits - kByteBits);
  if (top == kJ1939NotAvailable) return "not available";
  if (top == kJ1939Error) return "error";
  return top >= kJ1939Reserved ? "reserved" : "parameter specific";
}

std::optional<CodeRules> code_rules_from(std::string_view name) {
  for (const CodeRules rules : {CodeRules::kNone, CodeRules::kJ1939, CodeRules::kNmea2000}) {
    if (to_string(rules) == name) return rules;
  }
  return std::nullopt;
}

std::string_view to_string(CodeRules rules) {
  if (rules == CodeRules::kJ1939) return "j1939";
  return rules == CodeRules::kNmea2000 ? "nmea2000" : "none";
}

bool names_nmea2000(std::string_view protocol) {
  std::string name;
  for (const char c : protocol) {
    const char lower = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    if (is_word(lower)) name += lower;
  }
  return name == "nmea2000" || name == "n2k";
}

CodeRules code_rules_of(std::uint32_t id, bool is_j1939, std::string_view protocol) {
  if (!is_j1939) return CodeRules::kNone;
  const std::uint32_t pgn = id >> kByteBits & kPgnMask;
  const bool own_group = pgn >= kNmeaPgnFirst && pgn <= kNmeaPgnLast;
  return own_group || names_nmea2000(protocol) ? CodeRules::kNmea2000 : CodeRules::kJ1939;
}

bool labelled_no_value(const Signal& signal, std::int64_t raw) {
  if (signal.length_bits < 2) return false;
  const std::string* label = signal.label(raw);
  if (label == nullptr) return false;
  const std::string core = core_of(*label);
  const bool unavailable = says_unavailable(core);
  if (!unavailable && !says_invalid(core)) return false;
  return std::none_of(signal.labels.begin(), signal.labels.end(), [&](const ValueLabel& other) {
    const std::string words = core_of(other.text);
    return unavailable ? words == "available" || words == "verfuegbar" : says_opposite(words);
  });
}

NoValues::NoValues(const Signal& signal, CodeRules rules) : codes_(codes_of(signal, rules)) {
  for (const ValueLabel& label : signal.labels) {
    if (labelled_no_value(signal, label.raw)) labelled_.push_back(label.raw);
  }
  const bool plain = signal.unit.empty() && signal.factor == 1.0 && signal.offset == 0.0;
  if (!plain || codes_.empty()) return;
  const bool leaves_some_out =
      signal.minimum < signal.maximum && signal.maximum < static_cast<double>(codes_.last);
  if (!leaves_some_out) {
    codes_ = {};
  } else if (signal.maximum >= static_cast<double>(codes_.first)) {
    codes_.first = static_cast<std::uint64_t>(signal.maximum) + 1;
  }
}

bool NoValues::contains(std::int64_t raw) const {
  return codes_.contains(raw) ||
         std::find(labelled_.begin(), labelled_.end(), raw) != labelled_.end();
}

}  // namespace vgyro::dbc
