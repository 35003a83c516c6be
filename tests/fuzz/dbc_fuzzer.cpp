// Input: a frame's bytes and the text of a DBC file, both arbitrary. Reading must stay inside its
// memory.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "dbc/multiplex.h"
#include "dbc/parser.h"

namespace {

using vgyro::dbc::MessageCodec;
using vgyro::dbc::Reading;
using vgyro::dbc::Signal;
using vgyro::dbc::SignalCodec;

void encode_again(const vgyro::dbc::Message& message, std::span<const std::uint8_t> payload) {
  for (const Signal& signal : message.signals) {
    const auto codec = SignalCodec::make(signal, message.size_bytes, "fuzzer");
    if (!codec || !codec->fits(payload.size())) continue;
    std::vector<std::uint8_t> copy(payload.begin(), payload.end());
    codec->encode(codec->decode(payload).value, copy);
    static_cast<void>(codec->representable_min() < codec->representable_max());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // A copy of exactly this size lets the sanitizer see a read past its end.
  const std::size_t frame_bytes = size == 0 ? 0 : std::min<std::size_t>(data[0] % 65, size);
  const std::vector<std::uint8_t> payload(data, data + frame_bytes);
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const vgyro::dbc::Database database = vgyro::dbc::parse(text, "fuzzer.dbc");
  double sum = 0.0;
  for (const auto& message : database.messages) {
    const MessageCodec codec(message, database.path);
    codec.for_each(payload, [&sum](const Signal& signal, const Reading& reading) {
      sum += reading.value + (signal.label(reading.raw) != nullptr ? 1.0 : 0.0);
    });
    encode_again(message, payload);
  }
  static_cast<void>(sum);
  return 0;
}
