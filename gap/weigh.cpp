#include "gap/weigh.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/core.h>

#include "gap/regression.h"
#include "gap/scan.h"
#include "model/catalogue.h"
#include "model/shape.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;
using model::Shape;

// Less of a shape's square than this is its own beside what is fitted anyway: rounding.
constexpr double kOwnShareMin = 1e-6;
// Of the curvature of the likelihood over the logarithms of the noise densities.
constexpr double kLogStep = 0.05;
// A walk below this share of the white noise of a second is none.
constexpr double kWalkMin = 1e-6;

bool is_of_this_recording(Kind kind) {
  return kind == Kind::kBiasStep || kind == Kind::kLine || kind == Kind::kAngleHarmonic;
}

/// What the shapes of one place are seen beside.
struct Beside {
  Effects known;     ///< stays as it is
  Effects nuisance;  ///< fitted beside: biases, and what only this recording has
  Effects sized;     ///< shapes' own: counts to their sizes, and is where they are late by
  Effects formed;    ///< of a shape's kind but another form: left to the shapes
};

Beside sort(const Observations& data, const Effects& known, const std::vector<Found>& found) {
  Beside beside;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (data.holds[gyro]) beside.nuisance.push_back({gyro, Kind::kBias, {0.0}, 0});
  }
  for (const Effect& effect : known) {
    if (!data.holds[effect.gyro]) continue;
    (model::shape_of(effect) != nullptr ? beside.sized : beside.known).push_back(effect);
  }
  for (const Found& one : found) {
    const Effect& effect = one.effect;
    const bool is_random = row(effect.kind).finder == Finder::kNoise;
    if (!data.holds[effect.gyro] || is_random || effect.kind == Kind::kBias) continue;
    if (is_of_this_recording(effect.kind)) {
      beside.nuisance.push_back(effect);
    } else if (model::shape_of(effect) != nullptr) {
      beside.sized.push_back(effect);
    } else {
      beside.formed.push_back(effect);
    }
  }
  return beside;
}

