#include "dbc/writer.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>

#include <fmt/core.h>

namespace vgyro::dbc {

namespace {

constexpr std::uint32_t kExtendedBit = 0x80000000;
constexpr const char* kNobody = "Vector__XXX";

/// The shortest digits that read back as the same number.
std::string plain(double value) {
  std::array<char, 400> digits{};
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::fixed);
  return {digits.data(), end.ptr};
}

std::string quoted(std::string text) {
  std::replace(text.begin(), text.end(), '"', '\'');
  std::replace(text.begin(), text.end(), '\\', '/');
  return '"' + text + '"';
}

std::uint32_t id_of(const Message& message) {
  return message.id | (message.extended ? kExtendedBit : 0U);
}

std::string signal_text(const Signal& signal) {
  assert(!signal.condition && !signal.is_multiplexor);
  const bool is_signed = signal.type != ValueType::kUnsigned;
  return fmt::format(" SG_ {} : {}|{}@{}{} ({},{}) [{}|{}] {} {}\n", signal.name, signal.start_bit,
                     signal.length_bits, signal.byte_order == ByteOrder::kIntel ? 1 : 0,
                     is_signed ? '-' : '+', plain(signal.factor), plain(signal.offset),
                     plain(signal.minimum), plain(signal.maximum), quoted(signal.unit), kNobody);
}

std::string comments_text(const Message& message) {
  std::string text;
  if (!message.comment.empty())
    text += fmt::format("CM_ BO_ {} {};\n", id_of(message), quoted(message.comment));
  for (const Signal& signal : message.signals) {
    if (signal.comment.empty()) continue;
    text += fmt::format("CM_ SG_ {} {} {};\n", id_of(message), signal.name, quoted(signal.comment));
  }
  return text;
}

std::string labels_text(const Message& message) {
  std::string text;
  for (const Signal& signal : message.signals) {
    if (signal.labels.empty()) continue;
    text += fmt::format("VAL_ {} {}", id_of(message), signal.name);
    for (const ValueLabel& label : signal.labels)
      text += fmt::format(" {} {}", label.raw, quoted(label.text));
    text += " ;\n";
  }
  return text;
}

std::string floats_text(const Message& message) {
  std::string text;
  for (const Signal& signal : message.signals) {
    if (signal.is_integer()) continue;
    text += fmt::format("SIG_VALTYPE_ {} {} : {};\n", id_of(message), signal.name,
                        signal.type == ValueType::kFloat32 ? 1 : 2);
  }
  return text;
}

std::string formats_text(const std::vector<Message>& messages) {
  std::string text;
  for (const Message& message : messages) {
    if (!message.is_j1939) continue;
    if (text.empty()) {
      text =
          "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\","
          "\"J1939PG\";\nBA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n";
    }
    text += fmt::format("BA_ \"VFrameFormat\" BO_ {} 3;\n", id_of(message));
  }
  return text;
}

}  // namespace

std::string to_text(const std::vector<Message>& messages, const std::string& comment) {
  std::string text = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_:\n\n";
  for (const Message& message : messages) {
    text += fmt::format("BO_ {} {}: {} {}\n", id_of(message), message.name, message.size_bytes,
                        message.sender.empty() ? kNobody : message.sender);
    for (const Signal& signal : message.signals)
      text += signal_text(signal);
    text += "\n";
  }
  if (!comment.empty()) text += fmt::format("CM_ {};\n", quoted(comment));
  for (const Message& message : messages)
    text += comments_text(message);
  text += formats_text(messages);
  for (const Message& message : messages)
    text += labels_text(message);
  for (const Message& message : messages)
    text += floats_text(message);
  return text;
}

}  // namespace vgyro::dbc
