#pragma once
/// The whitened rows of one position [A | L | y], and the elimination of its nuisances c. The
/// priors of c are added as further rows. An orthogonal Q then gives
///     Q^T [A L y] = [G R z]      c = R^-1 (z - G x), x: shared unknowns
///                   [E 0 e]      rows about x alone

#include <Eigen/Cholesky>
#include <vector>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/internal/mfb/solve/pass_rows.hpp"

namespace abbe::calib::mfb {

/// Root L of the covariance C_O = L L^T of the points of a pass. DegenerateGeometry if the touches
/// do not determine all points.
using RootOfNoise = Eigen::LLT<Eigen::MatrixXd>;
[[nodiscard]] Result<RootOfNoise> root_of_noise(const TouchNoise&, const PassObservation&);

struct PositionSystem {
  std::vector<std::size_t> passes;  ///< indices in Observations::passes; their rows follow each
                                    ///< other
  std::vector<RootOfNoise> root;    ///< one for each pass
  NuisanceLayout layout;
  Eigen::Index rows_of_pass = 0;
  RowMajorRows A;     ///< whitened rows of the data, without priors
  Eigen::MatrixXd L;  ///< whitened rows of the data, without priors
  Eigen::VectorXd y;  ///< whitened data
  Eigen::MatrixXd R;  ///< upper triangle
  Eigen::MatrixXd G;
  Eigen::VectorXd z;
  Eigen::MatrixXd E;
  Eigen::VectorXd e;

  /// Estimates of the nuisances for given shared unknowns x.
  [[nodiscard]] Eigen::VectorXd nuisances(const Eigen::VectorXd& x) const;
};

/// Computes the system of a position. RankDeficient if the rows do not determine the nuisances.
[[nodiscard]] Result<PositionSystem> position_system(const Observations&, std::size_t position,
                                                     const SharedUnknowns&, const NuisanceOptions&);

/// The matrix E^T Q_E^T W (shared unknowns x data rows), Q_E: columns of Q that belong to E, W:
/// whitening. Its product with the covariance C of the shared unknowns is the derivative of x by
/// delta.
[[nodiscard]] Eigen::MatrixXd gain_rows(const PositionSystem&);

/// Adds the priors of the shared unknowns.
void add_shared_priors(estimation::Information&, const SharedUnknowns&);

}  // namespace abbe::calib::mfb