Effects joined(Effects first, const Effects& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

// The noise of this recording beside everything.
PairNoise fitted_noise(const std::shared_ptr<const Observations>& data, const Beside& beside,
                       const Effects& all) {
  const Regression regression(data, joined(beside.known, beside.sized), Part::kAll);
  return regression.fit(joined(beside.nuisance, beside.formed), noise_of(all)).noise;
}

// Curvature of the log-likelihood in ln white and ln walk of one gyro.
void set_noise(const Observations& data, const Eigen::VectorXd& residual, const PairNoise& noise,
               std::size_t gyro, GyroEvidence& evidence) {
  evidence.white_dps_rthz = noise[gyro].white_dps_rthz;
  evidence.walk_dps_rts = noise[gyro].walk_dps_rts;
  const auto at = [&](double white, double walk) {
    PairNoise moved = noise;
    moved[gyro].white_dps_rthz *= std::exp(white * kLogStep);
    moved[gyro].walk_dps_rts *= std::exp(walk * kLogStep);
    return log_likelihood(residual, data.layout, moved, Part::kAll);
  };
  const double middle = at(0, 0);
  constexpr double kSquare = kLogStep * kLogStep;
  const double a = -(at(1, 0) - 2.0 * middle + at(-1, 0)) / kSquare;
  const bool walks = evidence.walk_dps_rts > kWalkMin * evidence.white_dps_rthz;
  const double c = walks ? -(at(0, 1) - 2.0 * middle + at(0, -1)) / kSquare : 0.0;
  const double b = walks ? -(at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4.0 * kSquare) : 0.0;
  if (a <= 0.0) return;
  const double determinant = a * c - b * b;
  evidence.log_noise_covariance =
      c > 0.0 && determinant > 0.0 ? std::array{c / determinant, -b / determinant, a / determinant}
                                   : std::array{1.0 / a, 0.0, 0.0};
}

// What the shape of size 1 adds to what is observed.
Eigen::VectorXd column_of(const Observations& data, const Shape& shape, std::size_t gyro,
                          const Effects& others) {
  Effect effect = model::effect_of(shape, 1.0);
  effect.gyro = gyro;
  if (shape.is_low_pass) return data.contribution_beside(others, effect);
  // A derivative where the size is 0; of what is late already, where that leaves it.
  effect.parameters[shape.size] = 0.0;
  const auto free = *row(shape.kind).free;
  const auto its = std::find_if(free.begin(), free.end(),
                                [&](const Free& one) { return one.parameter == shape.size; });
  return data.derivative(others, effect, *its);
}

class Place {
 public:
  Place(std::shared_ptr<const Observations> data, Beside beside, const PairNoise& noise)
      : data_(std::move(data)),
        beside_(std::move(beside)),
        noise_(noise),
        seen_(joined(beside_.known, beside_.sized)) {}

  PlaceEvidence evidence(const std::array<std::string, 2>& names) {
    list_shapes();
    fill();
    for (const Effect& effect : beside_.nuisance) {
      evidence_.beside.push_back(
          fmt::format("{} of {}", model::info(effect.kind).name, names[effect.gyro]));
    }
    return std::move(evidence_);
  }

 private:
  void list_shapes() {
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!data_->holds[gyro]) continue;
      evidence_.gyros.push_back(gyro);
      for (std::size_t i = 0; i < model::shapes().size(); ++i) {
        Effect effect = model::effect_of(model::shapes()[i], 1.0);
        effect.gyro = gyro;
        if (!could_show(*data_, effect)) continue;
        evidence_.gyro.push_back(gyro);
        evidence_.shape.push_back(i);
      }
    }
  }

  [[nodiscard]] Eigen::VectorXf whitened(const Eigen::VectorXd& column) const {
    return gap::whitened(Matrix(column), data_->layout, noise_, Part::kAll).col(0).cast<float>();
  }

  // The residual without what counts to the sizes is written as the one beside it and the sizes:
  // where they are late, the one is solved at the other's place.
  void fill() {
    const Regression regression(data_, seen_, Part::kAll);
    const Effects nuisance = beside_.nuisance;
    const Matrix base = regression.columns(nuisance);
    const Eigen::Index bases = base.cols();
    const auto count = static_cast<Eigen::Index>(evidence_.shape.size());
    const Eigen::Index rows =
        data_->size() + static_cast<Eigen::Index>(data_->layout.blocks.size());
    Eigen::MatrixXf white(rows, bases + count);
    for (Eigen::Index i = 0; i < bases; ++i)
      white.col(i) = whitened(base.col(i));
    const Effects others = joined(seen_, nuisance);
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      white.col(bases + i) = whitened(
          column_of(*data_, model::shapes()[evidence_.shape[at]], evidence_.gyro[at], others));
    }
    reduce((white.transpose() * white).cast<double>(), bases);
  }

  void reduce(const Eigen::MatrixXd& gram, Eigen::Index bases) {
    const Eigen::Index count = gram.cols() - bases;
    const Eigen::Index beside = bases - 1;
    const Eigen::MatrixXd cross = gram.block(1, bases, beside, count);
    const Solution down = explain_first(gram.topLeftCorner(bases, bases));
    Eigen::MatrixXd own = gram.bottomRightCorner(count, count);
    const Eigen::VectorXd squares = own.diagonal();
    own -= cross.transpose() * down.covariance * cross;
    Eigen::VectorXd score = gram.block(0, bases, 1, count).transpose();
    score -= cross.transpose() * down.covariance * gram.block(1, 0, beside, 1);
    for (Eigen::Index i = 0; i < count; ++i) {
      if (own(i, i) > kOwnShareMin * squares[i]) continue;
      own.row(i).setZero();
      own.col(i).setZero();
      score[i] = 0.0;
    }
    score += own * sizes();
    evidence_.score.assign(score.begin(), score.end());
    evidence_.information.assign(own.data(), own.data() + own.size());
  }

  // What model file and search say of each shape already.
  [[nodiscard]] Eigen::VectorXd sizes() const {
    Eigen::VectorXd sizes =
        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(evidence_.shape.size()));
    for (const Effect& effect : beside_.sized) {
      const Shape* shape = model::shape_of(effect);
      for (std::size_t i = 0; i < evidence_.shape.size(); ++i) {
        if (&model::shapes()[evidence_.shape[i]] == shape && evidence_.gyro[i] == effect.gyro)
          sizes[static_cast<Eigen::Index>(i)] += effect.parameters[shape->size];
      }
    }
    return sizes;
  }

  std::shared_ptr<const Observations> data_;
  Beside beside_;
  PairNoise noise_;
  Effects seen_;
  PlaceEvidence evidence_;
};

