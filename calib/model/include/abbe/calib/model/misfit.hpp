#pragma once
/// Misfit: errors of the machine that the form of its model cannot represent, because they change
/// between the nodes of a table, depend on several axes at once, or have a higher degree than the
/// polynomials. A calibration finds them as differences from the model that are the same in every
/// visit of a place. They are part of the uncertainty of V:
///     cov V(q) += sum_T m_T(q)^2 g_T(q) g_T(q)^T + diag(u_V)^2
/// m_T: standard uncertainty of table T due to misfit, linear between the nodes; g_T: displacement
/// of the functional point per unit of table T.

#include <Eigen/Core>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::calib {

struct Misfit {
  /// m_T at the nodes, standard uncertainties in m or rad, in the order of the parameters of the
  /// model; 0 for the squareness errors. Empty: no misfit of tables. Always empty for polynomials.
  Eigen::VectorXd u_of_parameters{};
  Vector3 u_V_m = Vector3::Zero();  ///< standard uncertainties of the components of V in machine
                                    ///< axes, in addition to the tables
  /// Distance at which the correlation of the misfit falls to one half: of the misfit of the
  /// tables, and of that of V. 0: this misfit does not exist.
  double table_length_m = 0.0, V_length_m = 0.0;

  [[nodiscard]] bool any() const {
    return (u_of_parameters.size() > 0 && u_of_parameters.maxCoeff() > 0.0) ||
           u_V_m.maxCoeff() > 0.0;
  }
};

}  // namespace abbe::calib
