#include "identify/gauge_line.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

bool valid_number(double value) {
  return std::isfinite(value) && value >= 0.0;
}

Result<void> check_faces(const StepGauge& gauge) {
  if (gauge.faces.size() < 2) {
    return failure(ErrorCode::BadInput,
                   message("step gauge: ", gauge.faces.size(), " faces, at least 2 are needed"));
  }
  for (std::size_t k = 0; k < gauge.faces.size(); ++k) {
    const GaugeFace& face = gauge.faces[k];
    if (face.readings_m.empty()) {
      return failure(ErrorCode::BadInput, message("step gauge, face ", k + 1, ": no reading"));
    }
    const bool finite = std::isfinite(face.distance_m) &&
                        std::all_of(face.readings_m.begin(), face.readings_m.end(),
                                    [](const Vector3& r) { return r.allFinite(); });
    if (!finite) {
      return failure(ErrorCode::NotFinite,
                     message("step gauge, face ", k + 1, ": a value is not a number"));
    }
    const double before_m = k == 0 ? 0.0 : gauge.faces[k - 1].distance_m;
    if (k == 0 ? face.distance_m != 0.0 : face.distance_m <= before_m) {
      return failure(ErrorCode::BadInput,
                     message("step gauge, face ", k + 1, " at ", kMmPerM * face.distance_m,
                             " mm: distances are from the first face, 0, and ascend"));
    }
  }
  return {};
}

Result<void> check_gauge(const StepGauge& gauge) {
  const Expansivity expansion = gauge.expansion.value_or(Expansivity{});
  const bool valid = valid_number(gauge.u_m) && valid_number(gauge.u_per_m) &&
                     std::isfinite(gauge.temperature_K) && valid_number(gauge.u_temperature_K) &&
                     std::isfinite(expansion.alpha_per_K) &&
                     valid_number(expansion.u_alpha_per_K) &&
                     valid_number(gauge.u_rotation_rad.value_or(0.0)) &&
                     valid_number(gauge.u_alignment_rad.value_or(0.0)) &&
                     gauge.origin_m.allFinite() && gauge.tool_offset_m.allFinite();
  if (!valid) {
    return failure(ErrorCode::BadInput,
                   message("step gauge \"", gauge.name,
                           "\": uncertainties must be at least 0, all values finite"));
  }
  return check_faces(gauge);
}

double expansion_factor(const StepGauge& gauge) {
  const double alpha_per_K = gauge.expansion ? gauge.expansion->alpha_per_K : 0.0;
  return 1.0 + alpha_per_K * (gauge.temperature_K - kReferenceTemperature_K);
}

/// Returns an error for a face whose measured distance does not fit its calibrated distance.
Result<void> check_distances(const StepGauge& gauge, const GaugeLine& line) {
  constexpr double kMostError_m = 0.1e-3;
  for (std::size_t k = 1; k < gauge.faces.size(); ++k) {
    const double distance_m = gauge.faces[k].distance_m * expansion_factor(gauge);
    if (!(std::abs(line.measured_m(k) - distance_m) <= kMostError_m)) {
      return failure(
          ErrorCode::BadInput,
          message("step gauge, face ", k + 1, ": measured ", kMmPerM * line.measured_m(k),
                  " mm from the first face along the line of the touches, calibrated ",
                  kMmPerM * distance_m,
                  " mm at its temperature: another face, unit or temperature"));
    }
  }
  return {};
}

Vector3 mean_reading(const GaugeFace& face) {
  Vector3 sum_m = Vector3::Zero();
  for (const Vector3& reading_m : face.readings_m) {
    sum_m += reading_m;
  }
  return sum_m / static_cast<double>(face.readings_m.size());
}

/// Vector of the slopes of the touches over the calibrated distances, by least squares.
Vector3 direction_of(const StepGauge& gauge, const std::vector<Vector3>& face_m) {
  const auto faces = static_cast<double>(face_m.size());
  double mean_m = 0.0;
  for (const GaugeFace& face : gauge.faces) {
    mean_m += face.distance_m / faces;
  }
  Vector3 slope = Vector3::Zero();
  for (std::size_t k = 0; k < face_m.size(); ++k) {
    slope += (gauge.faces[k].distance_m - mean_m) * (face_m[k] - face_m[0]);
  }
  return slope.normalized();
}

