#include "abbe/calib/internal/otf/solve/simultaneous.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "solve/change_in_u.hpp"
#include "solve/datum_of.hpp"
#include "solve/priors.hpp"

namespace abbe::calib::otf {
namespace {

/// Rotation matrix for a small rotation vector, exact up to the second order:
///     I + 2 / (1 + a^2) ([a]_x + [a]_x^2),   a = rotation / 2   (Rodrigues)
/// It is orthogonal for any a. It uses only sums, products and a division, and thus gives the same
/// bits on every processor.
Matrix3 small_rotation(const Vector3& rotation_rad) {
  const Vector3 a = 0.5 * rotation_rad;
  const Matrix3 cross = rotation_effect(a).transpose();
  return Matrix3::Identity() + 2.0 / (1.0 + a.squaredNorm()) * (cross + cross * cross);
}

/// The errors of the machine along one leg.
class ErrorsOnLeg {
 public:
  ErrorsOnLeg(const Observations& o, const Eigen::VectorXd& U, std::size_t leg)
      : o_(o),
        U_(U.data(), o.basis.size()),
        leg_(leg),
        from_m_(o.vertices_m[leg]),
        to_m_(o.vertices_m[leg + 1]) {}

  /// Nominal axis position at which the machine was when the target was measured at `p_m` (target
  /// offset subtracted).
  [[nodiscard]] Vector3 nominal_m(const Vector3& p_m) const {
    constexpr int kRepeats = 2;  // each repetition reduces the error by the slope of V, 1e-3
    Vector3 c = closest_on_leg(from_m_, to_m_, p_m).closest_m;
    for (int i = 0; i < kRepeats; ++i) {
      c = closest_on_leg(from_m_, to_m_, p_m - V_m(c)).closest_m;
    }
    return c;
  }

  /// Direction of travel of the target at c: direction of the leg plus the slope of V.
  [[nodiscard]] Vector3 travel(const Vector3& c_m) const {
    constexpr double kStep_m = 1e-3;  // short compared with the distance of the nodes
    const Vector3 d = (to_m_ - from_m_).normalized();
    return d + (V_m(c_m + kStep_m * d) - V_m(c_m - kStep_m * d)) / (2.0 * kStep_m);
  }

 private:
  [[nodiscard]] Vector3 V_m(const Vector3& q_m) const {
    return o_.basis.V_m(o_.state_on(leg_, q_m), U_);
  }

  const Observations& o_;
  std::span<const double> U_;
  std::size_t leg_;
  const Vector3 &from_m_, &to_m_;
};

void append_segment(Observations& o, const Eigen::VectorXd& U, const SegmentSeries& series,
                    std::size_t i, const Noise& noise, std::vector<Vector3>& sub_points_m) {
  const std::size_t leg = o.alignment.leg[i];
  const ErrorsOnLeg errors(o, U, leg);
  const RigidTransform& T = o.alignment.T_machine_tracker;
  const Segment& segment = series.segments[i];

  sub_points_m.clear();
  for (std::size_t k = 0; k < series.sub_points; ++k) {
    const Vector3& p = series.sub_points_tracker_m[segment.first_sub_point + k];
    sub_points_m.push_back(errors.nominal_m(T * p - o.target_offset_m));
  }

  const Vector3 p_m = T * segment.mean_tracker_m - o.target_offset_m;
  const Vector3 c_m = errors.nominal_m(p_m);
  append_rows(
      o,
      {leg, i, p_m - c_m, c_m, path_frame(errors.travel(c_m), T.R * segment.mean_tracker_m, noise),
       segment.effective_samples()},
      sub_points_m);
}

}  // namespace

Observations linearised_at(Observations o, const Eigen::VectorXd& U, const SegmentSeries& series,
                           const Noise& noise) {
  const Vector6 rigid = U.segment<kRigidUnknowns>(static_cast<Eigen::Index>(o.rigid_offset()));
  const Matrix3 back = small_rotation(-rigid.tail<3>());
  RigidTransform& T = o.alignment.T_machine_tracker;
  T = {back * T.R, back * (T.t_m - rigid.head<3>())};

  o.A = {};
  o.rows.clear();
  o.sub_points_m.clear();
  std::vector<Vector3> sub_points_m;
  for (std::size_t i = 0; i < series.segments.size(); ++i) {
    if (o.alignment.used[i]) {
      append_segment(o, U, series, i, noise, sub_points_m);
    }
  }

  return o;
}

Result<ObservationsAtSolution> linearise_at_solution(Observations o, const SegmentSeries& series,
                                                     const Noise& noise, const Options& options,
                                                     AlongRows* along) {
  if (o.rows.size() <= o.unknowns()) {
    RowInformation information = information_of(o);
    return ObservationsAtSolution{std::move(o), std::move(information), 0};
  }

  std::optional<Observations> with_along;
  Eigen::VectorXd at;
  double change = 0.0;
  for (int adjustments = 1; adjustments <= options.max_adjustments; ++adjustments) {
    ABBE_TRY(check_stopped(options.stopped));

    if (along != nullptr) {
      with_along = along->added_to(o, series, noise);
    }
    Observations& rows = with_along ? *with_along : o;
    at.conservativeResizeLike(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(rows.unknowns())));

    RowInformation information = information_of(rows);
    const Result<Eigen::VectorXd> U = datum_of(rows).estimate(
        with_priors(information.data, rows),
        {.weight = options.datum_weight, .label = [&](std::size_t i) { return rows.label(i); }});
    ABBE_TRY(U);

    change = change_in_u(*U - at, information.data);
    if (change < options.adjustment_tolerance) {
      return ObservationsAtSolution{std::move(rows), std::move(information), adjustments};
    }

    o = linearised_at(std::move(o), *U, series, noise);
    if (along != nullptr) {
      along->correct_clock(U->tail(static_cast<Eigen::Index>(along->clock_unknowns())));
    }
    at = *U;
    at.tail(at.size() - static_cast<Eigen::Index>(o.rigid_offset())).setZero();
  }

  return failure(ErrorCode::NotConverged,
                 message("simultaneous adjustment: no convergence after ", options.max_adjustments,
                         " adjustments: the last changed the estimate by ", change,
                         " of its standard uncertainty, limit ", options.adjustment_tolerance,
                         "; check that path and points are of the same run"));
}

}  // namespace abbe::calib::otf
