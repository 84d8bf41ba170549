#include "judge/false_touch.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/statistics/chi2_bound.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "run/ball_of_radius.hpp"

namespace abbe::calib::evemu {
namespace {

double count_of_touches(const std::vector<FeatureResiduals>& all) {
  double count = 0.0;
  for (const FeatureResiduals& f : all) {
    count += static_cast<double>(f.r_m.size());
  }
  return count;
}

/// The ball or face with the touch that has the largest residual relative to its standard
/// deviation.
struct Suspect {
  const FeatureResiduals* feature = nullptr;
  double w = 0.0;  ///< residual of the touch in units of its standard deviation
};

Suspect most_suspect(const std::vector<FeatureResiduals>& all, double sigma_m) {
  Suspect worst;
  for (const FeatureResiduals& f : all) {
    for (Eigen::Index k = 0; k < f.r_m.size(); ++k) {
      const double w = std::abs(f.r_m(k)) / (sigma_m * std::sqrt(f.free(k)));
      if (f.free(k) >= kLeastFree && w > worst.w) {
        worst = {&f, w};
      }
    }
  }
  return worst;
}

/// With fewer touches than this, the radius of a ball is taken from its touches at other positions:
/// a sphere with unknown radius has four unknowns, and five or six touches do not show which of
/// them is false.
constexpr Eigen::Index kFewTouches = 7;

/// Median of the fitted radii of a ball over the positions. A false touch changes the radius at one
/// position only, and so hardly the median.
double radius_at_all_positions_m(const std::vector<FeatureResiduals>& all, std::size_t ball) {
  std::vector<double> radii;
  for (const FeatureResiduals& f : all) {
    if (f.feature == Feature::Ball && f.index == ball) {
      radii.push_back(f.radius_m);
    }
  }
  return median(radii);
}

/// The surface through all touches of a feature but one.
struct WithoutOne {
  Eigen::Index touch = 0;   ///< index of the touch that is left out
  double off_m = 0.0;       ///< distance of this touch from the surface, outward
  double squares_m2 = 0.0;  ///< sum of squares of the residuals of the other touches
};

std::optional<WithoutOne> face_without(const std::vector<Vector3>& others, const Vector3& left_out,
                                       const Vector3& outward) {
  const auto plane = fit::fit_plane(others, outward);
  if (!plane) {
    return std::nullopt;
  }
  const double rms_m = plane->residuals.rms;
  return WithoutOne{.off_m = plane->normal.dot(left_out - plane->point),
                    .squares_m2 = rms_m * rms_m * static_cast<double>(others.size())};
}

/// Fits a ball to `others`. `radius_m`: the known radius; nullopt: the radius is an unknown of the
/// fit.
std::optional<WithoutOne> ball_without(const std::vector<Vector3>& others, const Vector3& left_out,
                                       const Vector3& centre_m, std::optional<double> radius_m) {
  if (radius_m) {
    const auto ball = fit_ball_of_radius(others, *radius_m, centre_m);
    return ball ? std::optional(WithoutOne{.off_m = (left_out - ball->centre_m).norm() - *radius_m,
                                           .squares_m2 = ball->squares_m2})
                : std::nullopt;
  }

  const auto sphere = fit::fit_sphere(others);
  if (!sphere) {
    return std::nullopt;
  }
  const double rms_m = sphere->residuals.rms;
  return WithoutOne{.off_m = (left_out - sphere->centre).norm() - sphere->radius,
                    .squares_m2 = rms_m * rms_m * static_cast<double>(others.size())};
}

/// Fits the surface of a feature once without each of the touches; the results are sorted by sum of
/// squares, smallest first. Each fit is computed anew, because a touch that is 0.5 mm off displaces
/// a ball so far that linearised residuals are wrong by um.
std::vector<WithoutOne> without_each(const FeatureResiduals& f, std::optional<double> radius_m) {
  std::vector<WithoutOne> found;
  for (Eigen::Index k = 0; k < f.r_m.size(); ++k) {
    std::vector<Vector3> others = f.points_m;
    others.erase(others.begin() + k);
    const Vector3& left_out = f.points_m[static_cast<std::size_t>(k)];
    auto one = f.feature == Feature::Ball ? ball_without(others, left_out, f.centre_m, radius_m)
                                          : face_without(others, left_out, f.normals.row(0));
    if (one) {
      one->touch = k;
      found.push_back(*one);
    }
  }

  std::stable_sort(found.begin(), found.end(), [](const WithoutOne& a, const WithoutOne& b) {
    return a.squares_m2 < b.squares_m2;
  });
  return found;
}

/// True if leaving out the first touch of `without` reduces the residuals by clearly more than
/// leaving out any other touch.
bool is_clear(const std::vector<WithoutOne>& without, double sigma_m) {
  constexpr double kClear = 10.0;  // limit of twice the difference of the log likelihoods
  return without.size() < 2 ||
         without[1].squares_m2 - without[0].squares_m2 > kClear * sigma_m * sigma_m;
}

std::string text_of(const Observations& o, const FeatureResiduals& f, const WithoutOne& false_one,
                    bool clear, double sigma_m) {
  const std::string noise = message(" (noise of a touch ", sigma_m * kUmPerM, " um)");
  if (clear) {
    return message(place_of(o, f), ": touch ", false_one.touch + 1, " of ", f.r_m.size(), " lies ",
                   false_one.off_m * kUmPerM, " um off the surface of the others", noise,
                   ": dirt or a false trigger; clean and touch there again");
  }
  return message(place_of(o, f), ": one of its ", f.r_m.size(),
                 " touches lies off the surface of the others", noise,
                 ", too few to find which one: dirt or a false trigger; clean and touch this ",
                 f.feature == Feature::Ball ? "ball" : "face", " again");
}

}  // namespace

std::optional<TouchFinding> false_touch(const Observations& o,
                                        const std::vector<FeatureResiduals>& all, double sigma_m,
                                        double false_alarm) {
  const auto [feature, w] = most_suspect(all, sigma_m);

  // The two-sided tail probability of the normal distribution is below exp(-w^2 / 2).
  if (feature == nullptr ||
      !(0.5 * w * w > natural_logarithm(count_of_touches(all) / false_alarm))) {
    return std::nullopt;
  }

  const FeatureResiduals& f = *feature;
  const bool known_radius = f.feature == Feature::Ball && f.r_m.size() < kFewTouches;
  const std::vector<WithoutOne> without = without_each(
      f, known_radius ? std::optional(radius_at_all_positions_m(all, f.index)) : std::nullopt);
  const double dof = f.dof() - (known_radius ? 0.0 : 1.0);
  const double x = natural_logarithm(static_cast<double>(all.size()) / false_alarm);

  if (without.empty() ||
      without[0].squares_m2 > sigma_m * sigma_m * chi2_bound(std::max(0.0, dof), x)) {
    return std::nullopt;  // more than one touch is wrong
  }

  const WithoutOne& false_one = without[0];
  const Eigen::VectorXd along =
      false_one.off_m * Eigen::VectorXd::Unit(f.r_m.size(), false_one.touch);
  return TouchFinding{.cause = Cause::Touch,
                      .text = text_of(o, f, false_one, is_clear(without, sigma_m), sigma_m),
                      .log_likelihood = 0.5 * w * w,
                      .rows_m = effect_m(o, f, along)};
}

}  // namespace abbe::calib::evemu
