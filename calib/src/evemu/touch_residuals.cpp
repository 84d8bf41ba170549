#include "evemu/touch_residuals.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "chi2_bound.hpp"
#include "elementary.hpp"
#include "message.hpp"
#include "units.hpp"

namespace abbe::calib::evemu {
namespace {

/// Touches of one ball or face, V taken out.
struct FeatureResiduals {
  std::size_t seen = 0;
  Feature feature = Feature::Ball;
  std::size_t index = 0;     ///< of the ball or block, from 0
  Eigen::MatrixXd normals;   ///< outward at each touch, 3 columns
  Eigen::MatrixXd response;  ///< unknowns x touches: what a displacement along the normal does to the fit
  Eigen::VectorXd r_m;       ///< residuals
  Eigen::VectorXd free;      ///< share of a touch's displacement that its residual shows, 1 - leverage
  [[nodiscard]] double dof() const { return static_cast<double>(r_m.size() - response.rows()); }
};

/// `design`: touches x unknowns.
void finish(FeatureResiduals& f, const Eigen::MatrixXd& design) {
  f.response = design.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(design.rows(), design.rows()));
  f.free = (1.0 - (design.cwiseProduct(f.response.transpose())).rowwise().sum().array()).cwiseMax(1e-9);
}

std::vector<Vector3> without_V(const std::vector<Vector3>& points_m, const VolumetricModel& model) {
  std::vector<Vector3> out;
  for (const Vector3& p : points_m) {
    out.emplace_back(p + model.V_at(p, model.tool_offsets_m().front()));
  }
  return out;
}

std::optional<FeatureResiduals> of_ball(const SeenArtefact& s, std::size_t ball,
                                        const VolumetricModel& model) {
  const std::vector<Vector3> points = without_V(s.ball_points_m[ball], model);
  const auto sphere = fit::fit_sphere(points);
  if (!sphere || points.size() < 5) {
    return std::nullopt;
  }
  FeatureResiduals f{.feature = Feature::Ball, .index = ball};
  const auto n = std::ssize(points);
  Eigen::MatrixXd design(n, 4);
  f.normals.resize(n, 3);
  f.r_m.resize(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vector3 from = points[static_cast<std::size_t>(k)] - sphere->centre;
    f.normals.row(k) = from.normalized().transpose();
    design.row(k) << f.normals.row(k), 1.0;
    f.r_m(k) = from.norm() - sphere->radius;
  }
  finish(f, design);
  return f;
}

/// Unknowns: offset, and the slopes of the face along x and y of its own.
std::optional<FeatureResiduals> of_block(const SeenArtefact& s, std::size_t block,
                                         const VolumetricModel& model) {
  const std::vector<Vector3> points = without_V(s.block_points_m[block], model);
  const auto plane = fit::fit_plane(points, s.blocks[block].normal);
  if (!plane || points.size() < 4) {
    return std::nullopt;
  }
  FeatureResiduals f{.feature = Feature::Block, .index = block};
  const auto n = std::ssize(points);
  const Vector3 x = plane->normal.unitOrthogonal(), y = plane->normal.cross(x);
  Eigen::MatrixXd design(n, 3);
  f.normals = plane->normal.transpose().replicate(n, 1);
  f.r_m.resize(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vector3 from = points[static_cast<std::size_t>(k)] - plane->point;
    design.row(k) << 1.0, x.dot(from), y.dot(from);
    f.r_m(k) = plane->normal.dot(from);
  }
  finish(f, design);
  // Slopes become a change of the normal: -(slope_x x + slope_y y).
  Eigen::MatrixXd normal_change(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    normal_change.col(k) = -(f.response(1, k) * x + f.response(2, k) * y);
  }
  f.response = normal_change;
  return f;
}

std::vector<FeatureResiduals> all_features(const Observations& o, const VolumetricModel& model) {
  std::vector<FeatureResiduals> all;
  const auto add = [&](std::size_t seen, std::optional<FeatureResiduals> f) {
    if (f) {
      f->seen = seen;
      all.push_back(*std::move(f));
    }
  };
  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    for (std::size_t b = 0; b < o.seen[p].balls.size(); ++b) {
      add(p, of_ball(o.seen[p], b, model));
    }
    for (std::size_t b = 0; b < 2; ++b) {
      add(p, of_block(o.seen[p], b, model));
    }
  }
  return all;
}

