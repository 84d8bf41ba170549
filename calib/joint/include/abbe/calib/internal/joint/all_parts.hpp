#pragma once
/// The adjustment of all parts in the coordinates of the datum (joint/identify.hpp), and what it
/// becomes if one part differs from all others in one combination of the coordinates.

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

  /// Part `part` observes e + `column` d, all other parts e: the estimate of d.
  struct Directed {
    double d = 0.0, u = 0.0;
    /// Degrees of freedom of u, from the parts with an estimated noise ([GUM] G.4.1 eq. (G.2b));
    /// 0: all uncertainties were stated.
    double dof = 0.0;
    double log_p = 0.0;       ///< of the decrease of chi-square
    double log_p_left = 0.0;  ///< of the chi-square that is left with this d
  };
  /// nullopt: the parts do not determine d.
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
  Eigen::MatrixXd Q_;  ///< of the columns of all unknowns, orthonormal
  Eigen::VectorXd w_;  ///< residuals of all parts together
  double noise_factor_ = 1.0;
};

}  // namespace abbe::calib::joint
