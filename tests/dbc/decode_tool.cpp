// Prints what the product reads in a DBC file and in frames, for tests in other languages.
// decode_tool FILE --layout         the messages as JSON
// decode_tool FILE < ID#HEX lines   one JSON object a line: signal -> [raw, value as text]

#include <cstdint>
#include <cstdio>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "dbc/multiplex.h"
#include "dbc/parser.h"

namespace {

using nlohmann::json;
using vgyro::dbc::ByteOrder;
using vgyro::dbc::Database;
using vgyro::dbc::Message;
using vgyro::dbc::MessageCodec;
using vgyro::dbc::Reading;
using vgyro::dbc::Signal;
using vgyro::dbc::ValueType;

json layout_of(const Signal& signal) {
  json labels = json::object();
  for (const auto& label : signal.labels)
    labels[std::to_string(label.raw)] = label.text;
  const bool is_float = signal.type == ValueType::kFloat32 || signal.type == ValueType::kFloat64;
  return {{"start_bit", signal.start_bit},
          {"length", signal.length_bits},
          {"intel", signal.byte_order == ByteOrder::kIntel},
          {"signed", signal.type == ValueType::kSigned},
          {"float", is_float},
          {"factor", signal.factor},
          {"offset", signal.offset},
          {"minimum", signal.minimum},
          {"maximum", signal.maximum},
          {"unit", signal.unit},
          {"comment", signal.comment},
          {"labels", labels}};
}

json layout_of(const Database& database) {
  json messages = json::object();
  for (const Message& message : database.messages) {
    json signals = json::object();
    for (const Signal& signal : message.signals)
      signals[signal.name] = layout_of(signal);
    messages[message.name] = {{"id", message.id},           {"extended", message.extended},
                              {"j1939", message.is_j1939},  {"size", message.size_bytes},
                              {"comment", message.comment}, {"signals", signals}};
  }
  json diagnostics = json::array();
  for (const auto& odd : database.diagnostics)
    diagnostics.push_back({odd.line, odd.what});
  return {{"messages", messages}, {"diagnostics", diagnostics}};
}

std::vector<std::uint8_t> bytes_of(std::string_view hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(
        static_cast<std::uint8_t>(std::stoul(std::string{hex.substr(i, 2)}, nullptr, 16)));
  }
  return bytes;
}

json decode(const std::vector<MessageCodec>& codecs, std::string_view frame) {
  const std::size_t hash = frame.find('#');
  const std::string id_text{frame.substr(0, hash)};
  const auto id = static_cast<std::uint32_t>(std::stoul(id_text, nullptr, 16));
  const std::vector<std::uint8_t> payload = bytes_of(frame.substr(hash + 1));
  json signals = json::object();
  for (const MessageCodec& codec : codecs) {
    if (!codec.message().matches(id, id_text.size() > 3)) continue;
    codec.for_each(payload, [&](const Signal& signal, const Reading& reading) {
      signals[signal.name] = {reading.raw, fmt::format("{:.17g}", reading.value)};
    });
  }
  return signals;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const auto database = vgyro::dbc::load(argv[1]);
  if (!database) {
    fmt::print(stderr, "{}\n", database.error().message());
    return 1;
  }
  if (argc > 2 && std::string_view{argv[2]} == "--layout") {
    std::cout << layout_of(*database).dump() << '\n';
    return 0;
  }
  std::vector<MessageCodec> codecs;
  for (const Message& message : database->messages)
    codecs.emplace_back(message, database->path);
  for (std::string line; std::getline(std::cin, line);) {
    std::cout << decode(codecs, line).dump() << '\n';
  }
  return 0;
}
