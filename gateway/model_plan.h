#pragma once

// Puts a model file into the plan: noise goes to the corrector's parameters, limits to the gyros,
// and the effects to subtract stay in Plan::model. Reports, at the file's lines, effects whose
// inputs the configuration does not name.

#include <string_view>
#include <vector>

#include "base/error.h"
#include "gateway/plan.h"
#include "model/catalogue.h"

namespace vgyro::gateway {

/// The largest total of delay and group delay of one gyro that can be taken back.
inline constexpr double kLagMax_s = 0.25;

/// Precondition: both gyros are resolved.
void apply_model(const model::Model& model, Plan& plan, std::vector<Error>& errors);

/// Effects of one gyro (0 or 1); empty without a model.
std::vector<model::Effect> effects_of(const Plan& plan, std::size_t gyro);

/// What the gateway does with a kind, in one or two words: "takes back", "as noise" …
std::string_view treatment(model::Kind kind);

/// A bit mask of model::Need as words: "temperature", "acceleration".
std::vector<std::string_view> inputs_text(std::uint8_t needs);

}  // namespace vgyro::gateway
