#include "solve/feature_residuals.hpp"

#include <cmath>

namespace abbe::calib::mfb {
namespace {

struct FittedFeature {
  bool is_plane = false;
  Vector3 point = Vector3::Zero(), direction = Vector3::UnitZ();
  double radius_m = 0.0;

  [[nodiscard]] double off_m(const Vector3& p_m) const {
    const Vector3 from = p_m - point;
    return is_plane ? from.dot(direction)
                    : (from - from.dot(direction) * direction).norm() - radius_m;
  }
};

std::optional<FittedFeature> fitted_feature(Feature kind, std::span<const Vector3> points_m,
                                            const Vector3& near) {
  if (kind == Feature::Plane) {
    const auto plane = fit::fit_plane(points_m, near);
    return plane ? std::optional(FittedFeature{true, plane->point, plane->normal, 0.0})
                 : std::nullopt;
  }
  const auto cylinder = fit::fit_cylinder(points_m, near);
  return cylinder ? std::optional(FittedFeature{false, cylinder->point, cylinder->direction,
                                                cylinder->radius})
                  : std::nullopt;
}

std::size_t unknowns_of(Feature kind) {
  return kind == Feature::Plane ? 3 : 5;
}

void set_residuals_of(ResidualsOfFeature& f, const Matrix3& axes) {
  const auto fitted = fitted_feature(f.feature.feature, f.corrected_m, near_direction(f, axes));
  f.residual_m.assign(f.k.size(), 0.0);
  if (!fitted || f.k.size() <= unknowns_of(f.feature.feature)) {
    return;
  }
  f.degrees_of_freedom = f.k.size() - unknowns_of(f.feature.feature);
  for (std::size_t i = 0; i < f.k.size(); ++i) {
    f.residual_m[i] = fitted->off_m(f.corrected_m[i]);
  }
}

/// The features of one pass with their corrected touches, in the fixed order.
std::vector<ResidualsOfFeature> corrected_features(const Observations& o,
                                                   const PassObservation& pass,
                                                   const PassTouches& touches,
                                                   const Eigen::VectorXd& U) {
  const TouchPattern& pattern = o.bar.pattern;
  const Vector3& tool_m = o.plan.measurements[pass.measurement].tool_offset_m;
  const std::vector<NominalTouch> nominal = nominal_touches(pattern, o.plan.tip_radius_m);
  std::vector<const Touch*> at(nominal.size(), nullptr);
  for (const Touch& touch : touches) {
    if (!touch.set_aside) {
      at[*pattern.place_of(touch.target)] = &touch;
    }
  }

  std::vector<ResidualsOfFeature> all;
  for (std::size_t place = 0; place < nominal.size(); ++place) {
    const Target& target = nominal[place].target;
    if (target.k == 0) {
      all.push_back({.measurement = pass.measurement, .feature = target});
    }
    if (at[place] != nullptr) {
      const Vector3& reading_m = at[place]->reading_m;
      const Vector3 V_m = o.basis.V_m({.q_m = reading_m, .tool_offset_m = tool_m},
                                      {U.data(), static_cast<std::size_t>(U.size())});
      all.back().k.push_back(target.k);
      all.back().corrected_m.emplace_back(reading_m + tool_m + V_m);
    }
  }
  return all;
}

}  // namespace

Vector3 near_direction(const ResidualsOfFeature& f, const Matrix3& axes) {
  switch (f.feature.feature) {
    case Feature::Hole:
      return axes.col(2);
    case Feature::Rod:
      return axes.col(1);
    case Feature::Plane:
      break;
  }
  return f.feature.side == Side::Left ? Vector3(axes.col(1)) : Vector3(-axes.col(1));
}

double ResidualsOfFeature::sigma_m() const {
  double squares = 0.0;
  for (const double r : residual_m) {
    squares += r * r;
  }
  return degrees_of_freedom == 0 ? 0.0
                                 : std::sqrt(squares / static_cast<double>(degrees_of_freedom));
}

std::vector<ResidualsOfFeature> feature_residuals(const Observations& o,
                                                  std::span<const PassTouches> touches,
                                                  const Eigen::VectorXd& U) {
  std::vector<ResidualsOfFeature> all;
  for (const PassObservation& pass : o.passes) {
    for (ResidualsOfFeature& f : corrected_features(o, pass, touches[pass.measurement], U)) {
      set_residuals_of(f, o.positions[pass.position].pose.axes);
      all.push_back(std::move(f));
    }
  }
  return all;
}

std::optional<WithoutTouch> without_touch(const ResidualsOfFeature& f, std::size_t place,
                                          const Matrix3& axes) {
  std::vector<Vector3> others_m = f.corrected_m;
  others_m.erase(others_m.begin() + static_cast<std::ptrdiff_t>(place));
  const auto fitted = fitted_feature(f.feature.feature, others_m, near_direction(f, axes));
  if (!fitted) {
    return std::nullopt;
  }
  WithoutTouch without;
  without.off_m = fitted->off_m(f.corrected_m[place]);
  for (const Vector3& p_m : others_m) {
    without.squares_m2 += fitted->off_m(p_m) * fitted->off_m(p_m);
  }
  return without;
}

}  // namespace abbe::calib::mfb
