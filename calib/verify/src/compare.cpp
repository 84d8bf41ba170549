#include "abbe/calib/verify/compare.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "abbe/calib/geometry/scaled_design.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/verify/interpolation.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::verify {
namespace {

// Least number of points. With fewer points the fitted rigid motion leaves too few degrees of
// freedom.
constexpr std::size_t kLeastPoints = 4;
// This length is below the resolution of any instrument; a ratio R_resmag to a smaller |V_las| is
// meaningless.
constexpr double kNegligible_m = 1e-9;

Vector3 mean_of(std::span<const Vector3> v) {
  Vector3 sum = Vector3::Zero();
  for (const Vector3& x : v) {
    sum += x;
  }
  return sum / static_cast<double>(v.size());
}

/// Residuals T measured - wanted, T: best-fit rigid motion.
Result<std::vector<Vector3>> left_after_fit(std::span<const Vector3> measured_m,
                                            std::span<const Vector3> wanted_m) {
  const auto T = fit_rigid(measured_m, wanted_m);
  ABBE_TRY(T);
  std::vector<Vector3> left;
  for (std::size_t i = 0; i < wanted_m.size(); ++i) {
    left.emplace_back(*T * measured_m[i] - wanted_m[i]);
  }
  return left;
}

/// Returns BadInput for a step that gives too many grid points, for example a step in um instead of
/// mm.
Result<void> check_step(const ReadingBox& box, const Comparison& c) {
  constexpr double kMostPlaces = 1e6;
  const double places = (2.0 * box.half_width_m).cwiseQuotient(c.step_m).array().max(1.0).prod();
  if (!(places <= kMostPlaces)) {
    return failure(ErrorCode::BadInput,
                   message("verification: steps of (", kMmPerM * c.step_m.transpose(), ") mm make ",
                           places, " grid points, limit ", kMostPlaces));
  }
  return {};
}

/// Grid points inside the validity volume whose coordinates are multiples of the step, at least
/// `least_distance_m` from the origin; z varies fastest.
std::vector<Vector3> grid_places(const VolumetricModel& model, const ReadingBox& box,
                                 const Comparison& c) {
  const Vector3 low = (box.centre_m - box.half_width_m).cwiseQuotient(c.step_m),
                high = (box.centre_m + box.half_width_m).cwiseQuotient(c.step_m);
  using Steps = Eigen::Matrix<Eigen::Index, 3, 1>;
  const Steps first = low.array().ceil().cast<Eigen::Index>(),
              last = high.array().floor().cast<Eigen::Index>();
  std::vector<Vector3> places;

  for (Eigen::Index i = first.x(); i <= last.x(); ++i) {
    for (Eigen::Index j = first.y(); j <= last.y(); ++j) {
      for (Eigen::Index k = first.z(); k <= last.z(); ++k) {
        const Vector3 p = c.step_m.cwiseProduct(Steps(i, j, k).cast<double>());
        const bool near = c.origin_m && (p - *c.origin_m).norm() < c.least_distance_m;
        if (!near && model.validity().contains(p)) {
          places.push_back(p);
        }
      }
    }
  }

  return places;
}

/// Grid points with the interpolation weights of the measured points. The last entry is the origin,
/// if there is an origin.
struct WeightedPlaces {
  std::vector<Vector3> q_m;
  std::vector<LinearWeights> weights;
};

Result<WeightedPlaces> weighted_places(const Observations& o, const VolumetricModel& model,
                                       const Comparison& c) {
  const auto box = bounding_box(model.validity().vertices_m());
  ABBE_TRY(check_step(box, c));

  std::vector<Vector3> wanted = grid_places(model, box, c);
  if (c.origin_m) {
    wanted.push_back(*c.origin_m);
  }

  const auto weights = linear_weights(o.readings_m, wanted);
  ABBE_TRY(weights);

  if (c.origin_m && !weights->back()) {
    return failure(ErrorCode::DegenerateGeometry,
                   message("verification: the origin (", kMmPerM * c.origin_m->transpose(),
                           ") mm, where V is set to zero, is outside the measured points"));
  }

  WeightedPlaces places;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if ((*weights)[i]) {
      places.q_m.push_back(wanted[i]);
      places.weights.push_back(*(*weights)[i]);
    }
  }

  const std::size_t grid = places.q_m.size() - (c.origin_m ? 1 : 0);
  if (grid < kLeastPoints) {
    return failure(ErrorCode::TooFewObservations,
                   message("verification: ", grid,
                           " grid points are inside both the model's validity volume and the "
                           "measured points, needs ",
                           kLeastPoints));
  }

