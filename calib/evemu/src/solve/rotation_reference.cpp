#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::evemu {
namespace {

struct Used {
  std::vector<BallError> points;
  std::vector<std::size_t> numbers;  ///< number, from 1, of each of `points` in the given list
  std::vector<std::size_t> outside;
};

/// Points inside the hull, or outside by at most 2 % of the distance from the centre of the hull.
/// The balls themselves are the vertices of the hull, and a repeated measurement of a ball may lie
/// some micrometres outside.
Used inside_of(const ValidityVolume& volume, std::span<const BallError> points) {
  constexpr double kPulledIn = 0.98;
  const Vector3 centre = bounding_box(volume.vertices_m()).centre_m;
  Used used;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (volume.contains(centre + kPulledIn * (points[i].reading_m - centre))) {
      used.points.push_back(points[i]);
      used.numbers.push_back(i + 1);
    } else {
      used.outside.push_back(i + 1);
    }
  }
  return used;
}

std::string listed(const std::vector<std::size_t>& numbers) {
  std::string text;
  for (const std::size_t n : numbers) {
    text += (text.empty() ? "" : ", ") + std::to_string(n);
  }
  return text;
}

/// Rows of the reference: r = J x + B dc + noise. x: translation and rotation; dc: error of the
/// model's shape.
struct ReferenceRows {
  Eigen::MatrixXd J, B;
  Eigen::VectorXd r;
};

ReferenceRows rows_of(const PolynomialModel& model, std::span<const BallError> points) {
  const auto n = static_cast<Eigen::Index>(3 * points.size());
  ReferenceRows rows{Eigen::MatrixXd(n, 6), Eigen::MatrixXd(n, model.c_m().size()),
                     Eigen::VectorXd(n)};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const BallError& p = points[i];
    const auto at = static_cast<Eigen::Index>(3 * i);
    rows.J.block<3, 3>(at, 0) = Matrix3::Identity();  // a reference has its own origin
    rows.J.block<3, 3>(at, 3) = rotation_effect(p.reading_m - model.ball1_m());
    rows.B.middleRows<3>(at) = model.design().B(p.reading_m);
    rows.r.segment<3>(at) = p.V_m - model.V_at(p.reading_m);
  }
  return rows;
}

bool on_a_line(const Eigen::MatrixXd& J) {
  const Eigen::VectorXd scale = J.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(J * scale.asDiagonal());
  constexpr double kLine = 1e-6;
  qr.setThreshold(kLine);
  return qr.rank() < 6;
}

struct Turn {
  Vector3 omega_rad;
  Eigen::Matrix3Xd K;  ///< omega = K r, r: differences to the reference
  double chi2 = 0.0, dof = 0.0;
  std::size_t worst = 0;  ///< point with the largest residual
  double worst_m = 0.0;
};

/// Generalised least squares with the covariance S = sigma^2 1 + B C B^T: where the model's shape
/// is uncertain, or its errors are correlated, the reference has correspondingly less weight.
Turn turn_onto(const ReferenceRows& rows, const Eigen::MatrixXd& C_shape, double sigma_m) {
  Eigen::MatrixXd S = rows.B * C_shape * rows.B.transpose();
  S.diagonal().array() += sigma_m * sigma_m;
  const Eigen::LLT<Eigen::MatrixXd> llt(S);
  const Eigen::MatrixXd J = llt.matrixL().solve(rows.J);
  const Eigen::VectorXd r = llt.matrixL().solve(rows.r);
  const Eigen::VectorXd scale = J.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd J_scaled = J * scale.asDiagonal();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(J_scaled);
  const Eigen::VectorXd x = scale.asDiagonal() * qr.solve(r);
  const Eigen::MatrixXd whitening =
      llt.matrixL().solve(Eigen::MatrixXd::Identity(S.rows(), S.cols()));
  Turn turn;
  turn.omega_rad = x.tail<3>();
  turn.K = (scale.asDiagonal() * qr.solve(whitening)).bottomRows<3>();
  turn.chi2 = (r - J * x).squaredNorm();
  turn.dof = static_cast<double>(r.size() - x.size());
  const Eigen::VectorXd left_m = rows.r - rows.J * x;

  for (Eigen::Index i = 0; i < left_m.size(); i += 3) {
    if (const double off_m = left_m.segment<3>(i).norm(); off_m > turn.worst_m) {
      turn.worst_m = off_m;
      turn.worst = static_cast<std::size_t>(i / 3);
    }
  }

  return turn;
}

/// Covariance of the coefficients without the uncertainty of the rotation about Ball1, which
/// set_datum() (solve.cpp) added.
Eigen::MatrixXd shape_covariance(const PolynomialModel& model, const MeanRotation& rotation) {
  const Eigen::MatrixX3d G = model.design().rotation_about(model.ball1_m());
  return rotation.referenced
             ? model.covariance_m2()
             : Eigen::MatrixXd(model.covariance_m2() - G * rotation.cov_rad2 * G.transpose());
}

