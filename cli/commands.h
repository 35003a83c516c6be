#pragma once

// The subcommands of `vgyro`, each in a file of its own. They return the exit code (exit_code.h);
// main() handles wrong usage.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "gateway/plan.h"

namespace vgyro::cli {

struct CheckOptions {
  std::string config;
  std::optional<gateway::Method> method;
  std::optional<std::string> model;  ///< path, instead of the configured one
};
int run_check(const CheckOptions& options);

struct InitOptions {
  std::vector<std::string> logs;
  std::vector<std::string> dbc_files;
  std::string output = "vgyro.toml";  ///< "-": standard output
  bool force = false;                 ///< replaces an existing file
  std::vector<std::uint32_t> ids{};   ///< identifiers to look at; empty: all
  double turned_deg = 0.0;            ///< in the whole log, positive to the left; 0: not given
};
int run_init(const InitOptions& options);

struct DecodeOptions {
  std::vector<std::string> dbc_files;
  std::vector<std::string> logs;
  bool text = false;
};
int run_decode(const DecodeOptions& options);

struct ConvertOptions {
  std::vector<std::string> logs;
  std::string output;   ///< "-": a candump log on standard output
  unsigned digits = 0;  ///< digits of a stamp's fraction, 6 or 9; 0: as in the logs
  bool quiet = false;
};
int run_convert(const ConvertOptions& options);

struct ReplayOptions {
  std::string config;
  std::optional<gateway::Method> method;
  std::optional<std::string> model;  ///< path, instead of the configured one
  std::string state;                 ///< file of biases to start with; empty: none
  std::string output;                ///< "-": standard output; empty: none
  std::string json;                  ///< "-": standard output; empty: none
  std::string csv;                   ///< "-": standard output; empty: none
  std::string plot;                  ///< empty: none
  std::string html;                  ///< "-": standard output; empty: none
  std::vector<std::string> bus_map;  ///< "LOGNAME=CONFIGNAME"
  std::vector<std::string> logs;
  unsigned digits = 0;  ///< digits of the output's stamps, 6 or 9; 0: as in the log
  bool quiet = false;
};
int run_replay(const ReplayOptions& options);

/// Lists the kinds of effects that a model file may hold.
int run_model_list();

struct AllanOptions {
  std::string config;
  std::string axis;      ///< "x", "y" or "z" of whole units; empty: all
  std::string json;      ///< "-": standard output; empty: none
  std::string plot;      ///< empty: none
  std::string evidence;  ///< file for a fleet; empty: none
  std::vector<std::string> logs;
};
int run_allan(const AllanOptions& options);

struct CompareOptions {
  std::string config;
  std::string model;
  std::vector<std::string> measured;  ///< logs, each a recording of its own
  std::string axis;                   ///< "x", "y" or "z" of whole units; empty: all
  std::string json;                   ///< "-": standard output; empty: none
  std::uint64_t seed = 1;
  bool quiet = false;
};
int run_compare(const CompareOptions& options);

struct GapOptions {
  std::string config;
  std::optional<std::string> model;   ///< path, instead of the configured one
  std::vector<std::string> measured;  ///< logs, each a recording of its own
  std::string axis;                   ///< "x", "y" or "z" of whole units; empty: all
  std::string out;                    ///< folder
  std::vector<std::string> accept;    ///< "gyro=2", "kind=delay,gyro=1", "likeliest"
  std::string evidence;               ///< file for a fleet; empty: none
  double time_limit_s = 0.0;          ///< 0: none
  std::uint64_t seed = 1;
  bool quiet = false;
  std::string command;  ///< the whole command line, for the report
};
int run_gap(const GapOptions& options);

struct FleetOptions {
  std::vector<std::string> evidence;  ///< files of drives or pools; a folder: all in it
  std::string out;                    ///< folder
  double false_names = 0.005;         ///< share of names that may be false
  bool quiet = false;
};
int run_fleet(const FleetOptions& options);

struct SimulateOptions {
  std::string config;
  std::string model;
  std::string profile;
  std::string output = "-";                  ///< "-": standard output
  std::vector<double> gyro_rates_hz{100.0};  ///< one for both, or one each
  double reference_rate_hz = 200.0;
  double accelerometer_rate_hz = 100.0;
  double jitter_s = 0.0;
  double start_s = 1'700'000'000.0;
  std::uint64_t seed = 1;
  bool quiet = false;
};
int run_simulate(const SimulateOptions& options);

/// Selects among several gateways on a host.
struct WhichGateway {
  std::string instance;  ///< empty: the gateway without a name
  bool all = false;
};

struct StatusOptions {
  WhichGateway which;
  bool json = false;
  bool watch = false;
  double interval_s = 1.0;  ///< of `watch`
};
int run_status(const StatusOptions& options);
int run_recalibrate(const WhichGateway& which);
int run_capture(const WhichGateway& which);

}  // namespace vgyro::cli
