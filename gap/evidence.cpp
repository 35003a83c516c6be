#include "gap/evidence.h"

#include <cmath>

#include <fmt/args.h>
#include <fmt/core.h>

#include "gap/kinds.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

// ", 63 standard errors"
std::string errors_text(const model::Effect& effect, const model::Parameters& sigma) {
  const std::size_t parameter = row(effect.kind).errors_of;
  if (parameter == kNoErrors || !(sigma[parameter] > 0.0)) return "";
  return fmt::format(", {:.0f} standard errors",
                     std::abs(effect.parameters[parameter]) / sigma[parameter]);
}

}  // namespace

std::string evidence_text(const model::Effect& effect, const model::Parameters& sigma,
                          const std::string& name, double seconds) {
  const KindRow& its = row(effect.kind);
  const model::Parameters& p = effect.parameters;
  fmt::dynamic_format_arg_store<fmt::format_context> fields;
  fields.push_back(fmt::arg("name", name));
  fields.push_back(fmt::arg("kind", model::info(effect.kind).name));
  fields.push_back(fmt::arg("p0", p[0]));
  fields.push_back(fmt::arg("p1", p[1]));
  fields.push_back(fmt::arg("size", std::abs(p[1])));
  fields.push_back(fmt::arg("over", p[0] * seconds));
  fields.push_back(fmt::arg("ms", 1e3 * p[0]));
  fields.push_back(fmt::arg("axis", its.by_axis ? "xyz"[static_cast<std::size_t>(p[0])] : '?'));
  return fmt::vformat(*its.evidence, fields) + errors_text(effect, sigma);
}

}  // namespace vgyro::gap
