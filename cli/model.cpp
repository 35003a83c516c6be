#include <fmt/core.h>

#include "cli/commands.h"
#include "cli/exit_code.h"
#include "cli/output/terminal.h"
#include "model/catalogue.h"
#include "model/evidence.h"

namespace vgyro::cli {

namespace {

std::string_view heading(model::Nature nature) {
  switch (nature) {
    case model::Nature::kOffset:
      return "added to the reading; the gateway subtracts it";
    case model::Nature::kResponse:
      return "depends on the rate; the gateway corrects it";
    case model::Nature::kLag:
      return "the reading is late; the gateway corrects its time";
    case model::Nature::kClip:
      return "the finished reading is changed; the gateway cannot restore it";
    case model::Nature::kNoise:
      return "noise; the gateway weights the gyros by it";
    case model::Nature::kDisturbance:
      break;
  }
  return "frames or stamps go wrong; only the simulator produces it";
}

void print_kind(const model::KindInfo& kind) {
  say("  {:<28}{}\n", kind.name, kind.meaning);
  for (const model::Parameter& parameter : kind.parameters) {
    say("    {:<26}{}{}\n", parameter.name, parameter.limits(),
        parameter.preset ? fmt::format("; {:g} unless given", *parameter.preset) : "");
  }
  const model::Evidence& evidence = model::evidence(kind.kind);
  say("    {:<26}{}\n", "shown by", evidence.shown_by);
  if (!evidence.taken_for.empty())
    say("    {:<26}{}\n", "may be confused with", evidence.taken_for);
}

}  // namespace

int run_model_list() {
  bool first = true;
  for (const model::Nature nature :
       {model::Nature::kOffset, model::Nature::kResponse, model::Nature::kLag, model::Nature::kClip,
        model::Nature::kNoise, model::Nature::kDisturbance}) {
    say("{}{}\n", first ? "" : "\n", heading(nature));
    first = false;
    for (const model::KindInfo& kind : model::catalogue()) {
      if (kind.nature == nature) print_kind(kind);
    }
  }
  return kDone;
}

}  // namespace vgyro::cli
