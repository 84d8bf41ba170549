#pragma once
/// Likelihood of a drift for a course, an amplitude, a repeatability of the nests, and an
/// assignment of the visits to positions (tracker_drift.hpp).

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"
#include "nests/drift_basis.hpp"
#include "nests/nest_information.hpp"

namespace abbe::calib::otf {

/// The equations S d = g of the rows. d: range offset (only if it has a prior), then the
/// coefficients of the drift.
struct DriftEquations {
  Eigen::MatrixXd S{};
  Eigen::VectorXd g{};
  double u_range_offset_m = 0.0;  ///< 0: the range offset is not an unknown

  [[nodiscard]] Eigen::Index offsets() const { return u_range_offset_m > 0.0 ? 1 : 0; }
};

/// For each visit the index of the position (place) to which it belongs. A nest that moved has
/// several places.
using NestPlaces = std::vector<std::size_t>;

/// The equations for one course and one repeatability. They are scaled so that the prior for the
/// amplitude 1 is the unit matrix.
struct ScaledEquations {
  Eigen::MatrixXd P;
  Eigen::VectorXd b;
  double u_m = 0.0;
  DriftCourse course = DriftCourse::Smooth;

  // The equations without the range offset, in coordinates in which P is tridiagonal. In this form
  // a likelihood takes O(n) operations.
  Eigen::VectorXd diagonal{}, beside_diagonal{}, b_tridiagonal{};
  double constant = 0.0;  ///< part of -2 ln(likelihood) that does not depend on the amplitude
};

/// One combination of course, amplitude and repeatability.
struct DriftCell {
  std::size_t equations = 0;  ///< index in LikelihoodGrid::equations
  double amplitude_m = 0.0;
  double log_likelihood = 0.0;
};

/// All combinations of course, amplitude and repeatability for the same places.
struct LikelihoodGrid {
  std::vector<ScaledEquations> equations{};  ///< one for each course and repeatability
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
  /// Both arguments must outlive this object.
  DriftLikelihood(const DriftObservations&, const DriftEquations&);

  /// Computes the likelihood of all combinations. NotConverged if `stopped` returns true.
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
  /// Products with x: the root of the prior of all unknowns times x, and the transposed root times
  /// x.
  [[nodiscard]] Eigen::MatrixXd root_times(DriftCourse, const Eigen::MatrixXd& x) const;
  [[nodiscard]] Eigen::MatrixXd root_transposed_times(DriftCourse, const Eigen::MatrixXd& x) const;
  [[nodiscard]] Factors factors(const ScaledEquations&, double amplitude_m) const;

  const DriftObservations& d_;
  const DriftEquations& equations_;
  DriftBasis basis_;
  NestRows nests_;
  std::map<DriftCourse, Eigen::MatrixXd> roots_{};  ///< root of the prior of one mode, for the
                                                    ///< amplitude 1
};

}  // namespace abbe::calib::otf
