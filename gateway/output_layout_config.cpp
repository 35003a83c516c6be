#include "gateway/output_layout_config.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "dbc/e2e.h"
#include "dbc/layout.h"
#include "gateway/config.h"
#include "gateway/e2e_config.h"
#include "gateway/gyro_input.h"
#include "gateway/input_frames.h"
#include "gateway/output_field.h"
#include "gateway/status.h"
#include "gateway/valid_config.h"

namespace vgyro::gateway {

namespace {

// J1939-21: the null address, which no node has, and the global address, which reaches all.
constexpr std::uint32_t kNullAddress = 0xFE;
constexpr std::uint32_t kGlobalAddress = 0xFF;
// PDU formats below are sent to one address, in the byte that other formats use for their number.
constexpr std::uint32_t kPdu2First = 240;
// Rounding to such steps adds up to a degree a day; a car's own sensor has 0.01 to 0.06 deg/s.
constexpr double kCoarse_dps = 0.1;
// No road vehicle turns faster in normal driving; a boat reaches a third of it.
constexpr double kNarrow_dps = 100.0;
constexpr double kEveryMost_ms = 60'000.0;
constexpr std::size_t kProfile1Values = 15;  // 15 itself is "invalid"
constexpr unsigned kNibble = 4;

// Usual names of signals that receivers check, compared in lower case.
constexpr std::array<std::string_view, 4> kCrcNames{"crc", "checksum", "chksum", "chksm"};
constexpr std::array<std::string_view, 4> kCounterNames{"counter", "alive", "cntr", "rolling"};

using Payload = std::array<std::uint8_t, can::kFdBytesMax>;

Payload mask_of(const dbc::SignalCodec& codec) {
  Payload mask{};
  codec.encode_raw(~std::uint64_t{0}, mask);
  return mask;
}

// The bits that arrange() writes are those that come out the same from zeros and from ones.
Payload mask_of(const dbc::Presence& presence) {
  Payload zeros{};
  Payload ones;
  ones.fill(0xFF);
  presence.arrange(zeros);
  presence.arrange(ones);
  Payload mask{};
  for (std::size_t i = 0; i < mask.size(); ++i)
    mask[i] = static_cast<std::uint8_t>(~(zeros[i] ^ ones[i]));
  return mask;
}

bool overlap(const Payload& a, const Payload& b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if ((a[i] & b[i]) != 0) return true;
  }
  return false;
}

void add(Payload& to, const Payload& mask) {
  for (std::size_t i = 0; i < to.size(); ++i)
    to[i] = static_cast<std::uint8_t>(to[i] | mask[i]);
}

/// One rate while its part of the plan is made: the keys that define its output, and their signals.
struct RateEntry {
  std::size_t axis = 0;
  std::string rate, sign, sign_signal, sigma, valid, invalid;  ///< keys
  const dbc::Signal* rate_signal = nullptr;
  const dbc::Signal* sign_signal_found = nullptr;
  const dbc::Signal* sigma_signal = nullptr;
};

constexpr std::array<std::string_view, 3> kOfOneRate{"rate", "sign_signal", "sigma"};

RateEntry entry_named(std::string_view ending, std::size_t axis) {
  const auto key = [&](std::string_view name) { return fmt::format("{}{}", name, ending); };
  return {.axis = axis,
          .rate = key("rate"),
          .sign = key("sign"),
          .sign_signal = key("sign_signal"),
          .sigma = key("sigma"),
          .valid = key("valid"),
          .invalid = key("invalid")};
}

/// "_x" of the vehicle's axis x.
std::string ending_of(std::size_t axis) {
  return fmt::format("_{}", kAxisNames[axis]);
}

/// Reads one table.
class LayoutReader {
 public:
  LayoutReader(const toml::table& table, TableContext context, Plan& plan)
      : reader_(table, context.file, "[[output.layout]]", context.errors),
        context_(context),
        resolver_(reader_, context.cache, context.folder, plan.buses, context.warnings,
                  {.bus = plan.buses[plan.output.bus]}),
        method_(plan.corrector.method),
        axes_(plan.output.axes) {}