/// A touch that alone determines a part of its surface has no residual.
constexpr double kLeastFree = 0.05;

/// Median absolute value of one residual over the root of its free share; 1.4826: of normal noise.
double pooled_sigma_m(const std::vector<FeatureResiduals>& all) {
  constexpr double kMadToSigma = 1.4826;
  std::vector<double> values;
  for (const FeatureResiduals& f : all) {
    for (Eigen::Index k = 0; k < f.r_m.size(); ++k) {
      if (f.free(k) >= kLeastFree) {
        values.push_back(std::abs(f.r_m(k)) / std::sqrt(f.free(k)));
      }
    }
  }
  if (values.empty()) {
    return 0.0;
  }
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return kMadToSigma * *middle;
}

std::string place_of(const Observations& o, const FeatureResiduals& f) {
  return message("position ", o.seen[f.seen].position, ", ", f.feature == Feature::Ball ? "ball " : "block ",
                 f.index + 1);
}

/// What a displacement of the touches along their normals does to the errors seen.
Eigen::VectorXd effect_m(const Observations& o, const FeatureResiduals& f, const Eigen::VectorXd& along_m) {
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * o.rows.size()));
  const SeenArtefact& s = o.seen[f.seen];
  const Vector3 change = (f.response * along_m).head<3>();  // of the centre, or of the normal
  const auto balls = s.balls.size();
  Vector3 turn = Vector3::Zero();
  if (f.feature == Feature::Block) {
    const Vector3 &n1 = s.blocks[0].normal, &n2 = s.blocks[1].normal;
    const Vector3 z = s.T_self_uni.R.col(2), y = s.T_self_uni.R.col(1);
    const Vector3 dn1 = f.index == 0 ? change : Vector3(Vector3::Zero());
    const Vector3 dn2 = f.index == 1 ? change : Vector3(Vector3::Zero());
    turn = z.cross(dn1) + z * y.dot((dn2.cross(z) + n2.cross(dn1)) / n2.cross(n1).norm());
  }
  for (std::size_t i = 1; i < balls; ++i) {
    auto row = rows.segment<3>(static_cast<Eigen::Index>(3 * (f.seen * balls + i)));
    if (f.feature == Feature::Block) {
      row = turn.cross(s.ideal_m[i] - s.ideal_m.front());
    } else if (f.index == 0 || f.index == i) {
      row = f.index == 0 ? change : Vector3(-change);
    }
  }
  return rows;
}

