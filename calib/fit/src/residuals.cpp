#include "abbe/calib/fit/residuals.hpp"

#include <cmath>

namespace abbe::calib::fit {

ResidualStatistics residual_statistics(const Eigen::VectorXd& r, std::size_t unknowns) {
  ResidualStatistics s;
  s.points = static_cast<std::size_t>(r.size());
  s.degrees_of_freedom = s.points > unknowns ? s.points - unknowns : 0;

  if (r.size() == 0) {
    return s;
  }

  s.rms = std::sqrt(r.squaredNorm() / static_cast<double>(s.points));
  s.sigma0 = s.degrees_of_freedom > 0
                 ? std::sqrt(r.squaredNorm() / static_cast<double>(s.degrees_of_freedom))
                 : 0.0;
  s.min = r.minCoeff();
  s.max = r.maxCoeff();

  return s;
}

}  // namespace abbe::calib::fit