  std::optional<OutputLayout> read();

 private:
  void find_entries();
  void refuse_besides(const RateEntry& entry);
  void check_axes_keys();
  void forgive_all();
  void begin_layout(const Quantity& quantity);
  void read_rate(const RateEntry& entry);
  void read_entry(const RateEntry& entry, LayoutRate& one);
  void read_sign(const RateEntry& entry, LayoutRate& one);
  void read_sigma(const RateEntry& entry, LayoutRate& one);
  std::optional<OutputFlag> read_valid(const std::string& key, const std::string& invalid);
  std::optional<OutputFlag> flag_of(const NamedCondition& valid, const std::string& key,
                                    const std::string& invalid);
  void read_protection();
  void check_header(const CheckValue& crc);
  bool read_fd();
  void read_id();
  void read_source_address();
  void read_every();
  void read_axis();
  void take(std::string_view key, const Payload& mask);
  bool on_page(std::string_view key, const dbc::Signal& signal);
  void fill_rest();
  std::optional<RawValue> filled(const dbc::Signal& signal, const toml::table* fill);
  void check_fill(const toml::table* fill);
  void warn_of_resting(const dbc::Signal& signal, const RawValue& value);
  void warn_of_rate(const RateEntry& entry, const LayoutRate& one);
  void complain(std::string_view key, const Error& error) {
    reader_.complain(reader_.where(key), error.what, error.remedy);
  }

  TomlReader reader_;
  TableContext context_;
  SignalResolver resolver_;
  Method method_;
  const std::vector<std::size_t>& axes_;  ///< of the platform; empty: a single axis
  bool by_axes_ = false;                  ///< rate_x … instead of rate
  std::vector<RateEntry> entries_;
  std::optional<std::string> unit_;  ///< of all rates, as are none_raw_ and sign_
  std::optional<std::int64_t> none_raw_;
  double sign_ = 1.0;
  bool fd_ = false;
  dbc::CodeRules rules_ = dbc::CodeRules::kNone;
  const dbc::Signal* rate_ = nullptr;   ///< the first one
  std::optional<OutputLayout> layout_;  ///< set once a rate is known
  Payload taken_{};                     ///< bits of signals that a key has named, or that select
                                        ///< the page
};

std::optional<OutputLayout> LayoutReader::read() {
  const std::size_t errors_before = context_.errors.size();
  find_entries();
  rate_ = entries_.front().rate_signal;
  if (rate_ != nullptr) {
    fd_ = read_fd();
    rules_ = resolver_.rules();
    unit_ = reader_.text("unit");
    none_raw_ = reader_.integer("rate_not_available");
    for (const RateEntry& entry : entries_) {
      if (entry.rate_signal != nullptr) read_rate(entry);
    }
  }
  if (layout_ && context_.errors.size() == errors_before) {
    read_id();
    read_source_address();
    sign_ = sign_of(reader_).value_or(1.0);
    for (std::size_t i = 0; i < entries_.size(); ++i)
      read_entry(entries_[i], layout_->rates[i]);
    layout_->valid = read_valid("valid", "invalid");
    read_protection();
    read_every();
    read_axis();
    fill_rest();
    for (std::size_t i = 0; i < entries_.size(); ++i)
      warn_of_rate(entries_[i], layout_->rates[i]);
  } else {
    forgive_all();
  }
  reader_.finish();
  if (context_.errors.size() > errors_before) return std::nullopt;
  return layout_;
}

// Finds the rates that the table names: one, or those about some of the axes.
void LayoutReader::find_entries() {
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    RateEntry entry = entry_named(ending_of(axis), axis);
    if (reader_.has(entry.rate)) {
      entries_.push_back(std::move(entry));
    } else {
      refuse_besides(entry);
    }
  }
  by_axes_ = !entries_.empty();
  if (by_axes_) check_axes_keys();
  if (!by_axes_) entries_.push_back(entry_named("", 0));
  for (RateEntry& entry : entries_) {
    entry.rate_signal = resolver_.signal(entry.rate, !by_axes_);
    entry.sign_signal_found = resolver_.signal(entry.sign_signal, false);
    entry.sigma_signal = resolver_.signal(entry.sigma, false);
  }
}