/// The most significant touch, and whether the others of its feature lie well without it.
std::optional<TouchFinding> worst_touch(const Observations& o, const std::vector<FeatureResiduals>& all,
                                        double sigma_m, double false_alarm) {
  const FeatureResiduals* worst = nullptr;
  Eigen::Index touch = 0;
  double w = 0.0, touches = 0.0;
  for (const FeatureResiduals& f : all) {
    touches += static_cast<double>(f.r_m.size());
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
  // Two-sided tail of the normal distribution: below exp(-w^2 / 2).
  if (worst == nullptr || !(0.5 * w * w > natural_logarithm(touches / false_alarm))) {
    return std::nullopt;
  }
  const FeatureResiduals& f = *worst;
  const double size_m = f.r_m(touch) / f.free(touch);
  const double rest_m2 = f.r_m.squaredNorm() - f.r_m(touch) * size_m;
  const double x = natural_logarithm(static_cast<double>(all.size()) / false_alarm);
  if (rest_m2 > sigma_m * sigma_m * chi2_bound(std::max(0.0, f.dof() - 1.0), x)) {
    return std::nullopt;  // not one touch
  }
  const Eigen::VectorXd along = size_m * Eigen::VectorXd::Unit(f.r_m.size(), touch);
  return TouchFinding{
      .cause = Cause::Touch,
      .text = message(place_of(o, f), ": touch ", touch + 1, " of ", f.r_m.size(), " lies ", size_m * kUmPerM,
                      " um off the surface of the others (noise of a touch ", sigma_m * kUmPerM,
                      " um): dirt or a false trigger; clean and touch there again"),
      .log_likelihood = 0.5 * w * w,
      .rows_m = effect_m(o, f, along)};
}

std::optional<TouchFinding> worst_form(const Observations& o, const std::vector<FeatureResiduals>& all,
                                       double sigma_m, double false_alarm) {
  const FeatureResiduals* worst = nullptr;
  double excess = 0.0;
  for (const FeatureResiduals& f : all) {
    const double chi2 = f.r_m.squaredNorm() / (sigma_m * sigma_m);
    if (chi2 - f.dof() > excess) {
      worst = &f, excess = chi2 - f.dof();
    }
  }
  const double x = natural_logarithm(static_cast<double>(all.size()) / false_alarm);
  if (worst == nullptr || !(excess + worst->dof() > chi2_bound(worst->dof(), x))) {
    return std::nullopt;
  }
  const double rms_m = std::sqrt(worst->r_m.squaredNorm() / std::max(1.0, worst->dof()));
  return TouchFinding{.cause = Cause::Form,
                      .text = message(place_of(o, *worst), ": its touches scatter by ", rms_m * kUmPerM,
                                      " um, those of other features by ", sigma_m * kUmPerM,
                                      " um: the array moved while it was touched, or its surface is dirty"),
                      .log_likelihood = 0.5 * excess,
                      .rows_m = {}};
}

/// Readings differ by b_a between the two directions of axis a: |n_a| b_a / 2 along the normal.
std::optional<TouchFinding> backlash(const Observations& o, const std::vector<FeatureResiduals>& all,
                                     double sigma_m, double false_alarm) {
  Matrix3 N = Matrix3::Zero();
  Vector3 g = Vector3::Zero();
  for (const FeatureResiduals& f : all) {
    if (f.feature != Feature::Ball) {
      continue;
    }
    const Eigen::MatrixXd half = 0.5 * f.normals.cwiseAbs();
    Eigen::MatrixXd design(half.rows(), 4);
    design << f.normals, Eigen::VectorXd::Ones(half.rows());
    const Eigen::MatrixXd free = half - design * (f.response * half);
    N += free.transpose() * free;
    g += free.transpose() * f.r_m;
  }
  // Directions that the touches hardly tell from radius and place count as none.
  constexpr double kShown = 0.02;
  Eigen::CompleteOrthogonalDecomposition<Matrix3> shown;
  shown.setThreshold(kShown);
  shown.compute(N);
  const Vector3 b = shown.solve(g);
  const double drop = g.dot(b) / (sigma_m * sigma_m);
  if (!(drop > chi2_bound(3.0, natural_logarithm(1.0 / false_alarm)))) {
    return std::nullopt;
  }
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * o.rows.size()));
  for (const FeatureResiduals& f : all) {
    if (f.feature == Feature::Ball) {
      rows += effect_m(o, f, 0.5 * f.normals.cwiseAbs() * b);
    }
  }
  return TouchFinding{
      .cause = Cause::Backlash,
      .text = message("the touches depend on the side they come from: backlash of X ", b.x() * kUmPerM,
                      ", Y ", b.y() * kUmPerM, ", Z ", b.z() * kUmPerM, " um, or a probe with lobes"),
      .log_likelihood = 0.5 * drop,
      .rows_m = std::move(rows)};
}

}  // namespace

TouchResiduals touch_residuals(const Observations& o, const VolumetricModel& model, double false_alarm) {
  const std::vector<FeatureResiduals> all = all_features(o, model);
  TouchResiduals found;
  found.sigma_m = pooled_sigma_m(all);
  if (!(found.sigma_m > 0.0)) {
    return found;
  }
  double squares = 0.0, count = 0.0;
  for (const FeatureResiduals& f : all) {
    if (f.feature == Feature::Ball) {
      squares += f.response.topRows(3).squaredNorm() / 3.0;
      count += 1.0;
    }
  }
  found.s_centre_m = found.sigma_m * std::sqrt(squares / std::max(1.0, count));
  const auto add = [&](std::optional<TouchFinding> finding) {
    if (finding) {
      found.findings.push_back(*std::move(finding));
    }
  };
  auto touch = worst_touch(o, all, found.sigma_m, false_alarm);
  if (!touch) {  // else its ball or block scatters because of it
    add(worst_form(o, all, found.sigma_m, false_alarm));
  }
  add(std::move(touch));
  add(backlash(o, all, found.sigma_m, false_alarm));
  return found;
}

}  // namespace abbe::calib::evemu
