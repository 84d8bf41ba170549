#pragma once
/// The estimate of a run, repeated with columns added to the design or with another design. The
/// lack of fit compares the marginal likelihoods of these estimates (lack_of_fit.hpp). Estimator:
/// bayes-pose, without slow noise unless the observations have it. Pure; allocates.

#include <Eigen/Core>
#include <cstddef>

#include "abbe/calib/evemu/solve/prior.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"
#include "abbe/calib/internal/geometry/rigid_free_norm.hpp"

namespace abbe::calib::evemu {

/// Whitened rows of a run, and the hyper-parameters of bayes-pose without any alternative. Refers
/// to the observations and the design; both must outlive it.
struct RunRows {
  const Observations& o;
  const ScaledDesign& design;
  std::size_t positions;
  Eigen::MatrixXd X, S, A;  ///< design, pose rotations, array (one column per standard uncertainty)
  Eigen::VectorXd y;        ///< observed errors [m]
  HyperParameters hyper;
  RigidFreeNorm norm;
};
/// Makes the rows. The hyper-parameters are those of `solution` if it is bayes-pose without slow
/// noise; otherwise they are estimated. NotConverged if the likelihood cannot be computed at any
/// starting point.
[[nodiscard]] Result<RunRows> run_rows(const Observations&, const ScaledDesign&, const Solution&);

/// Estimate with added columns. The columns of the array's own uncertainty are always added.
struct Refit {
  HyperParameters hyper;
  Eigen::VectorXd c_m, d_m;       ///< coefficients of the design, and of the added columns
  Eigen::MatrixXd covariance_m2;  ///< covariance of the coefficients c_m
};
/// Repeats the estimate. `X`: whitened rows of `design`; `C`: whitened columns added to them, with
/// the prior standard deviation `size_m`. NotConverged if there is no likelihood near the
/// hyper-parameters of the run, or no finite solution.
[[nodiscard]] Result<Refit> refit(const RunRows&, const ScaledDesign& design,
                                  const Eigen::MatrixXd& X, const Eigen::MatrixXd& C,
                                  double size_m);
/// As refit(), with `y` in place of the observed errors of the run.
[[nodiscard]] Result<Refit> refit_to(const Eigen::VectorXd& y, const RunRows&,
                                     const ScaledDesign& design, const Eigen::MatrixXd& X,
                                     const Eigen::MatrixXd& C, double size_m);

/// The estimate with which alternatives are compared: only the columns of the array's uncertainty
/// are added.
[[nodiscard]] Result<Refit> base_refit(const RunRows&);

}  // namespace abbe::calib::evemu
