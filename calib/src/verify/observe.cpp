#include "abbe/calib/verify/observe.hpp"

#include <algorithm>

#include "abbe/calib/axis_mistakes.hpp"
#include "abbe/calib/model_comparison.hpp"
#include "message.hpp"
#include "verify/extent.hpp"

namespace abbe::calib::verify {
namespace {

Result<void> check_finite(std::span<const MeasuredPoint> points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].reading_m.allFinite() || !points[i].measured_m.allFinite()) {
      return failure(ErrorCode::NotFinite,
                     message("verification: point ", i + 1, " is not finite"));
    }
  }
  return {};
}

/// Text "; they fit with ..." that names the mistakes after whose correction the points fit the
/// readings: a reflection, another unit, reversed order of the rows. Empty if no tested correction
/// makes them fit.
std::string fits_with(const Observations& o, double most_rms_m) {
  const auto fits = [&](const Matrix3& M, bool backwards) {
    std::vector<Vector3> from;
    for (const Vector3& p : o.measured_m) {
      from.emplace_back(M * p);
    }
    if (backwards) {
      std::reverse(from.begin(), from.end());
    }
    const auto T = fit_rigid(from, o.readings_m);
    std::vector<Vector3> left;
    for (std::size_t i = 0; T && i < from.size(); ++i) {
      left.emplace_back(*T * from[i] - o.readings_m[i]);
    }
    return T && vector_statistics(left).rms_m <= most_rms_m;
  };

  std::vector<std::string> texts;
  if (fits(Matrix3::Identity(), false)) {
    texts.emplace_back("a frame that is fitted to the readings (--frame fit)");
  }

  if (fits(Vector3(-1.0, 1.0, 1.0).asDiagonal(), false)) {
    texts.emplace_back("one axis reversed or two axes swapped (a left-handed frame)");
  }

  if (fits(Matrix3::Identity(), true)) {
    texts.emplace_back("the measured points in the opposite order");
  }

  for (const UnitMistake& mistake : unit_mistakes()) {
    for (const auto& [factor, of] :
         {std::pair{mistake.factor, "measured points"}, {1.0 / mistake.factor, "readings"}}) {
      if (fits(factor * Matrix3::Identity(), false)) {
        texts.push_back(message(mistake.text, " (", of, ")"));
      }
    }
  }

  return texts.empty() ? "" : "; they fit with " + or_list(texts);
}

Result<void> check_lack_of_fit(const Observations& o, const Extent& extent) {
  Vector3 mean = Vector3::Zero();
  for (const Vector3& v : o.V_m) {
    mean += v / static_cast<double>(o.V_m.size());
  }

  std::vector<Vector3> left;
  for (const Vector3& v : o.V_m) {
    left.push_back(v - mean);
  }

  const double rms_m = vector_statistics(left).rms_m;
  if (rms_m > kMostLackOfFit * extent.diagonal_m()) {
    return failure(ErrorCode::AlignmentFailed,
                   message("verification: readings and measured points of ", extent.diagonal_m(),
                           " m extent leave ", rms_m, " m rms",
                           o.frame == Frame::BestFit ? " after the best rigid motion"
                                                     : " in the machine's axes",
                           ": rows in the wrong order, another unit, or a left-handed frame",
                           fits_with(o, kMostLackOfFit * extent.diagonal_m())));
  }

  return {};
}

}  // namespace

Result<Observations> observe(std::span<const MeasuredPoint> points, Frame frame) {
  if (auto finite = check_finite(points); !finite) {
    return tl::make_unexpected(finite.error());
  }

  Observations o;
  o.frame = frame;
  for (const MeasuredPoint& p : points) {
    o.readings_m.push_back(p.reading_m);
    o.measured_m.push_back(p.measured_m);
  }

  const auto extent = extent_of(o.readings_m);
  if (!extent) {
    return tl::make_unexpected(extent.error());
  }

  if (frame == Frame::BestFit) {
    const auto T = fit_rigid(o.measured_m, o.readings_m);
    if (!T) {
      return tl::make_unexpected(T.error());
    }
    o.T_machine_tracker = *T;
  }

  for (const MeasuredPoint& p : points) {
    o.V_m.emplace_back(o.T_machine_tracker * p.measured_m - p.reading_m);
  }

  if (auto fits = check_lack_of_fit(o, *extent); !fits) {
    return tl::make_unexpected(fits.error());
  }

  return o;
}

}  // namespace abbe::calib::verify
