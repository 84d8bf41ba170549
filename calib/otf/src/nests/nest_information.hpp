#pragma once
/// Information of visits of reference nests about the drift of the tracker.

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "nests/drift_basis.hpp"

namespace abbe::calib::otf {

/// Information N about the coefficients c of the drift, and N c, after elimination of the positions
/// of the nests.
struct NestInformation {
  Eigen::MatrixXd N;
  Eigen::VectorXd Nc;
  /// Part of -2 ln(likelihood) that does not depend on c: logarithms of the determinants and sum of
  /// squares. An unknown position has a normal prior of 1 mm.
  double constant = 0.0;
};

class NestRows {
 public:
  NestRows(const DriftObservations&, const DriftBasis&);

  /// `place`: for each visit the position to which it belongs. `u_m`: repeatability.
  [[nodiscard]] NestInformation information(const std::vector<std::size_t>& place,
                                            double u_m) const;
  /// Position measured by each visit after subtraction of the drift, relative to the first visit of
  /// its nest.
  [[nodiscard]] std::vector<Vector3> measured_m(const Eigen::VectorXd& c) const;
  /// Position of each place after subtraction of the drift, relative to the first visit of its
  /// nest.
  [[nodiscard]] std::vector<Vector3> positions(const std::vector<std::size_t>& place, double u_m,
                                               const Eigen::VectorXd& c) const;
  /// For each visit: length of its residual from the mean position of its place, divided by its
  /// standard uncertainty for the repeatability u_m. `c`: coefficients of the drift.
  [[nodiscard]] std::vector<double> residuals(const std::vector<std::size_t>& place, double u_m,
                                              const Eigen::VectorXd& c) const;

 private:
  /// One visit. H: derivatives of the measured position by the coefficients; only the columns of
  /// the knots next to the visit are stored.
  struct Row {
    Eigen::Index first_column = 0;
    Eigen::MatrixXd H;
    Vector3 z_m;  ///< measured position relative to the first visit of the nest
    Matrix3 cov_m2;
  };
  [[nodiscard]] Matrix3 weight(std::size_t visit, double u_m) const;

  std::size_t size_ = 0;
  std::vector<Row> rows_;
};

}  // namespace abbe::calib::otf
