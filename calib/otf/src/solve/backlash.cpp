#include "abbe/calib/otf/solve/backlash.hpp"

#include <algorithm>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::otf {
namespace {

TravelDifferences differences_in(const Observations& o, const Eigen::VectorXd& U,
                                 const Eigen::MatrixXd& covariance) {
  const auto n = static_cast<Eigen::Index>(o.layout().model_size()),
             m = static_cast<Eigen::Index>(o.basis.size()) - n;
  return {.kind = o.basis.travel(),
          .D = U.segment(n, m),
          .covariance = covariance.block(n, n, m, m),
          .cov_U_D = covariance.block(0, n, n, m)};
}

}  // namespace

estimation::Information with_backlash_prior(estimation::Information data, const Observations& o) {
  for (std::size_t i = o.layout().model_size(); i < o.basis.size(); ++i) {
    data.add_prior(i, 0.0, kUOfBacklash);
  }
  return data;
}

std::vector<Backlash> backlash_of(const Observations& o, const Eigen::VectorXd& U,
                                  const Eigen::MatrixXd& covariance) {
  if (!estimates_backlash(o)) {
    return {};
  }
  const TravelDifferences d = differences_in(o, U, covariance);
  return listed_differences(o.basis, d.D, d.covariance);
}

Result<VolumetricModel> model_of(const Observations& o, std::span<const Vector3> tool_offsets_m,
                                 const Eigen::VectorXd& U, const Eigen::MatrixXd& covariance,
                                 ValidityVolume validity) {
  const auto n = static_cast<Eigen::Index>(o.layout().model_size());
  Eigen::MatrixXd of_tables = covariance.topLeftCorner(n, n);
  TravelDifferences differences;
  if (estimates_backlash(o)) {
    differences = differences_in(o, U, covariance);
    const Eigen::MatrixXd half = half_differences(o.basis, differences.D);
    of_tables += half * half.transpose();
  }

  Result<VolumetricModel> model = VolumetricModel::from_vector(
      o.basis, ModelDatum::G2, tool_offsets_m, U.head(n), of_tables, std::move(validity));
  if (!model || !estimates_backlash(o)) {
    return model;
  }
  return model->with_travel(std::move(differences));
}

}  // namespace abbe::calib::otf
