#include "gateway/e2e_config.h"

#include <string>
#include <vector>

#include <fmt/core.h>

#include "base/spelling.h"
#include "dbc/e2e.h"

namespace vgyro::gateway {

namespace {

constexpr std::int64_t kDataIdMost = 0xFFFF;
constexpr std::int64_t kDataIdMost1C = 0xFFF;   // the frame carries a nibble of the high byte
constexpr std::int64_t kDataIdMostList = 0xFF;  // profile 2: a byte for each counter

using DataIds = std::array<std::uint16_t, dbc::kE2eDataIdsMost>;

// Profiles 1 and 11 skip the value 15, whatever the DBC file says of the signal.
constexpr std::uint32_t kModulusProfile1 = 15;
constexpr unsigned kCounterBitsProfile1 = 4;

bool is_profile_1(dbc::E2eKind kind) {
  return kind == dbc::E2eKind::kProfile1A || kind == dbc::E2eKind::kProfile1B ||
         kind == dbc::E2eKind::kProfile1C;
}

/// Sets the counter's modulus from counter_max, the sender's profile or the DBC file's range. False
/// after an error.
bool set_modulus(TomlReader& reader, const dbc::Signal& signal,
                 const std::optional<CheckValue>& crc, AliveCounter& counter) {
  const std::int64_t bits_most = (std::int64_t{1} << signal.length_bits) - 1;
  const bool profile_1 =
      crc && is_profile_1(crc->protection.kind()) && signal.length_bits == kCounterBitsProfile1;
  if (profile_1) counter.modulus = kModulusProfile1;
  // AUTOSAR counters skip the last value; any other range in the DBC file says nothing about them.
  if (signal.maximum == static_cast<double>(bits_most - 1)) {
    counter.modulus = static_cast<std::uint32_t>(bits_most);
  }
  if (!reader.has("counter_max")) return true;
  const auto most = reader.integer("counter_max");
  if (!most) return false;
  if (*most < 1 || *most > bits_most) {
    reader.complain(
        reader.where("counter_max"), fmt::format("counter_max is {}", *most),
        fmt::format("1 to {}: {} has {} bits", bits_most, signal.name, signal.length_bits));
    return false;
  }
  if (profile_1 && *most != kModulusProfile1 - 1) {
    reader.complain(reader.where("counter_max"),
                    fmt::format("counter_max is {}, but the counter of {} runs from 0 to {}", *most,
                                crc->kind, kModulusProfile1 - 1),
                    "leave counter_max out");
    return false;
  }
  counter.modulus = static_cast<std::uint32_t>(*most + 1);
  counter.strict = true;
  return true;
}

std::optional<AliveCounter> read_counter(TomlReader& reader, SignalResolver& resolver,
                                         const dbc::Signal& main,
                                         const std::optional<CheckValue>& crc) {
  const auto max_delta = reader.integer("max_delta_counter");
  const dbc::Signal* signal = resolver.signal("counter", false);
  reader.forgive({"counter_max"});
  for (const char* key : {"max_delta_counter", "counter_max"}) {
    if (!reader.has(key) || reader.has("counter")) continue;
    reader.complain(reader.where(key), fmt::format("{} without a counter", key),
                    "counter = \"NAME\", the signal that it is about");
  }
  if (signal == nullptr || !resolver.shares_page("counter", *signal, main)) return std::nullopt;
  const auto codec = resolver.codec(*signal);
  if (!codec) return std::nullopt;
  if (!signal->is_integer() || signal->length_bits > 31 || signal->length_bits < 2) {
    reader.complain(reader.where("counter"),
                    fmt::format("{} cannot be an alive counter: it has {} bits", signal->name,
                                signal->length_bits),
                    "an integer signal of 2 to 31 bits");
    return std::nullopt;
  }
  const auto pages = resolver.presence(*signal);
  if (!pages) return std::nullopt;
  AliveCounter counter{signal->name, *codec, 1U << signal->length_bits};
  counter.presence = *pages;
  if (!set_modulus(reader, *signal, crc, counter)) return std::nullopt;
  if (!max_delta) return counter;
  if (*max_delta < 1 || *max_delta >= counter.modulus - 1) {
    reader.complain(reader.where("max_delta_counter"),
                    fmt::format("max_delta_counter is {}", *max_delta),
                    fmt::format("1 (none may be lost) to {}: {} runs from 0 to {}",
                                counter.modulus - 2, counter.name, counter.modulus - 1));
    return std::nullopt;
  }
  counter.max_delta = static_cast<std::uint32_t>(*max_delta);
  return counter;
}

/// The byte of a check value, the first if it has two. Nothing after an error.
std::optional<std::size_t> crc_byte(TomlReader& reader, const dbc::Signal& signal,
                                    const dbc::Message& message, dbc::E2eKind kind) {
  const bool wide = kind == dbc::E2eKind::kProfile5;
  const unsigned bits = wide ? 16 : 8;
  const bool intel = signal.byte_order == dbc::ByteOrder::kIntel;
  const unsigned first = signal.start_bit % 8U;
  const bool whole = signal.is_integer() && signal.length_bits == bits &&
                     (intel ? first == 0 : first == 7) && (intel || !wide);
  if (!whole) {
    reader.complain(
        reader.where("crc"),
        fmt::format("{} cannot carry this check value: {} bits from bit {}, {}", signal.name,
                    signal.length_bits, signal.start_bit, intel ? "Intel" : "Motorola"),
        wide ? "two whole bytes, Intel" : "one whole byte");
    return std::nullopt;
  }
  const std::size_t byte = signal.start_bit / 8U;
  if (byte + dbc::E2eProtection::header_bytes(kind) > message.size_bytes) {
    reader.complain(reader.where("crc"),
                    fmt::format("behind {} there is no byte that holds the counter", signal.name),
                    fmt::format("message {} has {} bytes", message.name, message.size_bytes));
    return std::nullopt;
  }
  return byte;
}

bool within(TomlReader& reader, std::int64_t id, std::int64_t most) {
  if (id >= 0 && id <= most) return true;
  reader.complain(reader.where("data_id"), fmt::format("a data ID is {:#x}", id),
                  fmt::format("0 to {:#x} for this kind", most));
  return false;
}

std::optional<DataIds> read_list(TomlReader& reader, const std::string& kind) {
  DataIds ids{};
  const bool there = reader.has("data_id");
  const toml::array* list = reader.array("data_id", "a list of 16 numbers: [0x12, …]");
  if (list == nullptr && there) return std::nullopt;  // an error was reported
  if (list == nullptr || list->size() != ids.size()) {
    reader.complain(reader.where("data_id"),
                    fmt::format("{} has {} data IDs", kind, list == nullptr ? 0 : list->size()),
                    "data_id = [0x12, …], one for each of the counter's 16 values");
    return std::nullopt;
  }
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto id = (*list)[i].value_exact<std::int64_t>();
    if (!id) {
      reader.complain(reader.where("data_id"), "a data ID is not a whole number", "0 to 0xFF");
      return std::nullopt;
    }
    if (!within(reader, *id, kDataIdMostList)) return std::nullopt;
    ids[i] = static_cast<std::uint16_t>(*id);
  }
  return ids;
}

std::optional<DataIds> read_data_ids(TomlReader& reader, dbc::E2eKind kind,
                                     const std::string& name) {
  if (kind == dbc::E2eKind::kProfile2) return read_list(reader, name);
  const bool has_none = kind == dbc::E2eKind::kCrc8J1850 || kind == dbc::E2eKind::kToyota;
  if (has_none && reader.has("data_id")) {
    reader.forgive({"data_id"});
    reader.complain(reader.where("data_id"), fmt::format("{} has no data ID", name),
                    "leave data_id out");
    return std::nullopt;
  }
  if (has_none) return DataIds{};
  const bool there = reader.has("data_id");
  const auto id = reader.integer("data_id");
  if (!id) {
    if (!there) {
      reader.complain(reader.where("e2e"), fmt::format("{} needs a data_id", name),
                      "data_id = 0x123, as the sender has it");
    }
    return std::nullopt;
  }
  if (!within(reader, *id, kind == dbc::E2eKind::kProfile1C ? kDataIdMost1C : kDataIdMost)) {
    return std::nullopt;
  }
  return DataIds{static_cast<std::uint16_t>(*id)};
}

std::optional<CheckValue> read_check_value(TomlReader& reader, SignalResolver& resolver,
                                           const dbc::Signal& main) {
  const auto name = reader.text("e2e");
  const dbc::Signal* signal = resolver.signal("crc", false);
  const auto names = dbc::e2e_kind_names();
  const std::vector<std::string> kinds(names.begin(), names.end());
  if (!name) {
    reader.forgive({"data_id"});
    if (reader.has("crc") && !reader.has("e2e")) {
      reader.complain(reader.where("crc"), "the kind of this check value is not configured",
                      "e2e = \"NAME\", " + suggest_name({}, kinds));
    } else if (reader.has("data_id") && !reader.has("e2e")) {
      reader.complain(reader.where("data_id"), "data_id without e2e",
                      "e2e = \"NAME\", " + suggest_name({}, kinds));
    }
    return std::nullopt;
  }
  const auto kind = dbc::e2e_kind_from(*name);
  if (!kind) {
    reader.forgive({"data_id"});
    reader.complain(reader.where("e2e"), fmt::format("there is no protection \"{}\"", *name),
                    suggest_name(*name, kinds));
    return std::nullopt;
  }
  const auto ids = read_data_ids(reader, *kind, *name);
  if (!reader.has("crc")) {
    reader.complain(reader.where("e2e"), fmt::format("{} without a check value", *name),
                    "crc = \"NAME\", the signal that carries it");
  }
  if (signal == nullptr || !ids || !resolver.shares_page("crc", *signal, main)) {
    return std::nullopt;
  }
  const dbc::Message& message = resolver.message();
  const auto byte = crc_byte(reader, *signal, message, *kind);
  if (!byte) return std::nullopt;
  return CheckValue{
      signal->name, *name,
      dbc::E2eProtection({.kind = *kind,
                          .crc_byte = *byte,
                          .bytes = resolver.match().bytes,
                          .data_ids = *ids,
                          .can_id = *kind == dbc::E2eKind::kToyota ? message.id : 0})};
}

}  // namespace

E2ePlan read_e2e(TomlReader& reader, SignalResolver& resolver, const dbc::Signal& main) {
  E2ePlan plan;
  plan.crc = read_check_value(reader, resolver, main);
  plan.counter = read_counter(reader, resolver, main, plan.crc);
  return plan;
}

void forgive_e2e(TomlReader& reader) {
  reader.forgive({"crc", "e2e", "data_id", "counter", "max_delta_counter", "counter_max"});
}

}  // namespace vgyro::gateway