// Reports keys for an axis whose rate the table does not name.
void LayoutReader::refuse_besides(const RateEntry& entry) {
  for (const std::string& key :
       {entry.sign, entry.sign_signal, entry.sigma, entry.valid, entry.invalid}) {
    if (!reader_.has(key)) continue;
    reader_.forgive({key});
    reader_.complain(reader_.where(key), fmt::format("{} without {}", key, entry.rate),
                     fmt::format("{} = \"SIGNAL\", the rate that it is of", entry.rate));
  }
}

void LayoutReader::check_axes_keys() {
  const std::string& key = entries_.front().rate;
  if (axes_.empty()) {
    reader_.complain(reader_.where(key), fmt::format("{} is of a platform of several axes", key),
                     "rate = \"SIGNAL\", or rate_x, rate_y, rate_z in the [[gyro]] tables");
    return;
  }
  for (const std::string_view one : kOfOneRate) {
    if (!reader_.has(one)) continue;
    reader_.forgive({one});
    reader_.complain(reader_.where(one), fmt::format("{} cannot be combined with {}", one, key),
                     fmt::format("{}{} for the axis that it is of", one, ending_of(axes_.back())));
  }
  for (const RateEntry& entry : entries_) {
    if (std::find(axes_.begin(), axes_.end(), entry.axis) != axes_.end()) continue;
    reader_.complain(
        reader_.where(entry.rate),
        fmt::format("the units have no axis \"{}\"", kAxisNames[entry.axis]),
        fmt::format("leave {} out, or name that axis in both [[gyro]] tables", entry.rate));
  }
}

// Marks keys as known that are not read because of another error.
void LayoutReader::forgive_all() {
  reader_.forgive({"unit", "sign", "rate_not_available", "id", "source_address", "valid", "invalid",
                   "every_ms", "fd", "fill", "axis"});
  for (const RateEntry& entry : entries_)
    reader_.forgive({entry.sign, entry.valid, entry.invalid});
  forgive_e2e(reader_);
}

// On a platform of several axes, a layout with one rate carries one of them.
void LayoutReader::read_axis() {
  if (by_axes_) {
    if (!reader_.has("axis")) return;
    reader_.forgive({"axis"});
    reader_.complain(reader_.where("axis"),
                     fmt::format("axis cannot be combined with {}", entries_.front().rate),
                     "leave it out, or rate = \"SIGNAL\" where the message carries one axis");
    return;
  }
  if (axes_.empty()) {
    if (!reader_.has("axis")) return;
    reader_.forgive({"axis"});
    reader_.complain(reader_.where("axis"), "axis is of a platform of several axes",
                     "leave it out, or rate_x, rate_y, rate_z in the [[gyro]] tables");
    return;
  }
  std::string names;
  bool found = false;
  const std::string name = reader_.required_text("axis", "z");
  for (const std::size_t axis : axes_) {
    names += fmt::format("{}\"{}\"", names.empty() ? "" : ", ", kAxisNames[axis]);
    if (name.size() != 1 || name[0] != kAxisNames[axis]) continue;
    layout_->rates.front().axis = axis;
    found = true;
  }
  if (found || name.empty()) return;
  reader_.complain(reader_.where("axis"), fmt::format("the units have no axis \"{}\"", name),
                   names);
}

void LayoutReader::take(std::string_view key, const Payload& mask) {
  if (overlap(taken_, mask)) {
    reader_.complain(reader_.where(key),
                     fmt::format("{} shares bits of {} with another key", key, layout_->message),
                     "every key needs a signal of its own");
  }
  add(taken_, mask);
}

