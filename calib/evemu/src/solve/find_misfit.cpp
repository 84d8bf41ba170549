#include "solve/find_misfit.hpp"

#include <algorithm>
#include <cmath>

#include "observe/feature_residuals.hpp"

namespace abbe::calib::evemu {
namespace {

/// Mean distance of neighbouring balls. The array contains no information about shorter distances.
double distance_of_balls_m(const Observations& o) {
  double sum_m = 0.0, count = 0.0;
  for (const BallError& a : o.rows) {
    double nearest_m = 0.0;
    for (const BallError& b : o.rows) {
      const double distance_m = (a.reading_m - b.reading_m).norm();
      if (a.position == b.position && a.ball != b.ball &&
          (nearest_m == 0.0 || distance_m < nearest_m)) {
        nearest_m = distance_m;
      }
    }
    sum_m += nearest_m;
    count += 1.0;
  }
  return sum_m / std::max(1.0, count);
}

/// Mean square of the standard uncertainties of the balls' places, per coordinate.
double variance_of_array_m2(const Observations& o) {
  if (!o.artefact || o.artefact->u_ball_m.empty()) {
    return 0.0;
  }
  double sum_m2 = 0.0;
  for (const double u_m : o.artefact->u_ball_m) {
    sum_m2 += u_m * u_m;
  }
  return sum_m2 / static_cast<double>(o.artefact->u_ball_m.size());
}

/// Upper limit of a variance that is estimated with `dof` degrees of freedom; exceeded with a
/// probability of 3e-5.
double largest_by_chance(double variance, double dof) {
  constexpr double kDeviations = 4.0;
  return variance * (1.0 + kDeviations * std::sqrt(2.0 / std::max(1.0, dof)));
}

}  // namespace

std::optional<Misfit> find_misfit(const Observations& o, const VolumetricModel& model,
                                  const Statistics& statistics) {
  if (o.seen.empty()) {
    return std::nullopt;
  }
  const std::vector<FeatureResiduals> touches = all_features(o, model).compared;
  const double s_centre_m = centre_noise_m(touches, pooled_sigma_m(touches));
  if (!(s_centre_m > 0.0)) {
    return std::nullopt;
  }

  const double of_touches_m2 = s_centre_m * s_centre_m;
  const double of_array_m2 = variance_of_array_m2(o);
  const double found_m2 = statistics.s_m * statistics.s_m;
  const double coordinates_of_array =
      o.artefact ? 3.0 * static_cast<double>(o.artefact->u_ball_m.size()) : 1.0;
  const double explained_m2 = largest_by_chance(of_touches_m2, statistics.degrees_of_freedom) +
                              largest_by_chance(of_array_m2, coordinates_of_array);
  if (!(found_m2 > explained_m2)) {
    return std::nullopt;
  }
  return Misfit{.u_V_m = Vector3::Constant(std::sqrt(found_m2 - of_touches_m2 - of_array_m2)),
                .V_length_m = distance_of_balls_m(o)};
}

}  // namespace abbe::calib::evemu
