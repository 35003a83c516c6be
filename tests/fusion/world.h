#pragma once

// A world with known truth: two gyros with white noise and random-walk drift on one platform, and
// the best linear estimator for it, a Kalman filter at full rate that knows N, K and the true
// stops. Shares no code with the product.

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <vector>

namespace vgyro::fusion::world {

struct Gyro {
  double white = 0.0;  ///< deg/s/√Hz
  double walk = 0.0;   ///< deg/s/√s
  double bias = 0.0;   ///< deg/s
  double scale = 0.0;
  double delay_s = 0.0;
  double ramp_dps_s = 0.0;  ///< slope of the bias, from the beginning on
  double warm_dps = 0.0;    ///< of the bias at the beginning, fading …
  double warm_tau_s = 1.0;  ///< … with this time constant
  double step_dps = 0.0;    ///< its values are multiples of this
  bool blind = false;       ///< it feels no rotation
  double spikes_hz = 0.0;   ///< rate of values that are no measurement, but 1 to 50 deg/s off
};

struct Instant {
  double t_s = 0.0;
  double rate_dps = 0.0;  ///< true rate
  bool stopped = false;   ///< for the bound: the true rate is known
  std::array<double, 2> reading_dps{};
  std::array<double, 2> bias_dps{};
};

class World {
 public:
  using Rate = std::function<double(double)>;

  World(std::array<Gyro, 2> gyros, double rate_hz, std::uint64_t seed)
      : gyros_(gyros), step_s_(1.0 / rate_hz), random_(seed), bias_{gyros[0].bias, gyros[1].bias} {}

  Instant next(const Rate& rate, bool stopped) {
    Instant now;
    now.t_s = step_s_ * static_cast<double>(count_++);
    now.rate_dps = rate(now.t_s);
    now.stopped = stopped;
    for (std::size_t k = 0; k < 2; ++k) {
      const Gyro& gyro = gyros_[k];
      bias_[k] += gyro.walk * std::sqrt(step_s_) * normal_(random_);
      now.bias_dps[k] = bias_[k] + gyro.ramp_dps_s * now.t_s +
                        gyro.warm_dps * std::exp(-now.t_s / gyro.warm_tau_s);
      const double felt = gyro.blind ? 0.0 : rate(now.t_s - gyro.delay_s) * (1.0 + gyro.scale);
      const double value =
          felt + now.bias_dps[k] + gyro.white / std::sqrt(step_s_) * normal_(random_) + spike(gyro);
      now.reading_dps[k] =
          gyro.step_dps > 0.0 ? gyro.step_dps * std::round(value / gyro.step_dps) : value;
    }
    return now;
  }
  [[nodiscard]] double step_s() const { return step_s_; }
  [[nodiscard]] double now_s() const { return step_s_ * static_cast<double>(count_); }
  void jump(std::size_t gyro, double by_dps) { bias_[gyro] += by_dps; }

 private:
  double spike(const Gyro& gyro) {
    if (gyro.spikes_hz <= 0.0) return 0.0;
    std::uniform_real_distribution<double> uniform;
    if (uniform(random_) >= gyro.spikes_hz * step_s_) return 0.0;
    const double size_dps = std::pow(50.0, uniform(random_));
    return uniform(random_) < 0.5 ? -size_dps : size_dps;
  }

 public:
  std::array<Gyro, 2> gyros_;
  double step_s_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::array<double, 2> bias_;
  std::uint64_t count_ = 0;
};

/// Full-rate Kalman filter over b₁, b₂ with the true N and K.
class Bound {
 public:
  Bound(const std::array<Gyro, 2>& gyros, double step_s) {
    for (std::size_t k = 0; k < 2; ++k) {
      noise_[k] = gyros[k].white * gyros[k].white / step_s;
      walk_[k] = gyros[k].walk * gyros[k].walk * step_s;
    }
    weight_ = noise_[1] / (noise_[0] + noise_[1]);
  }
  double update(const Instant& now, double known_rate_dps) {
    p_[0] += walk_[0];
    p_[2] += walk_[1];
    if (now.stopped) {
      scalar(1.0, 0.0, now.reading_dps[0] - known_rate_dps, noise_[0]);
      scalar(0.0, 1.0, now.reading_dps[1] - known_rate_dps, noise_[1]);
    } else {
      scalar(1.0, -1.0, now.reading_dps[0] - now.reading_dps[1], noise_[0] + noise_[1]);
    }
    return weight_ * (now.reading_dps[0] - b_[0]) + (1.0 - weight_) * (now.reading_dps[1] - b_[1]);
  }

 public:
  void scalar(double h1, double h2, double z, double r) {
    const double c1 = p_[0] * h1 + p_[1] * h2;
    const double c2 = p_[1] * h1 + p_[2] * h2;
    const double s = h1 * c1 + h2 * c2 + r;
    const double e = z - h1 * b_[0] - h2 * b_[1];
    b_[0] += c1 / s * e;
    b_[1] += c2 / s * e;
    p_[0] -= c1 * c1 / s;
    p_[1] -= c1 * c2 / s;
    p_[2] -= c2 * c2 / s;
  }
  std::array<double, 2> noise_{};
  std::array<double, 2> walk_{};
  double weight_ = 0.5;
  std::array<double, 2> b_{};
  std::array<double, 3> p_{1.0, 0.0, 1.0};
};

}  // namespace vgyro::fusion::world
