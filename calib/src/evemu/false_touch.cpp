#include "evemu/false_touch.hpp"

#include <algorithm>
#include <cmath>

#include "chi2_bound.hpp"
#include "elementary.hpp"
#include "message.hpp"
#include "units.hpp"

namespace abbe::calib::evemu {
namespace {

double count_of_touches(const std::vector<FeatureResiduals>& all) {
  double count = 0.0;
  for (const FeatureResiduals& f : all) {
    count += static_cast<double>(f.r_m.size());
  }
  return count;
}

}  // namespace

std::optional<TouchFinding> false_touch(const Observations& o,
                                        const std::vector<FeatureResiduals>& all, double sigma_m,
                                        double false_alarm) {
  const FeatureResiduals* worst = nullptr;
  Eigen::Index touch = 0;
  double w = 0.0;

  for (const FeatureResiduals& f : all) {
    for (Eigen::Index k = 0; k < f.r_m.size(); ++k) {
      if (f.free(k) < kLeastFree) {
        continue;
      }
      const double w_k = std::abs(f.r_m(k)) / (sigma_m * std::sqrt(f.free(k)));
      if (w_k > w) {
        worst = &f, touch = k, w = w_k;
      }
    }
  }

  // The two-sided tail probability of the normal distribution is below exp(-w^2 / 2).
  if (worst == nullptr || !(0.5 * w * w > natural_logarithm(count_of_touches(all) / false_alarm))) {
    return std::nullopt;
  }

  const FeatureResiduals& f = *worst;
  const double size_m = f.r_m(touch) / f.free(touch);
  const double rest_m2 = f.r_m.squaredNorm() - f.r_m(touch) * size_m;
  const double x = natural_logarithm(static_cast<double>(all.size()) / false_alarm);

  if (rest_m2 > sigma_m * sigma_m * chi2_bound(std::max(0.0, f.dof() - 1.0), x)) {
    return std::nullopt;  // more than one touch is wrong
  }

  const Eigen::VectorXd along = size_m * Eigen::VectorXd::Unit(f.r_m.size(), touch);
  return TouchFinding{
      .cause = Cause::Touch,
      .text =
          message(place_of(o, f), ": touch ", touch + 1, " of ", f.r_m.size(), " lies ",
                  size_m * kUmPerM, " um off the surface of the others (noise of a touch ",
                  sigma_m * kUmPerM, " um): dirt or a false trigger; clean and touch there again"),
      .log_likelihood = 0.5 * w * w,
      .rows_m = effect_m(o, f, along)};
}

}  // namespace abbe::calib::evemu
