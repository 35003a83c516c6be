#include "fleet/selection.h"

#include <algorithm>
#include <cmath>

#include "fleet/statistics.h"
#include "model/shape.h"

namespace vgyro::fleet {

namespace {

// Most names of one system: more would describe a pool, not explain it.
constexpr std::size_t kNamesMax = 24;
constexpr int kRounds = 6;
// Least gain in 2·log-likelihood for a replacement: replacing by an equal would never end.
constexpr double kBetter = 0.5;
// Explanations whose gains differ by less than this plus this share of the gain cannot be
// distinguished.
constexpr double kLead = 9.0;
constexpr double kLeadShare = 3e-3;

const model::Shape& shape_at(std::size_t column) {
  return model::shapes()[column % model::kShapeCount];
}

bool holds(const std::vector<std::size_t>& list, std::size_t column) {
  return std::find(list.begin(), list.end(), column) != list.end();
}

// A low-pass has no negative size.
bool can_be(const Left& left, std::size_t column) {
  return left.information > 0.0 && (!shape_at(column).is_low_pass || left.score > 0.0);
}

double z_of(const System& system, const Left& left, std::size_t column) {
  return left.score / std::sqrt(left.information * system.doubt(column));
}

class Chooser {
 public:
  Chooser(const System& system, const std::vector<std::size_t>& begun, double tests, double rate)
      : system_(system), begun_(begun), tests_(tests), rate_(rate) {}

  Choice run() {
    while (chosen_.size() < kNamesMax && add())
      improve();
    while (drop()) {
    }
    return finish();
  }

 private:
  [[nodiscard]] std::vector<std::size_t> fitted(std::size_t without) const {
    std::vector<std::size_t> list = begun_;
    for (const std::size_t column : chosen_)
      if (column != without) list.push_back(column);
    return list;
  }
  static constexpr std::size_t kAll = static_cast<std::size_t>(-1);

  [[nodiscard]] bool is_name(double z, std::size_t rank) const {
    return normal_tail(z) <= threshold_of(rank, tests_, rate_);
  }

  bool add() {
    const std::vector<Left> left = system_.beside(fitted(kAll));
    std::size_t best = kAll;
    double best_z = 0.0;
    for (std::size_t i = 0; i < left.size(); ++i) {
      if (!can_be(left[i], i) || holds(chosen_, i) || holds(begun_, i)) continue;
      const double z = std::abs(z_of(system_, left[i], i));
      if (z > best_z) std::tie(best, best_z) = std::pair(i, z);
    }
    if (best == kAll || !is_name(best_z, chosen_.size() + 1)) return false;
    chosen_.push_back(best);
    return true;
  }

  // Replaces each chosen column in turn by one that explains more in its place.
  void improve() {
    for (int round = 0; round < kRounds; ++round) {
      bool changed = false;
      for (std::size_t& column : chosen_) {
        const std::vector<Left> left = system_.beside(fitted(column));
        std::size_t best = column;
        for (std::size_t i = 0; i < left.size(); ++i) {
          if (!can_be(left[i], i) || holds(begun_, i) || (i != column && holds(chosen_, i)))
            continue;
          if (left[i].gain() > left[best].gain() + kBetter) best = i;
        }
        changed = changed || best != column;
        column = best;
      }
      if (!changed) return;
    }
  }

  bool drop() {
    for (std::size_t k = 0; k < chosen_.size(); ++k) {
      const std::size_t column = chosen_[k];
      const Left left = system_.beside(fitted(column))[column];
      if (can_be(left, column) && is_name(z_of(system_, left, column), chosen_.size())) continue;
      chosen_.erase(chosen_.begin() + static_cast<std::ptrdiff_t>(k));
      return true;
    }
    return false;
  }

  [[nodiscard]] Choice finish() const {
    Choice choice;
    for (const std::size_t column : chosen_) {
      const std::vector<Left> left = system_.beside(fitted(column));
      const double gain = left[column].gain();
      choice.columns.push_back(column);
      choice.z.push_back(z_of(system_, left[column], column));
      std::vector<std::size_t>& others = choice.ambiguous_with.emplace_back();
      const bool is_strange = !can_be(left[column], column);
      for (std::size_t i = 0; i < left.size() && !is_strange; ++i) {
        const bool same = shape_at(i).kind == shape_at(column).kind &&
                          i / model::kShapeCount == column / model::kShapeCount;
        if (same || !can_be(left[i], i) || holds(chosen_, i) || holds(begun_, i)) continue;
        if (left[i].gain() > gain - kLead - kLeadShare * gain) others.push_back(i);
      }
    }
    return choice;
  }

  const System& system_;
  const std::vector<std::size_t>& begun_;
  double tests_;
  double rate_;
  std::vector<std::size_t> chosen_;
};

}  // namespace

Choice choose(const System& system, const std::vector<std::size_t>& begun, double tests,
              double false_names) {
  return Chooser(system, begun, tests, false_names).run();
}

}  // namespace vgyro::fleet