void set_bias(const Observations& data, const Beside& beside, const PairNoise& noise,
              std::array<GyroEvidence, 2>& gyros) {
  auto shared = std::make_shared<Observations>(data);
  const Regression regression(shared, joined(beside.known, beside.sized), Part::kAll);
  Fit fit{joined(beside.nuisance, beside.formed), noise, 0.0, {}};
  regression.improve(fit);
  const std::vector<model::Parameters> sigmas = sigmas_of(fit);
  for (std::size_t i = 0; i < fit.terms.size(); ++i) {
    const Effect& term = fit.terms[i];
    if (term.kind != Kind::kBias || sigmas[i][0] <= 0.0) continue;
    double bias_dps = term.parameters[0];
    for (const Effect& known : beside.known) {
      if (known.kind == Kind::kBias && known.gyro == term.gyro) bias_dps += known.parameters[0];
    }
    gyros[term.gyro].bias_dps = bias_dps;
    gyros[term.gyro].bias_sigma_dps = sigmas[i][0];
  }
  const Eigen::VectorXd residual = regression.residual(fit.terms);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (data.holds[gyro]) set_noise(data, residual, noise, gyro, gyros[gyro]);
  }
}

void set_circumstances(const Study& study, GyroEvidence& evidence, std::size_t gyro) {
  const Observations& data = study.observations_of(gyro);
  double sum = 0.0;
  double count = 0.0;
  std::array<double, 3> range{1e9, 0.0, -1e9};
  for (const model::Surroundings& s : data.surroundings[gyro]) {
    if (std::isnan(s.temperature_c)) continue;
    sum += s.temperature_c;
    count += 1.0;
    range[0] = std::min(range[0], s.temperature_c);
    range[2] = std::max(range[2], s.temperature_c);
  }
  if (count > 0.0) evidence.temperature_c = {range[0], sum / count, range[2]};
  if (!study.drives().empty()) return;
  const Transport& transport = study.transport(gyro);
  const auto masked = std::count_if(transport.masked.begin(), transport.masked.end(),
                                    [](std::uint8_t why) { return why != 0; });
  evidence.lost_share = transport.lost_share;
  evidence.samples = static_cast<double>(transport.masked.size());
  if (evidence.samples > 0.0)
    evidence.masked_share = static_cast<double>(masked) / evidence.samples;
}

}  // namespace

DriveEvidence weigh(const Study& study, const Effects& known, const std::vector<Found>& found) {
  DriveEvidence evidence;
  std::array<std::string, 2> names;
  Effects all = known;
  for (const Found& one : found) {
    all.push_back(one.effect);
    if (one.is_name()) evidence.gyros[one.effect.gyro].named.push_back(one.effect);
  }
  for (const Finding& finding : study.findings())
    evidence.gyros[finding.effect.gyro].named.push_back(finding.effect);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    names[gyro] = study.recording().gyros[gyro].name;
    set_circumstances(study, evidence.gyros[gyro], gyro);
  }
  for (const auto& data : study.observations()) {
    const Beside beside = sort(*data, known, found);
    const PairNoise noise = fitted_noise(data, beside, all);
    set_bias(*data, beside, noise, evidence.gyros);
    evidence.places.push_back(Place(data, beside, noise).evidence(names));
  }
  return evidence;
}

}  // namespace vgyro::gap