// Precondition: the page of the rate is selected.
bool LayoutReader::on_page(std::string_view key, const dbc::Signal& signal) {
  const auto presence = dbc::Presence::make(resolver_.message(), signal, {});
  if (presence && presence->holds({layout_->blank.data(), layout_->bytes})) return true;
  reader_.complain(reader_.where(key),
                   fmt::format("{} is not on the page of {}", signal.name, rate_->name),
                   "use signals of the frame that carries the rate");
  return false;
}

void LayoutReader::read_rate(const RateEntry& entry) {
  const auto quantity = resolver_.quantity(*entry.rate_signal, entry.rate, Dimension::kRate, unit_);
  if (!quantity) return;
  auto field = output_field(*entry.rate_signal, *quantity, rules_, none_raw_);
  if (!field) return complain(none_raw_ ? "rate_not_available" : entry.rate, field.error());
  if (!layout_) begin_layout(*quantity);
  if (!on_page(entry.rate, *entry.rate_signal)) return;
  take(entry.rate, mask_of(field->codec));
  layout_->rates.push_back({.rate = std::move(*field), .axis = entry.axis});
}

// Starts the frame, with the page of the first rate selected.
void LayoutReader::begin_layout(const Quantity& quantity) {
  layout_.emplace(OutputLayout{
      .bus = resolver_.match().bus,
      .message = resolver_.message().name,
      .fd = fd_,
      .bytes = static_cast<std::uint8_t>(can::fd_padded_length(resolver_.match().bytes))});
  // J1939 and NMEA 2000 fill unused bits with ones.
  if (rules_ != dbc::CodeRules::kNone) layout_->blank.fill(0xFF);
  quantity.presence.arrange(layout_->blank);
  add(taken_, mask_of(quantity.presence));
}

void LayoutReader::read_entry(const RateEntry& entry, LayoutRate& one) {
  read_sign(entry, one);
  if (entry.sigma_signal != nullptr) read_sigma(entry, one);
  // With a single rate, `valid` belongs to the frame.
  if (by_axes_) one.valid = read_valid(entry.valid, entry.invalid);
}

void LayoutReader::read_sign(const RateEntry& entry, LayoutRate& one) {
  if (by_axes_) one.rate.scale *= sign_of(reader_, entry.sign).value_or(1.0);
  one.rate.scale *= sign_;
  const dbc::Signal* signal = entry.sign_signal_found;
  if (signal == nullptr || !on_page(entry.sign_signal, *signal)) return;
  const auto codec = resolver_.codec(*signal);
  if (!codec) return;
  one.sign = *codec;
  take(entry.sign_signal, mask_of(*codec));
}

void LayoutReader::read_sigma(const RateEntry& entry, LayoutRate& one) {
  const dbc::Signal& signal = *entry.sigma_signal;
  const auto quantity = resolver_.quantity(signal, entry.sigma, Dimension::kRate);
  if (!quantity || !on_page(entry.sigma, signal)) return;
  auto field = output_field(signal, *quantity, rules_);
  if (!field) return complain(entry.sigma, field.error());
  field->minimum = std::max(field->minimum, 0.0);
  if (!field->has_code) {
    if (method_ != Method::kOptimal) {
      reader_.complain(reader_.where(entry.sigma),
                       fmt::format("{} states no σ, and {} has no code for \"not available\"",
                                   to_string(method_), signal.name),
                       fmt::format("leave {} out, or method = \"optimal\"", entry.sigma));
    }
    // Beside an invalid rate: the largest σ that the signal can carry.
    Payload scratch{};
    field->codec.encode(field->maximum, scratch);
    field->none_raw = static_cast<std::uint64_t>(field->codec.decode(scratch).raw);
  }
  take(entry.sigma, mask_of(field->codec));
  one.sigma = std::move(*field);
}

