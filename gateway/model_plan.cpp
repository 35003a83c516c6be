#include "gateway/model_plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "base/fnv1a.h"
#include "model/flicker.h"

namespace vgyro::gateway {

namespace {

constexpr std::string_view kTakesBack = "takes back";

// Independent noises add as squares.
void add_density(std::optional<double>& density, double more) {
  density = std::hypot(density.value_or(0.0), more);
}

void add_noise(const model::Effect& effect, fusion::GyroParameters& parameters) {
  const model::Parameters& p = effect.parameters;
  switch (effect.kind) {
    case model::Kind::kWhiteNoise:
      add_density(parameters.white_dps_rthz, p[0]);
      break;
    case model::Kind::kRateRandomWalk:
      add_density(parameters.walk_dps_rts, p[0]);
      break;
    case model::Kind::kRateNoise:
      parameters.rate_noise_rthz = std::hypot(parameters.rate_noise_rthz, p[0]);
      break;
    case model::Kind::kGaussMarkov:
      if (parameters.gauss_markov_count == parameters.gauss_markov.size()) break;
      parameters.gauss_markov[parameters.gauss_markov_count++] = {p[0], p[1]};
      break;
    case model::Kind::kQuantization:
      parameters.resolution_dps = std::max(parameters.resolution_dps, p[0]);
      break;
    default:
      break;
  }
}

// Flicker as drift terms of the corrector, as many as fit beside the given ones: three, a decade
// apart in time. Faster terms are hidden by white noise; to any stop, slower ones are a bias.
constexpr double kFlickerFrom_s = 3.0;
constexpr double kFlickerTo_s = 3000.0;
void add_flicker(double coefficient_dps, fusion::GyroParameters& parameters) {
  if (coefficient_dps == 0.0) return;
  const std::size_t begin = parameters.gauss_markov_count;
  const std::size_t room = parameters.gauss_markov.size() - begin;
  for (std::size_t i = 0; i < room; ++i) {
    const model::FlickerTerm term =
        model::flicker_term(coefficient_dps, i, room, kFlickerFrom_s, kFlickerTo_s);
    parameters.gauss_markov[begin + i] = {term.sigma_dps, term.tau_s};
  }
  parameters.gauss_markov_count = parameters.gauss_markov.size();
}

void add_lag_doubt(const model::Effect& effect, fusion::GyroParameters& parameters) {
  if (model::info(effect.kind).nature != model::Nature::kLag) return;
  parameters.lag_sigma_s = std::hypot(parameters.lag_sigma_s, model::lag_sigma_s(effect));
  if (!effect.ambiguous) return;
  parameters.lag_common_sigma_s = std::hypot(parameters.lag_common_sigma_s, model::lag_s(effect));
}

void add_limit(const model::Effect& effect, GyroPlan& gyro) {
  const double value_dps = effect.parameters[0];
  if (effect.kind == model::Kind::kSaturation) {
    gyro.saturation_dps = std::min(gyro.saturation_dps.value_or(value_dps), value_dps);
  }
  if (effect.kind == model::Kind::kDeadBand) {
    gyro.dead_band_dps = std::max(gyro.dead_band_dps, value_dps);
  }
}

// The same effects give the same eight digits on every machine.
std::string digest_of(const std::vector<model::Effect>& effects) {
  std::uint32_t hash = kFnv1aBegin;
  bool any = false;
  for (const model::Effect& effect : effects) {
    if (treatment(effect.kind) != kTakesBack) continue;
    any = true;
    std::string text(model::info(effect.kind).name);
    for (const double parameter : effect.parameters)
      text += fmt::format(" {}", parameter);
    hash = fnv1a(text, hash);
  }
  return any ? fmt::format("{:08x}", hash) : std::string();
}

std::size_t axis_of(const model::Effect& effect) {
  return static_cast<std::size_t>(effect.parameters[0]);
}

struct Input {
  model::Need need;
  std::string_view word;
  bool (*is_configured)(const Plan& plan, const model::Effect& effect);
  std::string (*lacking)(const GyroPlan& gyro, const model::Effect& effect);
  std::string_view remedy;
};
constexpr Input kInputs[] = {
    {model::kNeedsTemperature, "temperature",
     [](const Plan& plan, const model::Effect& effect) {
       return plan.gyros[effect.gyro].temperature.has_value();
     },
     [](const GyroPlan& gyro, const model::Effect&) {
       return fmt::format("the temperature of gyro {}, which the configuration does not name",
                          gyro.name);
     },
     "temperature = \"SIGNAL\" in its [[gyro]] table"},
    {model::kNeedsAcceleration, "acceleration",
     [](const Plan& plan, const model::Effect&) { return plan.accelerometer.has_value(); },
     [](const GyroPlan&, const model::Effect&) { return std::string("an [accelerometer]"); },
     "an [accelerometer] table in the configuration"},
    {model::kNeedsSupply, "supply voltage",
     [](const Plan& plan, const model::Effect& effect) {
       return plan.gyros[effect.gyro].supply_voltage.has_value();
     },
     [](const GyroPlan& gyro, const model::Effect&) {
       return fmt::format("the supply voltage of gyro {}, which the configuration does not name",
                          gyro.name);
     },
     "supply_voltage = \"SIGNAL\" in its [[gyro]] table"},
    {model::kNeedsOtherAxes, "other axes",
     [](const Plan& plan, const model::Effect& effect) {
       return (plan.gyros[effect.gyro].*kOtherAxes[axis_of(effect)]).has_value();
     },
     [](const GyroPlan& gyro, const model::Effect& effect) {
       return fmt::format("the rate of gyro {} about {}, which the configuration does not name",
                          gyro.name, "xyz"[axis_of(effect)]);
     },
     "rate_x, rate_y or rate_z = \"SIGNAL\" in its [[gyro]] table"},
};
static_assert(model::answers_each_need(kInputs));

void check_inputs(const model::Effect& effect, const Plan& plan, const std::string& place,
                  std::vector<Error>& errors) {
  const model::KindInfo& kind = model::info(effect.kind);
  for (const Input& input : kInputs) {
    if ((kind.needs & input.need) == 0 || input.is_configured(plan, effect)) continue;
    errors.push_back(
        {place,
         fmt::format("{} needs {}", kind.name, input.lacking(plan.gyros[effect.gyro], effect)),
         std::string(input.remedy)});
  }
}

}  // namespace

void apply_model(const model::Model& model, Plan& plan, std::vector<Error>& errors) {
  std::array<double, 2> lag_s{};
  std::array<double, 2> flicker_dps{};
  for (const model::Effect& effect : model.effects) {
    const std::string place = at_line(model.file, effect.line);
    if (effect.of_axis && plan.output.axes.empty()) {
      errors.push_back({place, "an effect of one axis, and the gyros have one axis each",
                        "leave `axis` out, or rate_x, rate_y, rate_z in the [[gyro]] tables"});
    }
    check_inputs(effect, plan, place, errors);
    add_noise(effect, plan.corrector.gyros[effect.gyro]);
    add_lag_doubt(effect, plan.corrector.gyros[effect.gyro]);
    add_limit(effect, plan.gyros[effect.gyro]);
    if (effect.kind == model::Kind::kBiasInstability) {
      double& sum_dps = flicker_dps[effect.gyro];
      sum_dps = std::hypot(sum_dps, effect.parameters[0]);
    }
    // A temperature effect that the model states is not learned as well.
    if (effect.kind == model::Kind::kTemperatureBias ||
        effect.kind == model::Kind::kTemperatureBiasQuadratic)
      plan.corrector.gyros[effect.gyro].learns_temperature = false;
    if (model::info(effect.kind).nature != model::Nature::kLag) continue;
    double& sum_s = lag_s[effect.gyro];
    sum_s += model::lag_s(effect);
    if (std::abs(sum_s) <= kLagMax_s) continue;
    errors.push_back({place,
                      fmt::format("the readings of gyro {} come {:g} s late in all",
                                  plan.gyros[effect.gyro].name, sum_s),
                      fmt::format("up to {:g} s can be taken back", kLagMax_s)});
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    add_flicker(flicker_dps[gyro], plan.corrector.gyros[gyro]);
  plan.model = model;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    plan.gyros[gyro].taken_back = digest_of(effects_of(plan, gyro));
}

std::vector<model::Effect> effects_of(const Plan& plan, std::size_t gyro) {
  std::vector<model::Effect> own;
  if (!plan.model) return own;
  std::copy_if(plan.model->effects.begin(), plan.model->effects.end(), std::back_inserter(own),
               [gyro](const model::Effect& effect) { return effect.gyro == gyro; });
  return own;
}

std::vector<std::string_view> inputs_text(std::uint8_t needs) {
  std::vector<std::string_view> words;
  for (const Input& input : kInputs) {
    if ((needs & input.need) != 0) words.push_back(input.word);
  }
  return words;
}

std::string_view treatment(model::Kind kind) {
  switch (model::info(kind).nature) {
    case model::Nature::kOffset:
    case model::Nature::kResponse:
      return kTakesBack;
    case model::Nature::kLag:
      return "dates back";
    case model::Nature::kClip:
      return kind == model::Kind::kQuantization ? "as resolution" : "as limit";
    case model::Nature::kNoise:
      return "as noise";
    case model::Nature::kDisturbance:
      break;
  }
  return "cannot undo";
}

}  // namespace vgyro::gateway
