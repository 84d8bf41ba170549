#pragma once
/// Simulated studies of the ball array: the reference layout, a machine with known errors, errors
/// computed from the truth with noise, and the remaining error of a model. Readings solve
///
///   true position = reading + V(reading)

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "abbe/calib/evemu/solve/solve.hpp"
#include "evemu_run.hpp"

namespace abbe::tests::evemu {

using Field = std::function<Vector3(const Vector3& reading_m)>;

/// Table 3 of [Li OMM], shifted so that V(Ball1) = 0.
inline Field table3_machine() {
  const auto model = *calib::EquivalentModel::of(reference_machine().chain, 3);
  const Eigen::VectorXd beta = reference_coefficients("true");
  const Vector3 ball1_mm(-90, 140, 30);
  const Vector3 at_ball1 = model.X(ball1_mm) * beta;
  return
      [=](const Vector3& q_m) -> Vector3 { return (model.X(1000 * q_m) * beta - at_ball1) / 1000; };
}

struct Layout {
  std::vector<std::vector<Vector3>> true_m;  ///< by position, by ball
};
/// `tilt_scale` 1: the reference layout; 0: all balls in one plane.
inline Layout reference_layout(double tilt_scale = 1.0) {
  const auto all = reference_json("solutions.json");
  const double deg = std::numbers::pi / 180;
  Layout layout;

  for (const auto& p : all["pos_fan_tilt_roll_deg"]) {
    const double fan = p[0].get<double>() * deg, tilt = tilt_scale * p[1].get<double>() * deg,
                 roll = tilt_scale * p[2].get<double>() * deg;
    const calib::Matrix3 R =
        (Eigen::AngleAxisd(fan, Vector3::UnitZ()) * Eigen::AngleAxisd(-tilt, Vector3::UnitY()) *
         Eigen::AngleAxisd(roll, Vector3::UnitX()))
            .toRotationMatrix();
    layout.true_m.emplace_back();
    for (const auto& ball : all["balls"]) {
      layout.true_m.back().emplace_back((vector3(all["ball1"]) + R * vector3(ball)) / 1000);
    }
  }

  return layout;
}

struct Noise {
  double s_m = 0.0;    ///< standard deviation of a ball centre, per coordinate
  double w_rad = 0.0;  ///< random rotation of a position, per axis
};

inline Vector3 reading_of(const Field& V, const Vector3& true_m) {
  Vector3 reading = true_m;
  for (int i = 0; i < 20; ++i) {
    reading = true_m - V(reading);
  }
  return reading;
}

inline calib::evemu::Observations simulated(const Layout& layout, const Field& V,
                                            const Noise& noise, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) {
    const double x = sigma * normal(random), y = sigma * normal(random), z = sigma * normal(random);
    return Vector3(x, y, z);
  };

  std::vector<calib::evemu::BallError> errors;
  for (std::size_t p = 0; p < layout.true_m.size(); ++p) {
    const Vector3 omega = draw(noise.w_rad);
    Vector3 first = Vector3::Zero();
    for (std::size_t b = 0; b < layout.true_m[p].size(); ++b) {
      const Vector3& truth = layout.true_m[p][b];
      const Vector3 reading = reading_of(V, truth) + draw(noise.s_m);
      const Vector3 off = truth - reading;
      first = b == 0 ? off : first;
      errors.push_back({static_cast<int>(p) + 1, static_cast<int>(b) + 1, reading,
                        off - first + omega.cross(truth - layout.true_m[p][0])});
    }
  }

  calib::evemu::ObserveOptions options;
  options.least_thickness = 0.0;
  return *calib::evemu::observe_errors(errors, reference_machine(),
                                       calib::evemu::RotationOrigin::Independent, options);
}

/// Points at multiples of (100/3, 50/3, 10/3) mm inside the hull of the balls, at least as far from
/// Ball1 as Ball2 is.
inline std::vector<Vector3> evaluation_grid(const calib::ValidityVolume& hull,
                                            const Layout& layout = reference_layout()) {
  const auto box = calib::bounding_box(hull.vertices_m());
  const Vector3 step(0.1 / 3, 0.05 / 3, 0.01 / 3);
  const Vector3 low = (box.centre_m - box.half_width_m).cwiseQuotient(step),
                high = (box.centre_m + box.half_width_m).cwiseQuotient(step);
  const Vector3& ball1_m = layout.true_m[0][0];
  const double nearest_m = (layout.true_m[0][1] - ball1_m).norm();
  std::vector<Vector3> grid;

  for (int i = static_cast<int>(std::ceil(low.x())); i <= high.x(); ++i) {
    for (int j = static_cast<int>(std::ceil(low.y())); j <= high.y(); ++j) {
      for (int k = static_cast<int>(std::ceil(low.z())); k <= high.z(); ++k) {
        const Vector3 p = step.cwiseProduct(Vector3(i, j, k));
        if (hull.contains(p) && (p - ball1_m).norm() >= nearest_m) {
          grid.push_back(p);
        }
      }
    }
  }

  return grid;
}

/// The same points inside the hull of the balls of a layout.
inline std::vector<Vector3> hull_grid(const Layout& layout) {
  std::vector<Vector3> balls;
  for (const auto& position : layout.true_m) {
    balls.insert(balls.end(), position.begin(), position.end());
  }
  return evaluation_grid(*calib::ValidityVolume::hull_of(balls), layout);
}

/// The points of the reference layout, independent of the measured layout.
inline std::vector<Vector3> reference_grid() {
  return hull_grid(reference_layout());
}

struct Remaining {
  double mean_R = 0.0, max_R = 0.0;  ///< R_resmag = |V - V_model| / |V|
  double rms_m = 0.0;                ///< of |V - V_model|
};
inline Remaining remaining(const Field& V, const Field& model, const std::vector<Vector3>& grid) {
  Remaining r;
  for (const Vector3& p : grid) {
    const Vector3 truth = V(p);
    const double left = (truth - model(p)).norm(), R = left / truth.norm();
    r.mean_R += R / static_cast<double>(grid.size());
    r.max_R = std::max(r.max_R, R);
    r.rms_m += left * left / static_cast<double>(grid.size());
  }
  r.rms_m = std::sqrt(r.rms_m);
  return r;
}

/// V of a solution, and of its coefficients before V(Ball1) = 0 was set.
inline Field field_of(const calib::evemu::Solution& s) {
  const calib::PolynomialModel model = *s.model.polynomials();
  return [model](const Vector3& q) { return model.V_at(q); };
}
inline Field raw_field_of(const calib::evemu::Solution& s) {
  const auto& m = *s.model.polynomials();
  const auto raw =
      *calib::PolynomialModel::of(m.design(), m.ball1_m(), s.raw_c_m, m.covariance_m2());
  return [raw](const Vector3& q) { return raw.V_at(q); };
}

/// `model` after removal of the rotation about Ball1 that fits it best to `truth`.
inline Field turned_to(const Field& truth, const Field& model, const std::vector<Vector3>& grid) {
  const Vector3 ball1(-0.09, 0.14, 0.03);
  calib::Matrix3 N = calib::Matrix3::Zero();
  Vector3 g = Vector3::Zero();
  for (const Vector3& p : grid) {
    const calib::Matrix3 E = calib::rotation_effect(p - ball1);
    N += E.transpose() * E;
    g += E.transpose() * (truth(p) - model(p));
  }
  const Vector3 omega = N.ldlt().solve(g);
  return [=](const Vector3& q) -> Vector3 { return model(q) + omega.cross(q - ball1); };
}

}  // namespace abbe::tests::evemu
