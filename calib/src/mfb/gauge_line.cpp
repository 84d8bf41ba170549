#include "mfb/gauge_line.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "abbe/calib/root_sum_of_squares.hpp"
#include "elementary.hpp"
#include "message.hpp"
#include "units.hpp"

namespace abbe::calib::mfb {
namespace {

/// Mean reading of each face along the bar, and the standard deviation of one reading.
struct FaceReadings {
  std::vector<double> mean_m;
  double s_m = 0.0;  ///< over all faces; 0 without repeats
};

FaceReadings face_readings(const StepGauge& gauge, const AlongBar& direction) {
  FaceReadings faces;
  double squares = 0.0;
  std::size_t degrees_of_freedom = 0;
  for (const GaugeFace& face : gauge.faces) {
    const auto& readings = face.readings_m;
    const double mean = std::accumulate(readings.begin(), readings.end(), 0.0) /
                        static_cast<double>(readings.size());
    for (const double r : readings) {
      squares += (r - mean) * (r - mean);
    }
    degrees_of_freedom += readings.size() - 1;
    faces.mean_m.push_back(direction.of(mean));
  }
  if (degrees_of_freedom > 0) {
    faces.s_m = std::sqrt(squares / static_cast<double>(degrees_of_freedom));
  }
  return faces;
}

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
                                    [](double r) { return std::isfinite(r); });
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
  const bool valid =
      valid_number(gauge.u_m) && valid_number(gauge.u_per_m) &&
      std::isfinite(gauge.temperature_K) && valid_number(gauge.u_temperature_K) &&
      std::isfinite(expansion.alpha_per_K) && valid_number(expansion.u_alpha_per_K) &&
      valid_number(gauge.u_rotation_rad.value_or(0.0)) &&
      valid_number(gauge.u_alignment_rad.value_or(0.0)) && gauge.origin_m.allFinite();
  if (!valid) {
    return failure(ErrorCode::BadInput,
                   message("step gauge \"", gauge.name,
                           "\": uncertainties must be at least 0, all values finite"));
  }
  return check_faces(gauge);
}

/// A face whose measured distance is that of another face.
Result<void> check_distances(const StepGauge& gauge, const std::vector<double>& along_m) {
  constexpr double kMostError_m = 0.1e-3;
  for (std::size_t k = 1; k < along_m.size(); ++k) {
    const double measured_m = along_m[k] - along_m[0];
    if (std::abs(measured_m - gauge.faces[k].distance_m) > kMostError_m) {
      return failure(
          ErrorCode::BadInput,
          message("step gauge, face ", k + 1, ": measured ", kMmPerM * measured_m,
                  " mm from the first face along the bar, calibrated ",
                  kMmPerM * gauge.faces[k].distance_m, " mm: another face, axis or direction"));
    }
  }
  return {};
}

/// Row: weights of the faces in the value at `at_m`, linear between the faces.
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

/// Relative standard uncertainty of all distances by the direction of the gauge. An angle e between
/// gauge and bar makes the measured distances 1 / cos e = 1 + e^2 / 2 times as long. Both components
/// of e have the standard uncertainty u: e^2 / 2 has the expectation u^2 and the variance u^4.
double u_of_alignment(const StepGauge& gauge) {
  const double length_m = gauge.faces.back().distance_m;
  const double u_rad =
      gauge.u_alignment_rad.value_or(kGaugeAlignment_m / (std::numbers::sqrt3 * length_m));
  return std::numbers::sqrt2 * u_rad * u_rad;
}

/// Relative standard uncertainty of all distances at the temperature of the gauge.
double u_of_scale(const StepGauge& gauge) {
  const Expansivity expansion = gauge.expansion.value_or(Expansivity{});
  const double from_20_K = gauge.temperature_K - kReferenceTemperature_K;
  return root_sum_of_squares(gauge.u_per_m,
                             root_sum_of_squares(expansion.alpha_per_K * gauge.u_temperature_K,
                                                 expansion.u_alpha_per_K * from_20_K));
}

}  // namespace

Result<Positioning> positioning_by_gauge(const StepGauge& gauge, const AlongBar& direction,
                                         std::span<const double> along_m) {
  if (Result<void> valid = check_gauge(gauge); !valid) {
    return tl::unexpected(valid.error());
  }
  const auto [faces_m, s_m] = face_readings(gauge, direction);
  if (Result<void> valid = check_distances(gauge, faces_m); !valid) {
    return tl::unexpected(valid.error());
  }
  if (along_m.front() < faces_m.front() || along_m.back() > faces_m.back()) {
    return failure(
        ErrorCode::BadInput,
        message("step gauge: reaches from ", kMmPerM * direction.reading_m(faces_m.front()), " to ",
                kMmPerM * direction.reading_m(faces_m.back()),
                " mm (readings), the holes of the bar from ",
                kMmPerM * direction.reading_m(along_m.front()), " to ",
                kMmPerM * direction.reading_m(along_m.back()), " mm"));
  }

  const Eigen::Index faces = std::ssize(faces_m), points = std::ssize(along_m);
  const double alpha_per_K = gauge.expansion ? gauge.expansion->alpha_per_K : 0.0;
  const double growth = 1.0 + alpha_per_K * (gauge.temperature_K - kReferenceTemperature_K);
  Eigen::VectorXd E_faces_m(faces), variance_m2(faces), distance_m(points);
  for (Eigen::Index k = 0; k < faces; ++k) {
    const auto i = static_cast<std::size_t>(k);
    E_faces_m(k) = gauge.faces[i].distance_m * growth - (faces_m[i] - faces_m[0]);
    const auto runs = static_cast<double>(gauge.faces[i].readings_m.size());
    variance_m2(k) = s_m * s_m / runs + (k == 0 ? 0.0 : gauge.u_m * gauge.u_m);
  }

  Eigen::MatrixXd weights(points, faces);
  for (Eigen::Index i = 0; i < points; ++i) {
    const double at_m = along_m[static_cast<std::size_t>(i)];
    weights.row(i) = weights_at(at_m, faces_m);
    distance_m(i) = at_m - along_m.front();
  }
  const Eigen::RowVectorXd at_first = weights.row(0);
  weights.rowwise() -= at_first;

  const double u_scale = root_sum_of_squares(u_of_scale(gauge), u_of_alignment(gauge));
  return Positioning{weights * E_faces_m,
                     weights * variance_m2.asDiagonal() * weights.transpose() +
                         u_scale * u_scale * distance_m * distance_m.transpose()};
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
