#pragma once
/// A model beside the true errors of its machine.

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "campaign.hpp"

namespace abbe::tests::never_worse {

struct Box {
  calib::Vector3 low_m, high_m;  ///< scale readings
};

/// Sets the figures of `outcome` but those of U(V), from a grid of 9 x 9 x 9 readings. Intervals
/// are those of V as the datum of the model states it: `true_V_m` is in this datum.
inline void compare_with_truth(
    Outcome& outcome, const calib::VolumetricModel& model, const Box& box,
    const calib::Vector3& tool_offset_m,
    const std::function<calib::Vector3(const calib::Vector3& q_m)>& true_V_m) {
  constexpr int kSteps = 8;
  using calib::Vector3;
  std::vector<Vector3> points, truth, difference;
  std::vector<calib::Matrix3> cov;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      for (int k = 0; k <= kSteps; ++k) {
        const Vector3 q =
            box.low_m + (box.high_m - box.low_m).cwiseProduct(Vector3(i, j, k)) / kSteps;
        const Vector3 V = true_V_m(q);
        const calib::VolumetricError e = model.error_at(q, tool_offset_m);
        points.push_back(q + tool_offset_m);
        truth.push_back(V);
        difference.push_back(e.V_m - V);
        cov.push_back(e.cov_V_m2);
      }
    }
  }

  const auto before = calib::rigid_free(points, truth),
             left = calib::rigid_free(points, difference);
  outcome.before_m = before->rigid_free.mean_m;
  outcome.left_m = left->rigid_free.mean_m;
  // A component of V whose uncertainty is below kFixed_m is fixed by the datum and has no interval.
  constexpr double kNormal975 = 1.95996, kFixed_m = 1e-9;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double u_m = std::sqrt(std::max(0.0, cov[i](k, k)));
      if (u_m > kFixed_m) {
        ++outcome.intervals;
        outcome.covered += std::abs(difference[i](k)) <= kNormal975 * u_m;
      }
    }
    outcome.u_m += std::sqrt(std::max(0.0, cov[i].trace())) / static_cast<double>(points.size());
  }
}

}  // namespace abbe::tests::never_worse