  return places;
}

/// `values` at the grid points relative to the value at the origin (the last one) or, without an
/// origin, to their mean. The result has one value per grid point, none for the origin.
std::vector<Vector3> relative(std::vector<Vector3> values, bool has_origin) {
  const Vector3 zero = has_origin ? values.back() : mean_of(values);
  if (has_origin) {
    values.pop_back();
  }
  for (Vector3& v : values) {
    v -= zero;
  }
  return values;
}

std::vector<Vector3> interpolated(const WeightedPlaces& places, std::span<const Vector3> values) {
  std::vector<Vector3> out;
  for (const LinearWeights& w : places.weights) {
    Vector3& v = out.emplace_back(Vector3::Zero());
    for (std::size_t k = 0; k < w.point.size(); ++k) {
      v += w.weight[k] * values[w.point[k]];
    }
  }
  return out;
}

std::vector<Vector3> modelled(const VolumetricModel& model, const Vector3& tool_m,
                              std::span<const Vector3> places_m) {
  std::vector<Vector3> out;
  for (const Vector3& q : places_m) {
    out.push_back(model.V_at(q, tool_m));
  }
  return out;
}

/// Fills the grid with V_las and V of the model, and computes the interpolation error.
Result<void> fill_grid(const Observations& o, const VolumetricModel& model, const Vector3& tool_m,
                       Comparison& out) {
  const auto places = weighted_places(o, model, out);
  ABBE_TRY(places);

  const bool has_origin = out.origin_m.has_value();
  const auto las = relative(interpolated(*places, o.V_m), has_origin);
  const auto stated = relative(modelled(model, tool_m, places->q_m), has_origin);
  const auto coarse =
      relative(interpolated(*places, modelled(model, tool_m, o.readings_m)), has_origin);
  std::vector<Vector3> interpolation_error;

  for (std::size_t i = 0; i < las.size(); ++i) {
    GridPoint& g = out.grid.emplace_back();
    g.q_m = places->q_m[i];
    g.V_las_m = las[i];
    g.stated_m = stated[i];
    interpolation_error.emplace_back(coarse[i] - stated[i]);
  }

  out.interpolation_rms_m = vector_statistics(interpolation_error).rms_m;
  return {};
}

/// Fits the model to V_las: with a rotation about the origin or, without an origin, with a rigid
/// motion.
Result<void> fit_model_to_V_las(Comparison& c) {
  std::vector<Vector3> places, difference;
  for (const GridPoint& g : c.grid) {
    places.push_back(g.q_m);
    difference.emplace_back(g.V_las_m - g.stated_m);
  }

  const Vector3 origin = c.origin_m.value_or(Vector3::Zero());
  if (c.origin_m) {
    Matrix3 N = Matrix3::Zero();
    Vector3 moment = Vector3::Zero();
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Matrix3 E = rotation_effect(places[i] - origin);
      N.noalias() += E.transpose() * E;
      moment.noalias() += E.transpose() * difference[i];
    }
    c.turned.tail<3>() = N.ldlt().solve(moment);
  } else {
    const auto fitted = rigid_free(places, difference);
    ABBE_TRY(fitted);
    c.turned = fitted->rigid;
  }

  for (GridPoint& g : c.grid) {
    g.turned_m =
        g.stated_m + c.turned.head<3>() + rotation_effect(g.q_m - origin) * c.turned.tail<3>();
  }

  return {};
}

/// Computes R_resmag at the grid points and its statistics.
void compute_ratios(Comparison& c) {
  std::erase_if(c.grid, [&](const GridPoint& g) { return g.V_las_m.norm() < kNegligible_m; });
  std::vector<double> stated, turned;
  for (GridPoint& g : c.grid) {
    const double size = g.V_las_m.norm();
    g.R_stated = (g.V_las_m - g.stated_m).norm() / size;
    g.R_turned = (g.V_las_m - g.turned_m).norm() / size;
    stated.push_back(g.R_stated);
    turned.push_back(g.R_turned);
  }
  c.R_stated = ratio_statistics(std::move(stated));
  c.R_turned = ratio_statistics(std::move(turned));
}

