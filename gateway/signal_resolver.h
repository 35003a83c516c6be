#pragma once

// Names in a configuration → bits in frames: finds message and signal in the DBC file, turns the
// unit into the product's own, and decides which values can be used. Errors go to the
// reader's list, with the line of the key that was wrong.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/toml_reader.h"
#include "dbc/database.h"
#include "gateway/plan.h"
#include "gateway/units.h"

namespace vgyro::gateway {

/// Loaded DBC files by path, each read once.
class DatabaseCache {
 public:
  explicit DatabaseCache(std::vector<Error>& warnings) : warnings_(warnings) {}
  /// Null after an error.
  const dbc::Database* get(const std::string& path, TomlReader& reader);
  /// Null if it was never requested, or after an error.
  [[nodiscard]] const dbc::Database* loaded(const std::string& path) const;
  [[nodiscard]] std::vector<std::string> paths() const;

 private:
  std::map<std::string, std::unique_ptr<dbc::Database>> files_;
  std::vector<Error>& warnings_;
};

/// Values for a table that lacks these keys; an empty one makes its key required.
struct SignalDefaults {
  std::string bus = {};
  std::string dbc = {};
  std::string message = {};
};

/// One message of one table of the configuration.
class SignalResolver {
 public:
  /// Reads the keys bus, dbc, message, codes of the table.
  SignalResolver(TomlReader& reader, DatabaseCache& cache, const std::string& config_folder,
                 std::vector<std::string>& buses, std::vector<Error>& warnings,
                 const SignalDefaults& defaults = {});

  [[nodiscard]] bool usable() const { return message_ != nullptr; }
  [[nodiscard]] const std::string& bus() const { return bus_; }
  [[nodiscard]] const dbc::Message& message() const { return *message_; }
  [[nodiscard]] FrameMatch match() const;
  /// The rules of the message's codes, from its DBC file or the configuration.
  [[nodiscard]] dbc::CodeRules rules() const { return rules_; }
  [[nodiscard]] const std::string& dbc_path() const { return dbc_path_; }
  /// Defaults for a table that need not repeat these keys.
  [[nodiscard]] const SignalDefaults& named() const { return named_; }

  /// The signal that `key` names; null after an error, or if the key is absent.
  const dbc::Signal* signal(std::string_view key, bool required);
  const dbc::Signal* signal_named(std::string_view name, std::string_view key);

  /// Is `helper` on every page that has `main`? Reports an error at `key` if not.
  bool shares_page(std::string_view key, const dbc::Signal& helper, const dbc::Signal& main);

  std::optional<Quantity> quantity(const dbc::Signal& signal, std::string_view key,
                                   Dimension dimension,
                                   const std::optional<std::string>& unit = {});
  std::optional<dbc::SignalCodec> codec(const dbc::Signal& signal);
  /// The pages that carry the signal; nothing after an error.
  std::optional<dbc::Presence> presence(const dbc::Signal& signal);

 private:
  [[nodiscard]] std::string signal_place(const dbc::Signal& signal) const;
  void set_limits(Quantity& quantity, const dbc::Signal& signal, Dimension dimension);
  void exclude_codes(Quantity& quantity, const dbc::Signal& signal) const;
  void find_message(std::string_view name, DatabaseCache& cache);
  std::optional<dbc::CodeRules> read_code_rules();

  TomlReader& reader_;
  std::vector<Error>& warnings_;
  SignalDefaults named_;  ///< as configured
  std::string bus_;
  can::BusIndex bus_index_ = 0;
  std::string dbc_path_;
  const dbc::Message* message_ = nullptr;
  const dbc::Database* database_ = nullptr;
  dbc::CodeRules rules_ = dbc::CodeRules::kNone;  ///< from the key "codes", or from the DBC file
};

/// The key "bus" of any table; reports an error if it cannot be an interface.
std::string required_bus(TomlReader& reader);

/// The index of the name; adds it if it is new.
can::BusIndex bus_index(std::vector<std::string>& buses, const std::string& name);

}  // namespace vgyro::gateway