/// Residuals of the readings of all faces along the line, relative to the mean of their face.
struct RunResiduals {
  std::size_t face = 0, run = 0;  ///< face and run of the largest residual
  double largest_m = 0.0;
  double usual_m = 0.0;  ///< robust standard deviation, from the median; an outlier does not change
                         ///< it
  double s_m = 0.0;      ///< standard deviation from the sum of squares; 0 without repeats
};

RunResiduals run_residuals(const StepGauge& gauge, const GaugeLine& line) {
  RunResiduals out;
  std::vector<double> all_m;
  double squares = 0.0;
  for (std::size_t k = 0; k < gauge.faces.size(); ++k) {
    const auto& readings_m = gauge.faces[k].readings_m;
    for (std::size_t r = 0; r < readings_m.size(); ++r) {
      const double off_m = std::abs(line.direction.dot(readings_m[r] - line.face_m[k]));
      squares += off_m * off_m;
      all_m.push_back(off_m);
      if (off_m > out.largest_m) {
        out.face = k;
        out.run = r;
        out.largest_m = off_m;
      }
    }
  }

  const auto readings = static_cast<double>(all_m.size());
  const double degrees_of_freedom = readings - static_cast<double>(gauge.faces.size());
  if (degrees_of_freedom > 0.0) {
    out.s_m = std::sqrt(squares / degrees_of_freedom);
    out.usual_m = kMadToSigma * median(all_m) * std::sqrt(readings / degrees_of_freedom);
  }
  return out;
}

/// Returns an error if one reading is an outlier: a false trigger or dirt in one run displaces the
/// mean of its face.
Result<void> check_runs(const RunResiduals& runs) {
  constexpr double kWorse = 8.0, kSmall_m = 1e-6;
  if (runs.largest_m <= std::max(kWorse * runs.usual_m, kSmall_m)) {
    return {};
  }
  return failure(ErrorCode::BadInput,
                 message("step gauge, face ", runs.face + 1, ", run ", runs.run + 1, ": ",
                         kUmPerM * runs.largest_m, " um from the mean of its face, usual are ",
                         kUmPerM * runs.usual_m,
                         " um: dirt or a false trigger; measure the gauge again, or leave out this "
                         "run of all faces"));
}

/// Row of weights of the faces for the value at `at_m`, linear between the faces.
Eigen::RowVectorXd weights_at(double at_m, const std::vector<double>& faces_m) {
  const auto above = std::upper_bound(faces_m.begin() + 1, faces_m.end() - 1, at_m);
  const Eigen::Index i = above - faces_m.begin();
  const double left = faces_m[static_cast<std::size_t>(i) - 1];
  const double u = (at_m - left) / (faces_m[static_cast<std::size_t>(i)] - left);
  Eigen::RowVectorXd weights = Eigen::RowVectorXd::Zero(std::ssize(faces_m));
  weights(i - 1) = 1.0 - u;
  weights(i) = u;
  return weights;
}

/// Weights of `four` faces for the value at face `at` of the polynomial through them.
Eigen::Vector4d lagrange_weights(const StepGauge& gauge, const std::array<std::size_t, 4>& four,
                                 std::size_t at) {
  Eigen::Vector4d weights = Eigen::Vector4d::Ones();
  for (std::size_t i = 0; i < four.size(); ++i) {
    for (std::size_t k = 0; k < four.size(); ++k) {
      if (k != i) {
        weights(static_cast<Eigen::Index>(i)) *=
            (gauge.faces[at].distance_m - gauge.faces[four[k]].distance_m) /
            (gauge.faces[four[i]].distance_m - gauge.faces[four[k]].distance_m);
      }
    }
  }
  return weights;
}

/// For each face: difference of E from the cubic through four faces around it, divided by its
/// standard deviation for independent errors of standard deviation 1. A machine error that is
/// smooth over five faces gives small values. Empty below 5 faces.
std::vector<double> roughness_m(const StepGauge& gauge, const Eigen::VectorXd& E_m) {
  constexpr std::size_t kWindow = 5;
  const std::size_t faces = gauge.faces.size();
  std::vector<double> out;
  for (std::size_t k = 0; faces >= kWindow && k < faces; ++k) {
    const std::size_t first = std::min(k < 2 ? 0 : k - 2, faces - kWindow);
    std::array<std::size_t, 4> four{};
    for (std::size_t i = 0, face = first; i < four.size(); ++i, ++face) {
      if (face == k) {
        ++face;
      }
      four[i] = face;
    }
    const Eigen::Vector4d weights = lagrange_weights(gauge, four, k);
    double off_m = E_m(static_cast<Eigen::Index>(k));
    for (std::size_t i = 0; i < four.size(); ++i) {
      off_m -= weights(static_cast<Eigen::Index>(i)) * E_m(static_cast<Eigen::Index>(four[i]));
    }
    out.push_back(std::abs(off_m) / std::sqrt(1.0 + weights.squaredNorm()));
  }
  return out;
}

