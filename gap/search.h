#pragma once

// Rounds of: fit the noise with what is in the model, scan for every candidate on whitened
// innovations, fit the best ones again together with the noise, and take the likeliest if it is
// beyond what chance brings. Then replacement, backward deletion, and the noise itself.
//
// The search decides; it changes nothing that it judges. Another motion is another study, with
// regressions and scans of its own.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gap/acceptance.h"
#include "gap/found.h"
#include "gap/regression.h"
#include "gap/scan.h"
#include "gap/study.h"

namespace vgyro::gap {

class Search {
 public:
  /// `known`: the model's effects, which stay as they are.
  Search(std::shared_ptr<const Study> study, Effects known);
  // Its scans look at its regressions.
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  std::function<void(std::string_view what, double share)> progress;
  /// What is left of the caller's time, 1 to 0; nothing: there is no end to it. What it is too
  /// short for is left open.
  std::function<double()> time_left;

  /// Finds deterministic effects, in the order of their weight; then noise.
  void run();
  /// After run(): takes the readings that the caller knows to be right, and fits all again.
  void accept(const std::vector<Acceptance>& accept);

  [[nodiscard]] std::vector<Found> found() const;
  /// Bias and noise of the gyros of which the model says neither: every gyro has them.
  [[nodiscard]] std::vector<Found> starting() const;
  /// The same before anything was found.
  [[nodiscard]] const Effects& first_starting() const { return first_starting_; }
  /// What looked like an effect and is none of the catalogue's: it does not hold throughout.
  [[nodiscard]] const std::vector<Found>& rejected() const { return rejected_; }
  /// What the time was too short for, for people.
  [[nodiscard]] const std::vector<std::string>& open() const { return open_; }
  /// The model's effects and what was found.
  [[nodiscard]] Effects effects() const;
  /// The recording, with the motion that `effects()` give.
  [[nodiscard]] const Study& study() const { return *study_; }

 private:
  /// What a round has found, before it is taken.
  struct Round {
    std::vector<Found> candidates;
    std::vector<Score> timing;  ///< all that is late, by the linear look
  };

  /// A fit with the motion that its terms give; its log-likelihood with lateness by the motion.
  struct Trial {
    Fit fit;
    double by_motion = 0.0;
  };
  /// One reading of what is late. Its statistic, and `by_motion` less the penalty, count from one
  /// zero for all.
  struct Rival {
    Found found;
    double by_motion = 0.0;
    [[nodiscard]] double by_ways() const { return found.adjusted() - by_motion; }
  };

  void start();
  [[nodiscard]] Effects noise_effects(const PairNoise& noise) const;
  [[nodiscard]] bool is_over(double needed) const;
  void leave_open(const std::string& what);
  /// Another study, and all that hangs on it.
  void take(std::shared_ptr<const Study> study);
  void renew_motion();
  const Scan& scan(std::size_t place);
  [[nodiscard]] Effects terms(std::size_t place, std::size_t left_out = Regression::kNone) const;
  [[nodiscard]] std::size_t place_of(const model::Effect& effect) const;
  void keep_noise(std::size_t place, const PairNoise& noise);
  [[nodiscard]] PairNoise modelled(const PairNoise& fitted) const;
  [[nodiscard]] bool knows_no_noise(std::size_t place) const;
  [[nodiscard]] bool has_grown(std::size_t place, const Fit& null) const;
  [[nodiscard]] std::vector<Found> refitted(std::size_t place, const Fit& null,
                                            const PairNoise& start,
                                            const std::vector<Score>& scores,
                                            std::size_t most) const;
  [[nodiscard]] Found refitted(std::size_t place, const Fit& null, const PairNoise& start,
                               const Score& score) const;
  void look(std::size_t place, Round& round);
  void look_at_temperature(std::size_t place, const Fit& null, const PairNoise& start,
                           std::vector<Found>& found) const;
  bool add_round();
  bool add(Found taken);
  [[nodiscard]] bool is_barred(const model::Effect& effect) const;
  void leave_out(const model::Effect& effect, Round& round);
  [[nodiscard]] bool keeps_its_size(std::size_t index) const;
  bool is_proven(std::size_t index);
  void keep_doubtful();
  void free_reference();
  void drop_lone_references();
  [[nodiscard]] bool is_left_of_timing(const Found& one) const;
  [[nodiscard]] Trial fit_with_motion(Effects terms) const;
  [[nodiscard]] std::vector<Rival> timing_rivals(const Found& best,
                                                 const std::vector<Score>& scores) const;
  [[nodiscard]] static bool is_close_to(const Rival& first, const Rival& other, double gain);
  [[nodiscard]] Found judge_timing(Found best, const std::vector<Score>& scores) const;
  void place_again();
  void replace_round();
  void replace(std::size_t index);
  void check();
  void delete_backward();
  void reject_unsteady();
  [[nodiscard]] double held_out_gain(std::size_t index) const;
  bool is_sure_by_residual(std::size_t index);
  void reject_unproven();
  void noise_rounds();
  bool reject_beside_noise();
  [[nodiscard]] double statistic_beside(std::size_t index) const;
  [[nodiscard]] double drift_statistic(std::size_t gyro) const;
  void settle();
  void settle(std::size_t place);

  std::shared_ptr<const Study> study_;
  std::vector<Regression> regressions_;
  std::vector<Effects> beside_;  ///< what was found when the study was taken: its shapes see it
  std::vector<std::optional<Scan>> scans_;  ///< of the regressions, once asked for
  Effects known_;
  std::vector<Found> found_;
  std::vector<Found> rejected_;
  std::vector<Reading> barred_;          ///< that a round has tried
  std::vector<Found> doubtful_;          ///< that did not prove themselves when they were tried
  std::array<bool, 2> unknown_noise_{};  ///< the model says nothing of it
  Effects starting_noise_;               ///< of such gyros, once it is fitted
  Effects first_starting_;
  std::vector<std::string> open_;
  PairNoise noise_;        ///< fitted
  PairNoise model_noise_;  ///< what the model says, with what was found
};

}  // namespace vgyro::gap
