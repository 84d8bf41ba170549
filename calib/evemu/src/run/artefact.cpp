#include "abbe/calib/evemu/run/artefact.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/fit/point_set.hpp"

namespace abbe::calib::evemu {
namespace {

tl::unexpected<Error> broken(const Calibrator& c, ErrorCode code, const std::string& what) {
  return failure(code, message("calibrator \"", c.name, "\": ", what));
}

Result<void> check_balls(const Calibrator& c) {
  constexpr std::size_t kLeastBalls = 4;
  if (c.balls.size() < kLeastBalls) {
    return broken(c, ErrorCode::BadInput, message(c.balls.size(), " balls, needs ", kLeastBalls));
  }

  for (std::size_t i = 0; i < c.balls.size(); ++i) {
    const Calibrator::Ball& ball = c.balls[i];
    if (ball.number != static_cast<int>(i) + 1) {
      return broken(c, ErrorCode::BadInput,
                    message("ball number ", ball.number, " instead of ", i + 1));
    }
    if (!ball.centre_m.allFinite() || !std::isfinite(ball.u_m)) {
      return broken(c, ErrorCode::NotFinite,
                    message("ball ", ball.number, ": centre or uncertainty is not a number"));
    }
    if (!(ball.radius_m > 0.0) || ball.u_m < 0.0) {
      return broken(
          c, ErrorCode::BadInput,
          message("ball ", ball.number, " has radius ", ball.radius_m, " m, u = ", ball.u_m, " m"));
    }
    for (std::size_t j = 0; j < i; ++j) {
      if ((ball.centre_m - c.balls[j].centre_m).norm() < ball.radius_m + c.balls[j].radius_m) {
        return broken(c, ErrorCode::BadInput, message("balls ", j + 1, " and ", i + 1, " overlap"));
      }
    }
  }

  return {};
}

Result<void> check_blocks(const Calibrator& c) {
  if (c.blocks.size() != 2 || c.blocks[0].number != 1 || c.blocks[1].number != 2) {
    return broken(c, ErrorCode::BadInput,
                  message("needs two blocks, numbered 1 and 2; has ", c.blocks.size()));
  }

  for (const Calibrator::Block& block : c.blocks) {
    if (!block.normal.allFinite() || !(block.normal.norm() > 0.0)) {
      return broken(c, ErrorCode::NotFinite, message("block ", block.number, " has no direction"));
    }
    if (!std::isfinite(block.u_rad) || block.u_rad < 0.0) {
      return broken(c, ErrorCode::BadInput,
                    message("block ", block.number, " has u = ", block.u_rad, " rad"));
    }
  }

  return uniform_frame(Vector3::Zero(), c.blocks[0].normal, c.blocks[1].normal)
      .map([](const RigidTransform&) {});
}

Result<void> check_expansivity(const Calibrator& c) {
  if (!c.expansivity) {
    return {};
  }
  const auto& [alpha_per_K, u_alpha_per_K] = *c.expansivity;
  if (!std::isfinite(alpha_per_K) || !(u_alpha_per_K >= 0.0) || !std::isfinite(u_alpha_per_K)) {
    return broken(c, ErrorCode::NotFinite,
                  message("thermal expansion ", alpha_per_K, " per K, u = ", u_alpha_per_K));
  }
  return {};
}

/// Uncertainty of a touch for a fit without residuals (as many touches as unknowns): `u_touch_m`.
/// nullopt if there are more touches, because the fit then computes the uncertainty from the
/// residuals.
Result<std::optional<double>> noise_of(std::size_t touches, std::size_t unknowns,
                                       std::optional<double> u_touch_m) {
  if (touches != unknowns) {
    return std::optional<double>{};
  }
  if (!u_touch_m || !(*u_touch_m > 0.0) || !std::isfinite(*u_touch_m)) {
    return failure(ErrorCode::TooFewObservations,
                   message(touches,
                           " touches do not show their own uncertainty: add at least one touch, or "
                           "state the uncertainty of a touch"));
  }
  return u_touch_m;
}

}  // namespace

Calibrator at_temperature(const Calibrator& c, const Expansion& expansion) {
  const double factor = expansion_factor(expansion);
  Calibrator out = c;
  for (Calibrator::Ball& ball : out.balls) {
    ball.centre_m = c.balls.front().centre_m + factor * (ball.centre_m - c.balls.front().centre_m);
    ball.radius_m *= factor;
  }
  return out;
}

double ArtefactUncertainty::u_scale() const {
  return expansion ? u_expansion_factor(*expansion) / expansion_factor(*expansion) : 0.0;
}

bool ArtefactUncertainty::none() const {
  const auto exact = [](double u) { return u == 0.0; };
  return std::all_of(u_ball_m.begin(), u_ball_m.end(), exact) &&
         std::all_of(u_block_rad.begin(), u_block_rad.end(), exact) && exact(u_scale());
}

ArtefactUncertainty uncertainty_of(const Calibrator& c, const std::optional<Expansion>& expansion) {
  ArtefactUncertainty u;
  for (const Calibrator::Ball& ball : c.balls) {
    u.u_ball_m.push_back(ball.u_m);
  }
  u.u_block_rad = {c.blocks[0].u_rad, c.blocks[1].u_rad};
  u.cosine_between_blocks = c.blocks[0].normal.normalized().dot(c.blocks[1].normal.normalized());
  u.expansion = expansion;
  return u;
}

Result<RigidTransform> uniform_frame(const Vector3& ball1_m, const Vector3& n1, const Vector3& n2) {
  const Vector3 z = n1.normalized(), across = n2.normalized().cross(z);
  // Faces meet near a right angle. If the sine of their angle is smaller than this, the rotation of
  // the plate about z is poorly determined.
  constexpr double kParallel = 1e-3;
  if (!(across.norm() > kParallel)) {
    return failure(ErrorCode::DegenerateGeometry,
                   "uniform coordinate system: the normals of the two blocks are parallel");
  }

  const Vector3 x = across.normalized();
  RigidTransform T;
  T.R << x, z.cross(x), z;
  T.t_m = ball1_m;

  return T;
}

Result<void> check(const Calibrator& c) {
  if (!std::isfinite(c.tip_radius_m) || c.tip_radius_m < 0.0) {
    return broken(c, ErrorCode::BadInput, message("tip radius ", c.tip_radius_m, " m"));
  }

  if (Result<void> balls = check_balls(c); !balls) {
    return balls;
  }

  if (Result<void> expansivity = check_expansivity(c); !expansivity) {
    return expansivity;
  }

  std::vector<Vector3> centres;
  for (const Calibrator::Ball& ball : c.balls) {
    centres.push_back(ball.centre_m);
  }

  const Result<fit::PointSet> set = fit::point_set(centres, 3, "calibrator");
  if (!set || set->on_a_line()) {
    return broken(c, ErrorCode::DegenerateGeometry, "its balls lie on a line");
  }

  return check_blocks(c);
}

Result<Calibrator> precalibrated(std::string name, std::span<const Touch> touches,
                                 double tip_radius_m, const std::array<Vector3, 2>& outward,
                                 std::optional<double> u_touch_m) {
  constexpr std::size_t kBallUnknowns = 4, kBlockUnknowns = 3;
  std::map<int, std::vector<Vector3>> balls, blocks;
  for (const Touch& t : touches) {
    (t.feature == Feature::Ball ? balls : blocks)[t.number].push_back(t.p_m);
  }

  Calibrator c;
  c.name = std::move(name);
  c.tip_radius_m = tip_radius_m;

  for (const auto& [number, points] : balls) {
    const Result<fit::Sphere> sphere =
        noise_of(points.size(), kBallUnknowns, u_touch_m)
            .and_then([&, &seen = points](std::optional<double> known) {
              return fit::fit_sphere(seen, known);
            });
    if (!sphere) {
      return broken(c, sphere.error().code, message("ball ", number, ": ", sphere.error().text));
    }
    const double u_centre_m = std::sqrt(sphere->covariance.topLeftCorner<3, 3>().trace() / 3.0);
    c.balls.push_back({number, sphere->centre, sphere->radius - tip_radius_m, u_centre_m});
  }

  for (const auto& [number, points] : blocks) {
    if (number != 1 && number != 2) {
      return broken(c, ErrorCode::BadInput, message("there is no block ", number));
    }
    const Vector3& towards = outward[static_cast<std::size_t>(number) - 1];
    const Result<fit::Plane> plane =
        noise_of(points.size(), kBlockUnknowns, u_touch_m)
            .and_then([&, &seen = points](std::optional<double> known) {
              return fit::fit_plane(seen, towards, known);
            });
    if (!plane) {
      return broken(c, plane.error().code, message("block ", number, ": ", plane.error().text));
    }
    c.blocks.push_back({number, plane->normal, std::sqrt(plane->cov_normal.trace() / 2.0)});
  }

  return check(c).map([&] { return c; });
}

}  // namespace abbe::calib::evemu