std::vector<std::string> notes_of_faces(const StepGauge& gauge, const GaugeLine& line,
                                        const Eigen::VectorXd& E_m) {
  const std::vector<double> rough_m = roughness_m(gauge, E_m);
  if (rough_m.empty()) {
    return {};
  }
  constexpr double kRougher = 4.0, kWorse = 6.0, kRough_m = 0.3e-6, kSmall_m = 0.5e-6;
  const auto runs = static_cast<double>(gauge.faces.front().readings_m.size());
  const double expected_m = root_sum_of_squares(gauge.u_m, line.s_m / std::sqrt(runs));
  std::vector<double> sorted_m = rough_m;
  const double usual_m = kMadToSigma * median(sorted_m);
  if (usual_m > std::max(kRougher * expected_m, kRough_m)) {
    return {message("step gauge: from face to face E_XX scatters by ", kUmPerM * usual_m,
                    " um, stated u and repeatability explain ", kUmPerM * expected_m,
                    " um: the distances of another gauge, a gauge measured from its other end, or "
                    "an error of the machine with a short period")};
  }
  const auto worst = std::max_element(rough_m.begin(), rough_m.end());
  if (*worst > std::max(kWorse * std::max(usual_m, expected_m), kSmall_m)) {
    return {message("step gauge, face ", worst - rough_m.begin() + 1, ": its E_XX is about ",
                    kUmPerM * *worst,
                    " um beside those of the faces around it: dirt, or a wrong distance")};
  }
  return {};
}

/// Relative standard uncertainty of all distances of the gauge, at its temperature.
double u_of_scale(const StepGauge& gauge) {
  const Expansivity expansion = gauge.expansion.value_or(Expansivity{});
  const double from_20_K = gauge.temperature_K - kReferenceTemperature_K;
  return root_sum_of_squares(gauge.u_per_m,
                             root_sum_of_squares(expansion.alpha_per_K * gauge.u_temperature_K,
                                                 expansion.u_alpha_per_K * from_20_K));
}

}  // namespace

Result<GaugeLine> line_of_gauge(const StepGauge& gauge) {
  ABBE_TRY(check_gauge(gauge));
  GaugeLine line;
  for (const GaugeFace& face : gauge.faces) {
    line.face_m.push_back(mean_reading(face));
    line.middle_m +=
        (line.face_m.back() + gauge.tool_offset_m) / static_cast<double>(gauge.faces.size());
  }
  line.direction = direction_of(gauge, line.face_m);

  const RunResiduals runs = run_residuals(gauge, line);
  line.s_m = runs.s_m;
  return check_runs(runs).and_then([&] { return check_distances(gauge, line); }).map([&] {
    return line;
  });
}

double u_of_alignment(const StepGauge& gauge) {
  const double length_m = gauge.faces.back().distance_m;
  return gauge.u_alignment_rad.value_or(kGaugeAlignment_m / (std::numbers::sqrt3 * length_m));
}

double most_angle_rad(const StepGauge& gauge, const BarLine& bar) {
  constexpr double kMost = 3.0;  // 1 % of cases: vectors of two normal components are longer
  return kMost * root_sum_of_squares(u_of_alignment(gauge), bar.u_direction_rad);
}

Result<void> check_alignment(const StepGauge& gauge, const GaugeLine& line, const BarLine& bar) {
  constexpr double kMradPerRadian = 1e3;
  const Vector3 along = bar.axes.transpose() * line.direction;
  if (along.x() < 0.0) {
    return failure(
        ErrorCode::BadInput,
        "step gauge: face 1 is at the end near the last hole of the bar; begin at the face near "
        "hole 1");
  }
  const double most_rad = most_angle_rad(gauge, bar);
  if (along.tail<2>().norm() <= most_rad) {
    return {};
  }
  return failure(
      ErrorCode::BadInput,
      message("step gauge: the line of its touches is ", angle_text(bar.axes, line.direction),
              " from the bar, at most ", two_digits(kMradPerRadian * most_rad),
              " mrad, three times the uncertainty of its alignment: put the gauge along the bar as "
              "it lay, and move the tip along the gauge; or state u_alignment"));
}