std::optional<OutputFlag> LayoutReader::read_valid(const std::string& key,
                                                   const std::string& invalid) {
  const auto valid = read_condition(reader_, resolver_, *rate_, key);
  if (!valid) {
    if (reader_.has(invalid) && !reader_.has(key)) {
      reader_.complain(reader_.where(invalid), fmt::format("{} without {}", invalid, key),
                       fmt::format("{} = \"Status == 0\", which names the signal", key));
    }
    reader_.forgive({invalid});
    return std::nullopt;
  }
  if (!on_page(key, *valid->signal)) return std::nullopt;
  take(key, mask_of(valid->condition.codec));
  return flag_of(*valid, key, invalid);
}

// Finds what to write for a comparison that must hold, and for one that must not.
std::optional<OutputFlag> LayoutReader::flag_of(const NamedCondition& valid, const std::string& key,
                                                const std::string& invalid) {
  const dbc::SignalCodec& codec = valid.condition.codec;
  OutputFlag flag{.name = valid.signal->name, .codec = codec, .text = valid.condition.text};
  Payload scratch{};
  const auto says_valid = [&] { return holds(valid.condition, codec.decode(scratch).value); };
  const auto raw = [&] { return static_cast<std::uint64_t>(codec.decode(scratch).raw); };
  if (!put_valid(valid.condition, scratch)) {
    reader_.complain(reader_.where(key), fmt::format("no value of the signal fulfils {} = \"{}\"",
                                                     key, valid.condition.text));
    return std::nullopt;
  }
  flag.valid_raw = raw();
  bool found = false;
  const auto offer = [&](std::uint64_t candidate) {
    codec.encode_raw(candidate, scratch);
    if (!found && !says_valid()) {
      flag.invalid_raw = raw();
      found = true;
    }
  };
  if (const auto wanted = reader_.number(invalid)) {
    codec.encode(*wanted, scratch);
    if (says_valid() || codec.decode(scratch).value != *wanted) {
      const std::string why =
          says_valid() ? fmt::format("is what `{}` calls valid", key) : "cannot be said";
      reader_.complain(reader_.where(invalid), fmt::format("{} = {:g} {}", flag.name, *wanted, why),
                       "a value of the signal for which the comparison is false");
      return std::nullopt;
    }
    flag.invalid_raw = raw();
    found = true;
  }
  if (const auto none = not_available(*valid.signal, rules_)) offer(none->raw);
  offer(~std::uint64_t{0});
  offer(0);
  for (const double near : {valid.condition.value + 1.0, valid.condition.value - 1.0}) {
    codec.encode(near, scratch);
    offer(raw());
  }
  if (!found) {
    reader_.complain(reader_.where(key),
                     fmt::format("every value fulfils {} = \"{}\"", key, flag.text),
                     "a comparison that is false when the rate is not valid");
  }
  return flag;
}

void LayoutReader::read_protection() {
  if (reader_.has("max_delta_counter")) {
    reader_.complain(reader_.where("max_delta_counter"), "max_delta_counter is for inputs");
  }
  layout_->e2e = read_e2e(reader_, resolver_, *rate_);
  const dbc::Message& message = resolver_.message();
  if (std::optional<AliveCounter>& counter = layout_->e2e.counter) {
    const dbc::Signal& signal = *message.find_signal(counter->name);
    if (!on_page("counter", signal)) return;
    take("counter", mask_of(counter->codec));
    // The protocol's "not available" code is not a value of the counter.
    const dbc::Codes codes = dbc::codes_of(signal, rules_);
    if (!codes.empty() && codes.first < counter->modulus)
      counter->modulus = static_cast<std::uint32_t>(codes.first);
  }
  if (!layout_->e2e.crc) return;
  const dbc::Signal& signal = *message.find_signal(layout_->e2e.crc->name);
  const auto codec = resolver_.codec(signal);
  if (!codec || !on_page("crc", signal)) return;
  take("crc", mask_of(*codec));
  layout_->e2e.crc->protection = layout_->e2e.crc->protection.for_can_id(layout_->id);
  check_header(*layout_->e2e.crc);
}