/// The percentile `share` (0 to 1) of n sorted values, interpolated between the two order
/// statistics next to the index share * (n - 1).
double percentile(const std::vector<double>& sorted, double share) {
  const double at = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (at - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

/// Sets origin, step and least distance from the options, or their defaults.
void set_options(Comparison& c, const VolumetricModel& model, const Options& options) {
  constexpr double kSteps = 20.0, kTenth = 0.1;
  c.origin_m = options.origin_m;
  if (!c.origin_m && model.polynomials() != nullptr) {
    c.origin_m = model.polynomials()->ball1_m();
  }
  const auto box = bounding_box(model.validity().vertices_m());
  const Vector3 extent = 2.0 * box.half_width_m;
  c.step_m = (options.step_m.array() > 0.0).select(options.step_m, extent / kSteps);
  c.least_distance_m = c.origin_m ? options.least_distance_m.value_or(kTenth * extent.norm()) : 0.0;
}

}  // namespace

RatioStatistics ratio_statistics(std::vector<double> ratios) {
  RatioStatistics s;
  s.count = ratios.size();
  if (ratios.empty()) {
    return s;
  }

  std::sort(ratios.begin(), ratios.end());
  const auto n = static_cast<double>(ratios.size());
  for (const double r : ratios) {
    s.mean += r / n;
    s.above_1 += r > 1.0 ? 1 : 0;
  }

  double squares = 0.0;
  for (const double r : ratios) {
    squares += (r - s.mean) * (r - s.mean);
  }

  s.standard_deviation = n > 1.0 ? std::sqrt(squares / (n - 1.0)) : 0.0;
  s.min = ratios.front();
  s.p25 = percentile(ratios, 0.25);
  s.median = percentile(ratios, 0.5);
  s.p75 = percentile(ratios, 0.75);
  s.max = ratios.back();

  return s;
}

Effect effect_at_points(const Comparison& c) noexcept {
  const auto n = static_cast<double>(c.residual_before_m.size());
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < c.residual_before_m.size(); ++i) {
    const double gained =
        c.residual_before_m[i].squaredNorm() - c.residual_after_m[i].squaredNorm();
    sum += gained;
    squares += gained * gained;
  }

  const double mean = sum / n;
  constexpr double kClearly = 3.0;
  const double standard_error = std::sqrt(std::max(squares / n - mean * mean, 0.0) / (n - 1.0));

  if (!(std::abs(mean) > kClearly * standard_error)) {
    return Effect::NotSeen;
  }

  return mean > 0.0 ? Effect::Better : Effect::Worse;
}

bool ratios_hold(const Comparison& c) noexcept {
  return c.interpolation_rms_m <= std::max(kMostInterpolation * c.after.rms_m, kNegligible_m);
}

Result<Comparison> compare_at_points(const Observations& o, const VolumetricModel& model,
                                     const Vector3& tool_m) {
  if (!model.holds_for_tool(tool_m)) {
    return failure(ErrorCode::NotApplicable,
                   message("verification for tool offset (", kMmPerM * tool_m.transpose(),
                           ") mm: the model is not valid for it"));
  }

  Comparison out;
  std::vector<Vector3> measured, readings, corrected;
  for (std::size_t i = 0; i < o.readings_m.size(); ++i) {
    if (!model.validity().contains(o.readings_m[i])) {
      continue;
    }
    out.inside.push_back(i);
    measured.push_back(o.measured_m[i]);
    readings.push_back(o.readings_m[i]);
    corrected.emplace_back(o.readings_m[i] + model.V_at(o.readings_m[i], tool_m));
  }

  if (out.inside.size() < kLeastPoints) {
    return failure(
        ErrorCode::TooFewObservations,
        message("verification: ", out.inside.size(), " of ", o.readings_m.size(),
                " measured places are inside the model's validity volume, needs ", kLeastPoints));
  }

  auto before = left_after_fit(measured, readings), after = left_after_fit(measured, corrected);
  if (!before || !after) {
    return tl::make_unexpected(before ? after.error() : before.error());
  }

  out.residual_before_m = std::move(*before);
  out.residual_after_m = std::move(*after);
  out.before = vector_statistics(out.residual_before_m);
  out.after = vector_statistics(out.residual_after_m);

  return out;
}

Result<Comparison> compare(const Observations& o, const VolumetricModel& model,
                           const Vector3& tool_offset_m, const Options& options) {
  auto at_points = compare_at_points(o, model, tool_offset_m);
  if (!at_points) {
    return at_points;
  }

  Comparison c = std::move(*at_points);
  set_options(c, model, options);
  ABBE_TRY(fill_grid(o, model, tool_offset_m, c));

  ABBE_TRY(fit_model_to_V_las(c));

  compute_ratios(c);
  return c;
}

}  // namespace abbe::calib::verify
