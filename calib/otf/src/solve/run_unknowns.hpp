#pragma once
/// Unknowns of several runs with the same tables: the parameters of the model, then the rigid and
/// clock unknowns of each run. Either all runs have clock unknowns, or no run has.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

class RunUnknowns {
 public:
  RunUnknowns(const Observations& of_any_run, std::size_t runs)
      : model_(of_any_run.basis.size()), per_run_(of_any_run.unknowns() - model_), runs_(runs) {}
  explicit RunUnknowns(std::span<const Observations> runs)
      : RunUnknowns(runs.front(), runs.size()) {}

  [[nodiscard]] std::size_t model() const { return model_; }
  [[nodiscard]] std::size_t size() const { return model_ + per_run_ * runs_; }
  [[nodiscard]] std::size_t rigid_offset(std::size_t run) const { return model_ + per_run_ * run; }

  /// For each unknown of the observations of a run, its index among the unknowns of all runs.
  [[nodiscard]] std::vector<std::size_t> of_run(std::size_t run) const {
    std::vector<std::size_t> at;
    for (std::size_t i = 0; i < model_ + per_run_; ++i) {
      at.push_back(i < model_ ? i : i + per_run_ * run);
    }
    return at;
  }
  /// The part of a vector that belongs to the unknowns of a run.
  [[nodiscard]] Eigen::VectorXd part(const Eigen::VectorXd& of_all, std::size_t run) const {
    return of_all(of_run(run));
  }
  /// The block of a matrix that belongs to the unknowns of a run.
  [[nodiscard]] Eigen::MatrixXd block(const Eigen::MatrixXd& of_all, std::size_t run) const {
    const std::vector<std::size_t> at = of_run(run);
    return of_all(at, at);
  }

  /// Name of an unknown for messages, such as "EXX at -0.300 m", "rx", "rx of run 2".
  [[nodiscard]] std::string label(const Observations& of_any_run, std::size_t unknown) const {
    if (unknown < model_ || runs_ == 1) {
      return of_any_run.label(unknown);
    }
    const std::size_t place = unknown - model_;
    return of_any_run.label(model_ + place % per_run_) + " of run " +
           std::to_string(place / per_run_ + 1);
  }

 private:
  std::size_t model_ = 0, per_run_ = 0, runs_ = 0;
};

/// The conditions of datum G2 for `unknowns` unknowns, of which the first are those of the basis.
[[nodiscard]] inline estimation::Datum datum_of_runs(const TableBasis& basis,
                                                     std::size_t unknowns) {
  return estimation::Datum(datum_conditions(ModelDatum::G2, basis, unknowns));
}

}  // namespace abbe::calib::otf
