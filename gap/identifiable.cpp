#include "gap/identifiable.h"

#include <algorithm>
#include <array>

#include <fmt/core.h>

#include "gap/kinds.h"
#include "model/equation.h"

namespace vgyro::gap {

namespace {

using model::Kind;

constexpr std::array kAxes{Input::kAccelerationX, Input::kAccelerationY, Input::kAccelerationZ};
constexpr std::array kOtherAxes{Input::kRateX, Input::kRateY, Input::kRateZ};

// Rows that speak for an input that stands still: those that need no other but these.
std::vector<Kind> speakers(Inputs needs) {
  std::vector<Kind> list;
  for (const KindRow& its : kinds()) {
    if (its.speaks_for_input && its.needs != 0 && (its.needs & ~needs) == 0)
      list.push_back(its.kind);
  }
  return list;
}

class Lacks {
 public:
  Lacks(const Study& study, std::size_t gyro, std::vector<NotIdentifiable>& list)
      : with_reference_(study.recording().has_reference),
        x_(study.observations_of(gyro).excitation[gyro]),
        gyro_(gyro),
        list_(list) {}

  void say() {
    temperature();
    rate();
    acceleration();
    supply();
    other_axes();
  }

 private:
  void add(Kind kind, std::string why, std::string how) {
    list_.push_back({kind, gyro_, std::move(why), std::move(how)});
  }

  void temperature() {
    const Inputs needs = bit(Input::kTemperature) | bit(Input::kTemperatureSlope);
    if (!x_.knows(Input::kTemperature)) {
      add(speakers(needs).front(), "the configuration names no temperature signal",
          "name `temperature` in [[gyro]], if the sensor sends one");
    } else if (!x_.moves(bit(Input::kTemperature))) {
      for (const Kind kind : speakers(needs | bit(Input::kRate))) {
        if ((row(kind).needs & needs) == 0) continue;
        add(kind,
            fmt::format("the temperature is constant in this recording, within {:.2g} K",
                        x_.of(Input::kTemperature)),
            "let the temperature change by 10 K, up and down");
      }
    }
  }

  void rate() {
    if (!x_.moves(bit(Input::kRate))) {
      for (const Kind kind : speakers(bit(Input::kRate))) {
        add(kind,
            fmt::format("the platform never turned faster than {:.2g} deg/s", x_.of(Input::kRate)),
            model::moves_in_time(kind) ? "turn to and fro a few times a second"
                                       : "turn both ways at several rates, some of them fast");
      }
    } else if (!with_reference_) {
      add(Kind::kScaleFactor,
          "what both gyros share does not show in their difference, and there is no reference",
          "record a rate table or a dual-antenna heading as [reference]");
    }
  }

  void acceleration() {
    const Kind by_axis = speakers(bit(kAxes[0])).front();
    if (!x_.knows(Input::kVibration)) {
      add(by_axis, "the configuration names no accelerometer", "name an [accelerometer]");
      return;
    }
    const bool any =
        std::any_of(kAxes.begin(), kAxes.end(), [&](Input axis) { return x_.moves(bit(axis)); });
    if (!any) {
      add(by_axis, "the acceleration is constant in this recording",
          "tilt the platform about both horizontal axes");
    }
    for (std::size_t i = 0; i < kAxes.size() && any; ++i) {
      if (x_.moves(bit(kAxes[i]))) continue;
      add(by_axis, fmt::format("the acceleration along {} is constant in this recording", "xyz"[i]),
          fmt::format("tilt the platform so that {} feels gravity", "xyz"[i]));
    }
    if (x_.moves(bit(Input::kVibration))) return;
    for (const Kind kind : speakers(bit(Input::kVibration)))
      add(kind, "there is no vibration in this recording", "shake the platform in bursts");
  }

  // Few gyros tell it: who names none is not told to.
  void supply() {
    const Inputs needs = bit(Input::kSupply);
    if (!x_.knows(Input::kSupply) || x_.moves(needs)) return;
    for (const Kind kind : speakers(needs)) {
      add(kind,
          fmt::format("the supply voltage is constant in this recording, within {:.2g} V",
                      x_.of(Input::kSupply)),
          "let the supply voltage change by half a volt, up and down");
    }
  }

  // Likewise.
  void other_axes() {
    for (std::size_t axis = 0; axis < kOtherAxes.size(); ++axis) {
      const Input input = kOtherAxes[axis];
      if (!x_.knows(input) || x_.moves(bit(input))) continue;
      for (const Kind kind : speakers(bit(kOtherAxes[0]))) {
        add(kind,
            fmt::format("the rate about {} is constant in this recording, within {:.2g} deg/s",
                        "xyz"[axis], x_.of(input)),
            fmt::format("turn about {}, to and fro", "xyz"[axis]));
      }
    }
  }

  bool with_reference_;
  const Excitation& x_;
  std::size_t gyro_;
  std::vector<NotIdentifiable>& list_;
};

}  // namespace

std::vector<NotIdentifiable> not_identifiable(const Study& study) {
  std::vector<NotIdentifiable> list;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    Lacks(study, gyro, list).say();
  return list;
}

std::string experiment_for(const Reading& first, const Reading& second, bool with_reference) {
  if (first.kind == second.kind && first.gyro != second.gyro && !with_reference)
    return "record a [reference]: a difference alone does not say which of two gyros is wrong";
  return std::string(experiment_text(
      std::min<Experiment>(row(first.kind).experiment, row(second.kind).experiment)));
}

}  // namespace vgyro::gap