// In AUTOSAR's profiles the counter has a fixed place, where the receiver looks for it.
void LayoutReader::check_header(const CheckValue& crc) {
  const dbc::E2eKind kind = *dbc::e2e_kind_from(crc.kind);
  const std::size_t header = dbc::E2eProtection::header_bytes(kind);
  if (header < 2) return;
  const std::size_t byte = dbc::bit_place(*resolver_.message().find_signal(crc.name)).first_byte;
  const bool whole_byte = kind == dbc::E2eKind::kProfile5;
  Payload wanted{};
  wanted[byte + header - 1] = whole_byte ? 0xFF : 0x0F;
  std::optional<AliveCounter>& counter = layout_->e2e.counter;
  if (!counter || mask_of(counter->codec) != wanted) {
    reader_.complain(reader_.where(counter ? "counter" : "e2e"),
                     fmt::format("{} has its counter in {} of byte {}", crc.kind,
                                 whole_byte ? "all" : "the low nibble", byte + header - 1),
                     "counter = \"NAME\", the signal at that place");
    return;
  }
  const bool is_1 = kind == dbc::E2eKind::kProfile1A || kind == dbc::E2eKind::kProfile1B ||
                    kind == dbc::E2eKind::kProfile1C;
  if (is_1) counter->modulus = kProfile1Values;
  if (kind == dbc::E2eKind::kProfile2) counter->modulus = 1U << kNibble;
  if (kind == dbc::E2eKind::kProfile1C) {
    Payload nibble{};
    nibble[byte + 1] = 0xF0;
    take("e2e", nibble);
  }
}

bool LayoutReader::read_fd() {
  const dbc::Message& message = resolver_.message();
  const bool fd = reader_.boolean("fd").value_or(message.is_fd);
  const std::size_t most = fd ? can::kFdBytesMax : can::kClassicBytesMax;
  if (message.size_bytes > most) {
    const bool in_packets = message.is_j1939 && !fd;
    reader_.complain(
        reader_.where(reader_.has("fd") ? "fd" : "message"),
        fmt::format("{} has {} bytes{}", message.name, message.size_bytes,
                    in_packets ? ", which J1939 and NMEA 2000 send in several frames" : ""),
        fmt::format("a message of one frame: {} holds {} bytes",
                    fd ? "CAN FD" : "without fd = true it", most));
  }
  return fd;
}

void LayoutReader::read_id() {
  const dbc::Message& message = resolver_.message();
  layout_->id = message.id;
  layout_->extended = message.extended;
  const auto id = reader_.integer("id");
  if (!id) return;
  const std::uint32_t most = message.extended ? can::kExtendedIdMax : can::kStandardIdMax;
  if (*id >= 0 && *id <= static_cast<std::int64_t>(most)) {
    layout_->id = static_cast<std::uint32_t>(*id);
    return;
  }
  reader_.complain(
      reader_.where("id"), fmt::format("id is {:#x}", *id),
      fmt::format("up to {:#x}: {} has {} bits", most, message.name, message.extended ? 29 : 11));
}

void LayoutReader::read_source_address() {
  const auto address = reader_.integer("source_address");
  const bool is_j1939 = resolver_.message().is_j1939;
  const bool wrong =
      address && (!is_j1939 || *address < 0 || *address >= static_cast<std::int64_t>(kNullAddress));
  if (wrong) {
    reader_.complain(reader_.where("source_address"),
                     "source_address is 0 to 253, for a J1939 message",
                     "a message is J1939 when its DBC attribute VFrameFormat is J1939PG");
    return;
  }
  if (!is_j1939) return;
  if (address) layout_->id = (layout_->id & ~0xFFU) | static_cast<std::uint32_t>(*address);
  // A receiver address in a DBC file is a placeholder, like the sender's; one from the
  // configuration is intended.
  const bool to_one = (layout_->id >> 16U & 0xFFU) < kPdu2First;
  if (to_one && !reader_.has("id")) layout_->id |= kGlobalAddress << 8U;
  if ((layout_->id & 0xFFU) >= kNullAddress) {
    reader_.complain(reader_.where("message"),
                     fmt::format("{} is sent from an address, and the DBC file has none",
                                 resolver_.message().name),
                     "source_address = N, 0 to 253, that nobody else on the bus has");
  }
}