Result<Positioning> positioning_by_gauge(const StepGauge& gauge, const GaugeLine& line,
                                         const BarLine& bar) {
  const Eigen::Index faces = std::ssize(gauge.faces), points = std::ssize(bar.coordinate_m);
  std::vector<double> at_m;
  for (const Vector3& reading_m : line.face_m) {
    at_m.push_back(bar.along.of(reading_m));
  }
  if (bar.coordinate_m.front() < at_m.front() || bar.coordinate_m.back() > at_m.back()) {
    const auto reading_mm = [&](double c_m) { return kMmPerM * bar.along.reading_m(c_m); };
    return failure(ErrorCode::BadInput,
                   message("step gauge: reaches from ", reading_mm(at_m.front()), " to ",
                           reading_mm(at_m.back()), " mm (readings), the holes of the bar from ",
                           reading_mm(bar.coordinate_m.front()), " to ",
                           reading_mm(bar.coordinate_m.back()), " mm"));
  }

  Eigen::VectorXd E_faces_m(faces), variance_m2(faces), distance_m(faces);
  Eigen::MatrixXd beside_m(faces, 3);  // row k: w_k of gauge_line.hpp
  for (Eigen::Index k = 0; k < faces; ++k) {
    const auto i = static_cast<std::size_t>(k);
    distance_m(k) = gauge.faces[i].distance_m;
    E_faces_m(k) = distance_m(k) * expansion_factor(gauge) - line.measured_m(i);
    const auto runs = static_cast<double>(gauge.faces[i].readings_m.size());
    variance_m2(k) = line.s_m * line.s_m / runs + (k == 0 ? 0.0 : gauge.u_m * gauge.u_m);
    beside_m.row(k) = line.face_m[i] - line.face_m[0] - line.measured_m(i) * line.direction;
  }

  Eigen::MatrixXd weights(points, faces);
  for (Eigen::Index i = 0; i < points; ++i) {
    weights.row(i) = weights_at(bar.coordinate_m[static_cast<std::size_t>(i)], at_m);
  }
  const Eigen::RowVectorXd at_first = weights.row(0);
  weights.rowwise() -= at_first;

  const double u_rad = u_of_alignment(gauge);
  const double phi2 = (bar.axes.transpose() * line.direction).tail<2>().squaredNorm();
  const double u_cosine = root_sum_of_squares(std::numbers::sqrt2 * u_rad * u_rad, 0.5 * phi2);
  const double u_length = root_sum_of_squares(u_of_scale(gauge), u_cosine);
  const Eigen::MatrixXd of_faces_m2 = variance_m2.asDiagonal().toDenseMatrix() +
                                      u_rad * u_rad * beside_m * beside_m.transpose() +
                                      u_length * u_length * distance_m * distance_m.transpose();
  return Positioning{weights * E_faces_m, weights * of_faces_m2 * weights.transpose(),
                     notes_of_faces(gauge, line, E_faces_m)};
}

Eigen::MatrixXd abbe_covariance_m2(double beside_m, double u_rotation_rad,
                                   std::span<const double> along_m) {
  const Eigen::Index points = std::ssize(along_m);
  const double length_m = 0.25 * (along_m.back() - along_m.front());
  const auto correlation = [&](Eigen::Index i, Eigen::Index k) {
    return exponential(
        -std::abs(along_m[static_cast<std::size_t>(i)] - along_m[static_cast<std::size_t>(k)]) /
        length_m);
  };

  Eigen::MatrixXd covariance_m2(points, points);
  for (Eigen::Index i = 0; i < points; ++i) {
    for (Eigen::Index k = 0; k < points; ++k) {
      covariance_m2(i, k) = correlation(i, k) - correlation(i, 0) - correlation(0, k) + 1.0;
    }
  }
  const double u_m = beside_m * u_rotation_rad;
  return 0.5 * u_m * u_m * covariance_m2;
}

}  // namespace abbe::calib::mfb
