#pragma once
/// The adjustment of all parts in the coordinates e of the datum (joint/identify.hpp). directed()
/// extends it: one part may differ from all others in one combination of the coordinates.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/joint/part.hpp"

namespace abbe::calib::joint {

class AllParts {
 public:
  AllParts(std::span<const Part>, const DatumCoordinates&);

  /// Estimate of d if part `part` observes e + `column` d, and all other parts observe e.
  struct Directed {
    double d = 0.0, u = 0.0;
    /// Degrees of freedom of u, from the parts with an estimated noise ([GUM] G.4.1 eq. (G.2b));
    /// 0: all uncertainties were stated.
    double dof = 0.0;
    double log_p = 0.0;       ///< log of the probability of the decrease of chi-square by chance
    double log_p_left = 0.0;  ///< log of the probability of the chi-square that remains with this d
  };
  /// Returns nullopt if the parts do not determine d.
  [[nodiscard]] std::optional<Directed> directed(std::size_t part,
                                                 const Eigen::VectorXd& column) const;

 private:
  [[nodiscard]] Eigen::VectorXd without_model(const Eigen::VectorXd& rows) const;

  struct RowsOfPart {
    Eigen::MatrixXd of_e;
    Eigen::Index first = 0;
    double dof_of_noise = 0.0;
  };
  std::vector<RowsOfPart> parts_;
  Eigen::MatrixXd Q_;  ///< orthonormal basis of the columns of all unknowns
  Eigen::VectorXd w_;  ///< residuals of all parts together
  double noise_factor_ = 1.0;
};

}  // namespace abbe::calib::joint