void LayoutReader::read_every() {
  const auto every_ms = reader_.number("every_ms");
  if (!every_ms) return;
  if (!(*every_ms >= 1.0 && *every_ms <= kEveryMost_ms)) {
    reader_.complain(reader_.where("every_ms"), fmt::format("every_ms is {:g}", *every_ms),
                     fmt::format("1 to {:g}", kEveryMost_ms));
    return;
  }
  layout_->every = std::chrono::microseconds(std::llround(*every_ms * 1000.0));
}

// --- unused signals ------------------------------------------------------------------------------

// Fills the signals on the rate's page that no key names.
void LayoutReader::fill_rest() {
  const toml::table* fill = reader_.table("fill");
  check_fill(fill);
  const dbc::Message& message = resolver_.message();
  const std::span<std::uint8_t> payload{layout_->blank.data(), layout_->bytes};
  for (const dbc::Signal& signal : message.signals) {
    const auto codec = dbc::SignalCodec::make(signal, message.size_bytes, {});
    const auto presence = dbc::Presence::make(message, signal, {});
    if (!codec || !presence || !presence->holds(payload)) continue;
    const Payload mask = mask_of(*codec);
    if (overlap(mask, taken_)) continue;
    const auto value = filled(signal, fill);
    if (!value) return;
    if (fill == nullptr || !fill->contains(signal.name)) warn_of_resting(signal, *value);
    codec->encode_raw(value->raw, payload);
    add(taken_, mask);
    layout_->resting.push_back({signal.name, value->text});
  }
}

void LayoutReader::check_fill(const toml::table* fill) {
  if (fill == nullptr) return;
  const dbc::Message& message = resolver_.message();
  for (const auto& [key, node] : *fill) {
    const dbc::Signal* signal = resolver_.signal_named(key.str(), "fill");
    if (signal == nullptr) continue;
    const auto codec = dbc::SignalCodec::make(*signal, message.size_bytes, {});
    const auto presence = dbc::Presence::make(message, *signal, {});
    const bool there =
        codec && presence && presence->holds({layout_->blank.data(), layout_->bytes});
    if (there && !overlap(mask_of(*codec), taken_)) continue;
    reader_.complain(
        reader_.where("fill"),
        fmt::format("{} {}", signal->name,
                    there ? "is written by another key" : "is not in the frame of the rate"),
        "signals of the frame that no other key names");
  }
}

std::optional<RawValue> LayoutReader::filled(const dbc::Signal& signal, const toml::table* fill) {
  const toml::node* node = fill == nullptr ? nullptr : fill->get(signal.name);
  if (node == nullptr) return resting_value(signal, rules_);
  const auto number = node->value<double>();
  const auto codec = dbc::SignalCodec::make(signal, resolver_.message().size_bytes, {});
  const bool fits = number && node->is_number() && *number >= codec->representable_min() &&
                    *number <= codec->representable_max();
  if (!fits) {
    reader_.complain(reader_.where("fill"), fmt::format("{} cannot carry this value", signal.name),
                     fmt::format("a number, {:g} to {:g}", codec->representable_min(),
                                 codec->representable_max()));
    return std::nullopt;
  }
  Payload scratch{};
  codec->encode(*number, scratch);
  return RawValue{static_cast<std::uint64_t>(codec->decode(scratch).raw),
                  fmt::format("{:g} {}", *number, printable(signal.unit))};
}

// Receivers ignore frames with a constant counter or a wrong check value.
void LayoutReader::warn_of_resting(const dbc::Signal& signal, const RawValue& value) {
  const std::string name = lower(signal.name);
  const auto named = [&](const auto& parts) {
    return std::any_of(parts.begin(), parts.end(),
                       [&](std::string_view part) { return name.find(part) != name.npos; });
  };
  const bool is_crc = named(kCrcNames);
  if (!is_crc && !named(kCounterNames)) return;
  context_.warnings.push_back(
      {reader_.where("message"),
       fmt::format("{} of {} is always {}: a receiver that checks it accepts no frame", signal.name,
                   layout_->message, value.text),
       is_crc ? fmt::format("crc = \"{}\" and e2e, or fill", signal.name)
              : fmt::format("counter = \"{}\", or fill", signal.name)});
}

