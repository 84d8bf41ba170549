#include <Eigen/Eigenvalues>
#include <cmath>
#include <span>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/mfb/run/bar.hpp"

namespace abbe::calib::mfb {
namespace {

tl::unexpected<Error> bad_bar(const std::string& what) {
  return failure(ErrorCode::BadInput, "bar: " + what);
}

bool all_finite(std::span<const double> values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)).allFinite();
}

Result<void> check_finite(const TouchPattern& p) {
  for (const auto* list :
       {&p.hole_x_m, &p.hole_y_m, &p.rod_x_m, &p.hole_levels_m, &p.hole_angles_rad,
        &p.rod_sections_m, &p.rod_angles_rad, &p.plane_dx_m, &p.plane_dz_m}) {
    if (!all_finite(*list)) {
      return failure(ErrorCode::NotFinite, "bar: a number of the pattern is not a number");
    }
  }
  return {};
}

/// Checks that holes and rods alternate along x, beginning with a hole at 0.
Result<void> check_order(const TouchPattern& p) {
  if (p.holes() < 3 || p.hole_y_m.size() != p.holes() || p.rod_x_m.size() + 1 != p.holes()) {
    return bad_bar(message(p.holes(), " holes with ", p.hole_y_m.size(), " shifts and ",
                           p.rod_x_m.size(), " rods; N holes, at least 3, have N - 1 rods"));
  }
  if (p.hole_x_m.front() != 0.0) {
    return bad_bar(message("hole 1 is at x = ", kMmPerM * p.hole_x_m.front(), " mm, must be at 0"));
  }
  for (std::size_t j = 0; j < p.rod_x_m.size(); ++j) {
    if (!(p.hole_x_m[j] < p.rod_x_m[j] && p.rod_x_m[j] < p.hole_x_m[j + 1])) {
      return bad_bar(message(rod_name(j), " is at x = ", kMmPerM * p.rod_x_m[j],
                             " mm, not between ", hole_name(j), " and ", hole_name(j + 1)));
    }
  }
  if (p.hole_y_m.front() != 0.0 || p.hole_y_m.back() != 0.0) {
    return bad_bar("the first and the last hole must have the shift 0, they define the x axis");
  }
  return {};
}

Result<void> check_sizes(const TouchPattern& p) {
  for (const auto& [value_m, what] : {std::pair{p.hole_radius_m, "radius of the holes"},
                                      std::pair{p.rod_radius_m, "radius of the rods"},
                                      std::pair{p.plane_y_m, "distance of the planes"}}) {
    if (!(value_m > 0.0) || !std::isfinite(value_m)) {
      return bad_bar(message("the ", what, " is ", kMmPerM * value_m, " mm, must be positive"));
    }
  }
  for (const auto& [feature, fewest, what] :
       {std::tuple{Feature::Hole, 5u, "hole"}, std::tuple{Feature::Rod, 5u, "rod"},
        std::tuple{Feature::Plane, 3u, "plane"}}) {
    if (p.touches_of(feature) < fewest) {
      return bad_bar(message(p.touches_of(feature), " touches of a ", what,
                             " do not determine it, at least ", fewest, " are needed"));
    }
  }
  if (p.hole_levels_m.size() < 2 || p.rod_sections_m.size() < 2) {
    return bad_bar("the axis of a hole or rod needs touches at two levels or sections");
  }
  return {};
}

Result<void> check_points(const Bar& bar) {
  constexpr double kBesidePattern_m = 1e-3;
  if (bar.O_m.size() != bar.pattern.holes()) {
    return bad_bar(
        message(bar.O_m.size(), " calibrated points for ", bar.pattern.holes(), " holes"));
  }
  for (std::size_t i = 0; i < bar.O_m.size(); ++i) {
    const Vector3 nominal(bar.pattern.hole_x_m[i], bar.pattern.hole_y_m[i], 0.0);
    if (!bar.O_m[i].allFinite()) {
      return failure(ErrorCode::NotFinite,
                     message("bar: ", hole_name(i), ": the calibrated point is not a number"));
    }
    if (!((bar.O_m[i] - nominal).norm() <= kBesidePattern_m)) {
      return bad_bar(message(hole_name(i), ": the calibrated point ", mm_text(bar.O_m[i]),
                             " is more than 1 mm beside the pattern"));
    }
  }
  if (!bar.O_m.front().isZero(0.0) || !bar.O_m.back().tail<2>().isZero(0.0)) {
    return bad_bar(
        "hole 1 must be (0, 0, 0), and y and z of the last hole 0: they define the axes");
  }
  return {};
}

Result<void> check_calibration(const Bar& bar) {
  const Eigen::MatrixXd& C = bar.covariance_m2;
  const auto n = 3 * std::ssize(bar.O_m);
  if (C.rows() != n || C.cols() != n) {
    return bad_bar(message("covariance of the calibration is ", C.rows(), " x ", C.cols(),
                           ", must be ", n, " x ", n));
  }
  if (!C.allFinite()) {
    return failure(ErrorCode::NotFinite, "bar: covariance of the calibration is not a number");
  }
  if (!C.isApprox(C.transpose(), 1e-9)) {
    return bad_bar("covariance of the calibration is not symmetric");
  }

  constexpr double kRounding = 1e-9;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(C, Eigen::EigenvaluesOnly);
  const double least = eigen.eigenvalues()(0), most = eigen.eigenvalues()(n - 1);
  if (least < -kRounding * most || most < 0.0) {
    return bad_bar(message("covariance of the calibration has the negative eigenvalue ",
                           least * kUmPerM * kUmPerM, " um^2"));
  }
  return {};
}

Result<void> check_expansion_and_sag(const Bar& bar) {
  if (bar.expansion &&
      (!std::isfinite(bar.expansion->alpha_per_K) || !(bar.expansion->u_alpha_per_K >= 0.0))) {
    return bad_bar("alpha and its uncertainty must be numbers, the uncertainty not negative");
  }
  if (!bar.sag) {
    return {};
  }
  const Sag& s = *bar.sag;
  const bool possible = s.beam_x_m[0] < s.beam_x_m[1] && s.supports_m[0] < s.supports_m[1] &&
                        s.beam_x_m[0] <= s.supports_m[0] && s.supports_m[1] <= s.beam_x_m[1] &&
                        s.section_yz_m[0] > 0.0 && s.section_yz_m[1] > 0.0 &&
                        s.density_kg_per_m3 >= 0.0 && s.youngs_modulus_Pa > 0.0;
  return possible ? Result<void>{}
                  : bad_bar(
                        "sag: the supports must be on the beam, in the order of x; section and "
                        "modulus positive");
}

}  // namespace

Result<void> check(const Bar& bar) {
  return check_finite(bar.pattern)
      .and_then([&] { return check_order(bar.pattern); })
      .and_then([&] { return check_sizes(bar.pattern); })
      .and_then([&] { return check_points(bar); })
      .and_then([&] { return check_calibration(bar); })
      .and_then([&] { return check_expansion_and_sag(bar); });
}

}  // namespace abbe::calib::mfb
