#pragma once
/// Least-squares circle (two dimensions) or sphere (three): minimises sum (|p_i - c| - radius)^2.

#include "least_squares.hpp"

namespace abbe::calib::fit {

template <int Dimensions>
using Points = Eigen::Matrix<double, Dimensions, Eigen::Dynamic>;

template <int Dimensions>
struct Radial {
  Eigen::Matrix<double, Dimensions, 1> centre = Eigen::Matrix<double, Dimensions, 1>::Zero();
  double radius = 1.0;
};

/// Algebraic fit (Kasa): |p|^2 = 2 c . p + (r^2 - |c|^2) is linear in c and in the term in
/// brackets.
template <int Dimensions>
Radial<Dimensions> algebraic(const Points<Dimensions>& p) {
  Eigen::Matrix<double, Eigen::Dynamic, Dimensions + 1> A(p.cols(), Dimensions + 1);
  A << 2.0 * p.transpose(), Eigen::VectorXd::Ones(p.cols());
  const Eigen::Matrix<double, Dimensions + 1, 1> x =
      A.colPivHouseholderQr().solve(p.colwise().squaredNorm().transpose());
  const auto centre = x.template head<Dimensions>();
  return {centre, std::sqrt(std::max(0.0, x(Dimensions) + centre.squaredNorm()))};
}

/// Residuals |p_i - c| - radius and their derivatives with respect to c and radius.
template <int Dimensions>
Linearised<Dimensions + 1> linearised(const Points<Dimensions>& p, const Radial<Dimensions>& s) {
  Linearised<Dimensions + 1> at;
  at.J.resize(p.cols(), Dimensions + 1);
  at.r.resize(p.cols());
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const Eigen::Matrix<double, Dimensions, 1> away = p.col(i) - s.centre;
    const double distance = away.norm();
    at.r(i) = distance - s.radius;
    at.J.row(i) << -away.transpose() / distance, -1.0;
  }
  return at;
}

template <int Dimensions>
Iteration refine(const Points<Dimensions>& p, Radial<Dimensions>& s) {
  return minimise([&] { return linearised(p, s); },
                  [&](const Eigen::Matrix<double, Dimensions + 1, 1>& change) {
                    s.centre += change.template head<Dimensions>();
                    s.radius += change(Dimensions);
                    return s.radius;
                  });
}

}  // namespace abbe::calib::fit
