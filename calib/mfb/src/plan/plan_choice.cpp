#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/mfb/plan/plan.hpp"
#include "abbe/result/try.hpp"
#include "plan/plan_problem.hpp"

namespace abbe::calib::mfb {
namespace {

/// Measurements of one position.
std::vector<Measurement> measurements_of(const PlanTask& task, const PlannedPosition& position) {
  return plan_of(task, {position}).measurements;
}

/// The leading capital letters of a name: "DXZ" of "DXZ2", "X" of "X1a".
std::string label_of(const std::string& name) {
  const auto end =
      std::find_if(name.begin(), name.end(), [](char c) { return c < 'A' || c > 'Z'; });
  return {name.begin(), end};
}

/// Sorts the positions (bars along axes first) and numbers those of each label.
std::vector<PlannedPosition> in_order(std::vector<PlannedPosition> positions) {
  for (PlannedPosition& p : positions) {
    p.name = label_of(p.name);
  }
  std::stable_sort(positions.begin(), positions.end(),
                   [](const PlannedPosition& a, const PlannedPosition& b) {
                     return std::pair(a.name.size(), a.name) < std::pair(b.name.size(), b.name);
                   });
  std::map<std::string, int> count;
  for (PlannedPosition& p : positions) {
    const int number = ++count[p.name];
    p.name += message(number);
  }
  return positions;
}

/// The candidate positions, with the information of each.
struct Pool {
  std::vector<PlannedPosition> positions;
  std::vector<PositionInformation> information;

  [[nodiscard]] std::vector<const PositionInformation*> of(
      const std::vector<std::size_t>& set) const {
    std::vector<const PositionInformation*> parts;
    for (const std::size_t i : set) {
      parts.push_back(&information[i]);
    }
    return parts;
  }
};

class Choice {
 public:
  Choice(const PlanTask& task, const ChoiceOptions& options) : task_(task), options_(options) {}

  [[nodiscard]] Result<void> collect(const std::vector<PlannedPosition>& start,
                                     std::vector<PlannedPosition> candidates,
                                     const PlanPredictor& predictor) {
    pool_.positions = start;
    std::move(candidates.begin(), candidates.end(), std::back_inserter(pool_.positions));
    for (const PlannedPosition& position : pool_.positions) {
      if (Result<void> running = report(pool_.information.size()); !running) {
        return running;
      }
      Result<PositionInformation> one = predictor.position(measurements_of(task_, position));
      ABBE_TRY(one);
      pool_.information.push_back(*std::move(one));
    }
    chosen_.resize(start.size());
    std::iota(chosen_.begin(), chosen_.end(), std::size_t{0});
    return {};
  }

  /// Replaces positions until no exchange improves the set.
  [[nodiscard]] Result<void> exchange(const SetProblem& problem) {
    u2_ = problem.state_of(problem.information(pool_.of(chosen_))).u2;
    std::size_t unsuccessful = 0;
    for (std::size_t i = 0; unsuccessful < chosen_.size() && exchanged_ < options_.exchanges;
         i = (i + 1) % chosen_.size()) {
      if (Result<void> running = report(pool_.information.size()); !running) {
        return running;
      }
      const bool better = replace(problem, i);
      exchanged_ += better ? 1 : 0;
      unsuccessful = better ? 0 : unsuccessful + 1;
    }
    return {};
  }

  [[nodiscard]] const Pool& pool() const { return pool_; }
  [[nodiscard]] const std::vector<std::size_t>& chosen() const { return chosen_; }
  [[nodiscard]] std::size_t exchanged() const { return exchanged_; }