void LayoutReader::warn_of_rate(const RateEntry& entry, const LayoutRate& one) {
  const OutputField& rate = one.rate;
  const auto warn = [&](std::string what, std::string remedy) {
    context_.warnings.push_back({reader_.where(entry.rate), std::move(what), std::move(remedy)});
  };
  if (rate.step > kCoarse_dps) {
    warn(fmt::format("one step of {} is {:.3g} deg/s: its readers see little of what the virtual "
                     "gyro is better at",
                     rate.name, rate.step),
         "");
  }
  const double most = std::max(std::abs(rate.minimum), std::abs(rate.maximum));
  const double least = std::min(std::abs(rate.minimum), std::abs(rate.maximum));
  const double reach_dps = (one.sign ? most : least) * std::abs(rate.scale);
  if (reach_dps < kNarrow_dps) {
    warn(
        fmt::format("{} carries rates up to {:.4g} deg/s only{}; faster ones are sent as not valid",
                    rate.name, reach_dps, reach_dps == 0.0 ? " in one direction" : ""),
        one.sign || rate.minimum < 0.0
            ? ""
            : fmt::format("if the sign has a signal of its own, name it: {} = \"NAME\"",
                          entry.sign_signal));
  }
}

bool reads(const FrameMatch& input, can::BusIndex bus, const FrameId& id) {
  return input.bus == bus && input.extended == id.extended &&
         ((id.id ^ input.id) & input.mask) == 0;
}

std::string id_text(const FrameId& id) {
  return id.extended ? fmt::format("{:#010x}", id.id) : fmt::format("{:#x}", id.id);
}

}  // namespace

void read_output_layouts(TomlReader& output, TableContext context, Plan& plan) {
  const toml::array* tables = output.array("layout", "a list of tables: [[output.layout]]");
  if (tables == nullptr) return;
  if (tables->size() > kOutputLayoutsMost) {
    output.complain(output.where("layout"),
                    fmt::format("there are {} [[output.layout]] tables", tables->size()),
                    fmt::format("at most {}", kOutputLayoutsMost));
    return;
  }
  for (const toml::node& node : *tables) {
    const toml::table* table = node.as_table();
    if (table == nullptr) {
      output.complain(output.where("layout"), "layout must be written as [[output.layout]] tables");
      return;
    }
    auto layout = LayoutReader(*table, context, plan).read();
    if (layout) plan.output.layouts.push_back(std::move(*layout));
  }
}

void check_output_ids(TomlReader& output, const Plan& plan) {
  for (std::size_t i = 0; i < plan.buses.size(); ++i) {
    const auto bus = static_cast<can::BusIndex>(i);
    const std::vector<FrameId> ids = output_ids(plan.output, bus);
    for (auto id = ids.begin(); id != ids.end(); ++id) {
      if (std::find(std::next(id), ids.end(), *id) == ids.end()) continue;
      output.complain(output.where(), "two output frames have the same identifier",
                      fmt::format("{} on {}", id_text(*id), plan.buses[bus]));
    }
    if (plan.gyros.empty()) continue;
    for (const FrameMatch& input : plan.inputs()) {
      for (const FrameId& id : ids) {
        if (!reads(input, bus, id)) continue;
        output.complain(output.where(),
                        fmt::format("output identifier {} is also an input on {}", id_text(id),
                                    plan.buses[bus]),
                        id.extended ? "another bus, another id, or source_address of the input: "
                                      "the gateway would read what it sends"
                                    : "choose rate_id, bias_id and model_id that nobody else "
                                      "sends; a layout takes another id, or another bus");
      }
    }
  }
}

}  // namespace vgyro::gateway
