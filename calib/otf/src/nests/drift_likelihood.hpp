#pragma once
/// Likelihood of course and amplitude of the drift, of the repeatability of the nests, and of the
/// positions to which the visits belong (tracker_drift.hpp).

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"
#include "nests/drift_basis.hpp"
#include "nests/nest_information.hpp"

namespace abbe::calib::otf {

/// S d = g of the rows; d: range offset (only if it has a prior), then the coefficients.
struct DriftEquations {
  Eigen::MatrixXd S{};
  Eigen::VectorXd g{};
  double u_range_offset_m = 0.0;  ///< 0: the range offset is not an unknown

  [[nodiscard]] Eigen::Index offsets() const { return u_range_offset_m > 0.0 ? 1 : 0; }
};

/// For each visit the position to which it belongs.
using NestPlaces = std::vector<std::size_t>;

/// The equations for one course and one repeatability, with the prior as unit matrix for the
/// amplitude 1.
struct ScaledEquations {
  Eigen::MatrixXd P;
  Eigen::VectorXd b;
  double u_m = 0.0;
  DriftCourse course = DriftCourse::Smooth;

  // The same without the range offset, in coordinates in which P is tridiagonal: with it a
  // likelihood takes O(n) operations.
  Eigen::VectorXd diagonal{}, beside_diagonal{}, b_tridiagonal{};
  double constant = 0.0;  ///< part of -2 ln(likelihood) that does not depend on the amplitude
};

/// One combination of course, amplitude and repeatability.
struct DriftCell {
  std::size_t equations = 0;  ///< index in LikelihoodGrid::equations
  double amplitude_m = 0.0;
  double log_likelihood = 0.0;
};

/// All combinations for the same places.
struct LikelihoodGrid {
  std::vector<ScaledEquations> equations{};  ///< by course and repeatability
  std::vector<DriftCell> cells{};

  [[nodiscard]] const DriftCell& best() const;
  [[nodiscard]] double u_m(const DriftCell& cell) const { return equations[cell.equations].u_m; }
  /// Standard deviation of the random walk over the duration of the run.
  [[nodiscard]] double walk_m(const DriftCell& cell) const {
    return cell.amplitude_m * walk_of(equations[cell.equations].course);
  }
};

class DriftLikelihood {
 public:
  /// Both must outlive it.
  DriftLikelihood(const DriftObservations&, const DriftEquations&);

  /// NotConverged if `stopped` returns true.
  [[nodiscard]] Result<LikelihoodGrid> grid(const NestPlaces&, const Stopped& stopped) const;
  [[nodiscard]] Eigen::VectorXd unknowns(const LikelihoodGrid&, const DriftCell&) const;
  [[nodiscard]] Eigen::MatrixXd covariance(const LikelihoodGrid&, const DriftCell&) const;
  [[nodiscard]] Eigen::VectorXd coefficients(const Eigen::VectorXd& unknowns) const {
    return unknowns.tail(unknowns.size() - equations_.offsets());
  }
  [[nodiscard]] const NestRows& nests() const { return nests_; }
  [[nodiscard]] const DriftObservations& observations() const { return d_; }

 private:
  struct Factors;
  [[nodiscard]] ScaledEquations scaled(const NestPlaces&, double u_m, DriftCourse) const;
  /// Root of the prior of all unknowns times x, and its transpose times x.
  [[nodiscard]] Eigen::MatrixXd root_times(DriftCourse, const Eigen::MatrixXd& x) const;
  [[nodiscard]] Eigen::MatrixXd root_transposed_times(DriftCourse, const Eigen::MatrixXd& x) const;
  [[nodiscard]] Factors factors(const ScaledEquations&, double amplitude_m) const;

  const DriftObservations& d_;
  const DriftEquations& equations_;
  DriftBasis basis_;
  NestRows nests_;
  std::map<DriftCourse, Eigen::MatrixXd> roots_{};  ///< of the prior of one mode, amplitude 1
};

}  // namespace abbe::calib::otf
