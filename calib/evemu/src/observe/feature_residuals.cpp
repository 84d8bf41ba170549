#include "observe/feature_residuals.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::evemu {
namespace {

/// Sets f.response and f.free. `design`: effect of the unknowns of the surface on the residuals,
/// touches x unknowns.
void finish(FeatureResiduals& f, const Eigen::MatrixXd& design) {
  f.response =
      design.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(design.rows(), design.rows()));
  f.free =
      (1.0 - (design.cwiseProduct(f.response.transpose())).rowwise().sum().array()).cwiseMax(1e-9);
}

std::vector<Vector3> without_V(const std::vector<Vector3>& points_m, const VolumetricModel& model) {
  std::vector<Vector3> out;
  for (const Vector3& p : points_m) {
    out.emplace_back(p + model.V_at(p, model.tool_offsets_m().front()));
  }
  return out;
}

std::optional<FeatureResiduals> of_ball(const TouchedArtefact& s, std::size_t ball,
                                        const VolumetricModel& model) {
  const std::vector<Vector3> points = without_V(s.ball_points_m[ball], model);
  const auto sphere = fit::fit_sphere(points);
  if (!sphere) {
    return std::nullopt;
  }

  FeatureResiduals f{.feature = Feature::Ball,
                     .index = ball,
                     .points_m = points,
                     .centre_m = sphere->centre,
                     .radius_m = sphere->radius};
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

/// Residuals of a face. Unknowns of the fit: offset of the face, and its slopes along two
/// directions x and y in the face.
std::optional<FeatureResiduals> of_block(const TouchedArtefact& s, std::size_t block,
                                         const VolumetricModel& model) {
  const std::vector<Vector3> points = without_V(s.block_points_m[block], model);
  const auto plane = fit::fit_plane(points, s.blocks[block].normal);
  if (!plane) {
    return std::nullopt;
  }

  FeatureResiduals f{.feature = Feature::Block, .index = block, .points_m = points};
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
  // The slopes are converted to a change of the normal: -(slope_x x + slope_y y).
  Eigen::MatrixXd normal_change(3, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    normal_change.col(k) = -(f.response(1, k) * x + f.response(2, k) * y);
  }

  f.response = normal_change;
  return f;
}

std::string place_of(const Observations& o, std::size_t seen, Feature feature, std::size_t index) {
  return message("position ", o.seen[seen].position, ", ",
                 feature == Feature::Ball ? "ball " : "block ", index + 1);
}

}  // namespace

Features all_features(const Observations& o, const VolumetricModel& model) {
  constexpr std::size_t kUnknownsOfBall = 4, kUnknownsOfBlock = 3;
  Features all;
  const auto add = [&](std::size_t seen, Feature feature, std::size_t index,
                       std::optional<FeatureResiduals> f) {
    if (!f || !f->r_m.allFinite() || !f->response.allFinite()) {
      all.failed.push_back(place_of(o, seen, feature, index));
      return;
    }
    f->seen = seen;
    all.compared.push_back(*std::move(f));
  };

  for (std::size_t p = 0; p < o.seen.size(); ++p) {
    const TouchedArtefact& s = o.seen[p];
    for (std::size_t b = 0; b < std::min(s.balls.size(), s.ball_points_m.size()); ++b) {
      if (s.ball_points_m[b].size() > kUnknownsOfBall) {
        add(p, Feature::Ball, b, of_ball(s, b, model));
      }
    }
    for (std::size_t b = 0; b < 2; ++b) {
      if (s.block_points_m[b].size() > kUnknownsOfBlock) {
        add(p, Feature::Block, b, of_block(s, b, model));
      }
    }
  }

  return all;
}

double centre_noise_m(const std::vector<FeatureResiduals>& all, double sigma_m) {
  double squares = 0.0, count = 0.0;
  for (const FeatureResiduals& f : all) {
    if (f.feature == Feature::Ball) {
      squares += f.response.topRows(3).squaredNorm() / 3.0;
      count += 1.0;
    }
  }
  return sigma_m * std::sqrt(squares / std::max(1.0, count));
}

double pooled_sigma_m(const std::vector<FeatureResiduals>& all) {
  std::vector<double> values;
  for (const FeatureResiduals& f : all) {
    for (Eigen::Index k = 0; k < f.r_m.size(); ++k) {
      if (f.free(k) >= kLeastFree) {
        values.push_back(std::abs(f.r_m(k)) / std::sqrt(f.free(k)));
      }
    }
  }

  return kMadToSigma * median(values);
}

std::string place_of(const Observations& o, const FeatureResiduals& f) {
  return place_of(o, f.seen, f.feature, f.index);
}

Eigen::VectorXd effect_m(const Observations& o, const FeatureResiduals& f,
                         const Eigen::VectorXd& along_m) {
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * o.rows.size()));
  const TouchedArtefact& s = o.seen[f.seen];
  const Vector3 change = (f.response * along_m).head<3>();  // change of the ball centre or of the
                                                            // face normal
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

}  // namespace abbe::calib::evemu