 private:
  /// Indices of candidates with as many styli as `replaced`. Selected are those with most
  /// information about the combinations that the other positions determine worst; best first.
  [[nodiscard]] std::vector<std::size_t> promising(const SetProblem::State& state,
                                                   std::size_t replaced) const {
    constexpr std::size_t kEvaluated = 12;
    const std::size_t styli = pool_.positions[replaced].styli.size();
    const Eigen::MatrixXd G = SetProblem::slope(state);
    std::vector<std::pair<double, std::size_t>> gains;
    for (std::size_t c = 0; c < pool_.information.size(); ++c) {
      const bool used = std::find(chosen_.begin(), chosen_.end(), c) != chosen_.end();
      if (!used && pool_.positions[c].styli.size() == styli) {
        const Eigen::MatrixXd& A = pool_.information[c].rows;
        gains.emplace_back(-(A * G).cwiseProduct(A).sum(), c);
      }
    }
    std::sort(gains.begin(), gains.end());
    gains.resize(std::min(gains.size(), kEvaluated));
    std::vector<std::size_t> best;
    for (const auto& [gain, c] : gains) {
      best.push_back(c);
    }
    return best;
  }

  /// Replaces position i by the candidate with the smallest merit(), if the set improves. The worst
  /// uncertainty must not increase.
  [[nodiscard]] bool replace(const SetProblem& problem, std::size_t i) {
    constexpr double kBetter = 1.0 - 1e-3;
    std::vector<std::size_t> others = chosen_;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const SetProblem::State state = problem.state_of(problem.information(pool_.of(others)));

    std::optional<std::size_t> best;
    const double worst = u2_.maxCoeff();
    for (const std::size_t c : promising(state, chosen_[i])) {
      Eigen::VectorXd with = SetProblem::u2_with(state, pool_.information[c]);
      const double most = (best ? 1.0 : kBetter) * SetProblem::merit(u2_);
      if (with.maxCoeff() <= worst && SetProblem::merit(with) < most) {
        u2_ = std::move(with);
        best = c;
      }
    }
    if (best) {
      chosen_[i] = *best;
    }
    return best.has_value();
  }

  /// Reports the progress; collecting the candidates is the first half.
  [[nodiscard]] Result<void> report(std::size_t collected) const {
    if (options_.progress) {
      const double all = static_cast<double>(std::max<std::size_t>(pool_.positions.size(), 1));
      const double exchanges = static_cast<double>(std::max<std::size_t>(options_.exchanges, 1));
      options_.progress(0.5 * static_cast<double>(collected) / all +
                        0.5 * static_cast<double>(exchanged_) / exchanges);
    }
    return check_stopped(options_.stopped);
  }

  const PlanTask& task_;
  const ChoiceOptions& options_;
  Pool pool_;
  std::vector<std::size_t> chosen_;
  Eigen::VectorXd u2_;  ///< u2 of the chosen set (SetProblem::State)
  std::size_t exchanged_ = 0;
};

}  // namespace

Result<ChosenSet> choose_set(const PlanTask& task, const std::vector<PlannedPosition>& start,
                             const ChoiceOptions& options) {
  const Plan first_plan = plan_of(task, start);
  const Result<Observations> planned = planned_observations(task.bar, first_plan, task.machine);
  ABBE_TRY(planned);
  const Result<PlanPredictor> predictor =
      PlanPredictor::of(task.bar, first_plan, task.machine, options.solve);
  ABBE_TRY(predictor);
  Result<std::vector<PlannedPosition>> candidates = candidate_positions(task);
  ABBE_TRY(candidates);

  ChosenSet chosen;
  chosen.candidates = candidates->size();
  Choice choice(task, options);
  ABBE_TRY(choice.collect(start, *std::move(candidates), *predictor));
  const std::vector<std::size_t> at_start = choice.chosen();
  ABBE_TRY(choice.exchange(SetProblem(*planned, options.solve)));

  chosen.start = predictor->predict(choice.pool().of(at_start));
  chosen.prediction = predictor->predict(choice.pool().of(choice.chosen()));
  if (chosen.prediction.worst >= chosen.start.worst) {
    chosen.prediction = chosen.start;
    chosen.positions = start;
    return chosen;
  }
  chosen.exchanged = choice.exchanged();
  for (const std::size_t i : choice.chosen()) {
    chosen.positions.push_back(choice.pool().positions[i]);
  }
  chosen.positions = in_order(std::move(chosen.positions));
  return chosen;
}

}  // namespace abbe::calib::mfb