Result<void> check_size(const Used& used, std::size_t given) {
  if (used.points.size() >= 3) {
    return {};
  }
  return failure(ErrorCode::TooFewObservations,
                 message("rotation reference: ", used.points.size(), " of ", given,
                         " points lie in the volume the balls span, needs 3",
                         used.outside.empty() ? "" : "; outside: point " + listed(used.outside)));
}

}  // namespace

Result<Solution> with_rotation_reference(Solution solution, const RotationReference& reference) {
  if (!(reference.sigma_m > 0.0)) {
    return failure(ErrorCode::BadInput, message("rotation reference: standard uncertainty ",
                                                reference.sigma_m, " m, must be greater than 0"));
  }

  const PolynomialModel& evemu = *solution.model.polynomials();
  const Used used = inside_of(solution.model.validity(), reference.points);
  ABBE_TRY(check_size(used, reference.points.size()));

  const ReferenceRows rows = rows_of(evemu, used.points);
  if (!rows.r.allFinite()) {
    return failure(ErrorCode::NotFinite, "rotation reference: a point is not a number");
  }

  if (on_a_line(rows.J)) {
    return failure(ErrorCode::DegenerateGeometry, "rotation reference: its points lie on a line");
  }

  const Eigen::MatrixXd C_shape = shape_covariance(evemu, solution.rotation);
  const Misfit* misfit = solution.model.misfit();
  const double sigma_m = root_sum_of_squares(
      reference.sigma_m, misfit != nullptr ? misfit->u_V_m.norm() / std::sqrt(3.0) : 0.0);
  const Turn turn = turn_onto(rows, C_shape, sigma_m);
  const double chi2_limit = turn.dof * chi2_per_dof_999(turn.dof);

  // Errors of a real machine are not exactly polynomials. With many points chi-square therefore
  // exceeds its limit even if the reference is correct. Residuals of up to twice the stated
  // uncertainties only enlarge the rotation's uncertainty, as in [Birge 1932]. With NaN the
  // condition below is true, and the reference is refused.
  constexpr double kMostPerDof = 4.0;
  const double widened = turn.chi2 > chi2_limit ? turn.chi2 / turn.dof : 1.0;
  if (!(turn.chi2 <= std::max(chi2_limit, kMostPerDof * turn.dof))) {
    return failure(
        ErrorCode::BadInput,
        message("rotation reference: does not fit the model after any rotation and translation: "
                "chi-square ",
                turn.chi2, " with ", turn.dof, " degrees of freedom, point ",
                used.numbers[turn.worst], " is off by ", 1e6 * turn.worst_m,
                " um (another frame, sign or artefact, or the stated uncertainty is too small)"));
  }

  const Eigen::MatrixX3d G = evemu.design().rotation_about(evemu.ball1_m());
  // Error of the rotated coefficients: G (K (B dc + noise)) - dc, dc: error of the model's shape.
  const Eigen::MatrixXd kept =
      Eigen::MatrixXd::Identity(C_shape.rows(), C_shape.cols()) - G * (turn.K * rows.B);
  const Matrix3 from_noise = sigma_m * sigma_m * turn.K * turn.K.transpose();
  const Eigen::Matrix3Xd KB = turn.K * rows.B;
  const Matrix3 cov_rad2 = KB * C_shape * KB.transpose() + from_noise;
  Eigen::MatrixXd C = kept * C_shape * kept.transpose() + G * from_noise * G.transpose();
  C += (widened - 1.0) * G * cov_rad2 * G.transpose();
  C = 0.5 * (C + C.transpose()).eval();
  C.diagonal() = C.diagonal().cwiseMax(0.0);  // rounding can leave small negative variances
  Result<PolynomialModel> turned =
      PolynomialModel::of(evemu.design(), evemu.ball1_m(), evemu.c_m() + G * turn.omega_rad, C);

  ABBE_TRY(turned);

  return VolumetricModel::from_polynomials(*std::move(turned), ModelDatum::Ball1,
                                           solution.model.tool_offsets_m().front(),
                                           solution.model.validity())
      .and_then([&](VolumetricModel model) {
        return misfit != nullptr ? model.with_misfit(*misfit)
                                 : Result<VolumetricModel>(std::move(model));
      })
      .map([&](VolumetricModel model) {
        solution.model = std::move(model);
        solution.rotation.removed_rad -= turn.omega_rad;
        solution.rotation.cov_rad2 = widened * cov_rad2;
        solution.rotation.referenced = true;
        solution.rotation.rotation_reference =
            ReferenceFit{used.points.size(), used.outside, turn.chi2, turn.dof, widened};
        return solution;
      });
}

}  // namespace abbe::calib::evemu
