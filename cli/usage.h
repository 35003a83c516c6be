#pragma once

// Error messages for a wrong command line. Included by main.cpp alone, like CLI11.

#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "base/error.h"
#include "base/printable.h"
#include "base/spelling.h"

namespace vgyro::cli {

/// "vgyro replay": the command as far as it was recognized.
inline std::string command_text(const CLI::App& app) {
  std::string text = "vgyro";
  for (const CLI::App* command = &app; !command->get_subcommands().empty();) {
    command = command->get_subcommands().front();
    text += " " + command->get_name();
  }
  return text;
}

/// All options of the recognized command, with their dashes.
inline std::vector<std::string> options_of(const CLI::App& app) {
  const CLI::App* command = &app;
  while (!command->get_subcommands().empty())
    command = command->get_subcommands().front();
  std::vector<std::string> names;
  for (const CLI::Option* option : command->get_options()) {
    for (const std::string& name : option->get_lnames())
      names.push_back("--" + name);
  }
  return names;
}

/// An unknown option comes first, because it is often the reason why another one is missing.
inline Error usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const std::string command = command_text(app);
  const std::string help = fmt::format("`{} --help` lists its arguments", command);
  if (const auto unknown = unknown_option(app.remaining(true), options_of(app))) {
    return {command, fmt::format("there is no option {}", printable(unknown->name)),
            unknown->near ? fmt::format("did you mean {}?", *unknown->near) : help};
  }
  if (app.get_subcommands().empty()) {
    return {command, "no command is given", "`vgyro --help` lists the commands"};
  }
  return {command, printable(error.what()), help};
}

}  // namespace vgyro::cli
