#include "abbe/calib/estimation/null_space.hpp"

#include <Eigen/SVD>
#include <cmath>
#include <limits>

#include "estimation/column_scale.hpp"

namespace abbe::calib::estimation {
namespace {

using SingularValues = Eigen::BDCSVD<Eigen::MatrixXd>;

Eigen::MatrixXd scaled_R(const Information& data) {
  return data.R() * column_scale(data).asDiagonal();
}

Spectrum spectrum_of(const SingularValues& svd, const Information& data) {
  Spectrum s;
  s.singular_values = svd.singularValues();
  const Eigen::Index n = s.singular_values.size();
  if (n == 0) {
    return s;
  }

  s.threshold = static_cast<double>(n) * std::sqrt(static_cast<double>(data.rows())) *
                std::numeric_limits<double>::epsilon() * s.singular_values(0);
  while (static_cast<Eigen::Index>(s.rank) < n &&
         s.singular_values(static_cast<Eigen::Index>(s.rank)) > s.threshold) {
    ++s.rank;
  }

  if (s.rank > 0) {
    s.condition = s.singular_values(0) / s.singular_values(static_cast<Eigen::Index>(s.rank) - 1);
  }

  return s;
}

}  // namespace

Eigen::VectorXd column_scale(const Information& data) {
  Eigen::VectorXd scale(static_cast<Eigen::Index>(data.unknowns()));
  for (std::size_t i = 0; i < data.unknowns(); ++i) {
    const double squares = data.squared_length(i);
    scale(static_cast<Eigen::Index>(i)) = squares > 0.0 ? 1.0 / std::sqrt(squares) : 1.0;
  }
  return scale;
}

Spectrum spectrum(const Information& data) {
  return spectrum_of(SingularValues(scaled_R(data)), data);
}

NullSpace null_space(const Information& data) {
  const SingularValues svd(scaled_R(data), Eigen::ComputeFullV);
  NullSpace result{.spectrum = spectrum_of(svd, data)};
  const Eigen::Index n = svd.matrixV().cols();
  const Eigen::MatrixXd null =
      svd.matrixV().rightCols(n - static_cast<Eigen::Index>(result.spectrum.rank));
  result.basis = column_scale(data).asDiagonal() * null;
  result.share = null.rowwise().squaredNorm();
  return result;
}

}  // namespace abbe::calib::estimation
