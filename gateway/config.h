#pragma once

// vgyro.toml and the DBC files it names → a Plan. Every error names file, line and remedy; all
// errors of a file are reported at once. Nothing is guessed.

#include <optional>
#include <string>
#include <vector>

#include <tl/expected.hpp>

#include "base/error.h"
#include "gateway/config_files.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// The least severe messages that are logged, as priorities of syslog.
enum class LogLevel : int { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6, kDebug = 7 };

struct Resolved {
  Plan plan;
  /// What was read: DBC files, the model file, the configuration and its overlays.
  std::vector<std::string> files;
  ConfigText text;  ///< the merged values of the configuration and its overlays, the last of
                    ///< `files`
  LogLevel log_level = LogLevel::kInfo;  ///< of the live gateway: [log] level
  std::vector<Error> warnings;           ///< usable, but worth the user's attention
};

using ConfigResult = tl::expected<Resolved, std::vector<Error>>;

struct ConfigOverrides {
  std::optional<Method> method = {};      ///< instead of [corrector] method
  std::optional<std::string> model = {};  ///< path, instead of [corrector] model
};

/// Reads the file and its overlays (gateway/config_files.h); paths inside are relative to the file
/// itself.
ConfigResult load_config(const std::string& path, const ConfigOverrides& overrides = {});

/// config_fingerprint() of a loaded configuration with the same overrides. Reads DBC and model
/// files again.
std::string fingerprint_of(const Resolved& loaded, const ConfigOverrides& overrides);

/// The methods of this build by name; nothing for any other word.
std::optional<Method> method_from(std::string_view name);
std::string_view to_string(Method method);

}  // namespace vgyro::gateway
