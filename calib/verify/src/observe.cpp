#include "abbe/calib/verify/observe.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/result/try.hpp"
#include "extent.hpp"
#include "points_with_mistakes.hpp"

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

Result<void> check_lack_of_fit(const Observations& o, std::span<const MeasuredPoint> points,
                               const Extent& extent, const ErrorsAt& errors_at) {
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
                           mistakes_that_fit(points, o.frame, errors_at)));
  }

  return {};
}

/// Largest distance of the readings of two shots that belong to one place.
double same_place_m(std::span<const MeasuredPoint> points) {
  Vector3 low = points.empty() ? Vector3::Zero() : points.front().reading_m, high = low;
  for (const MeasuredPoint& p : points) {
    low = low.cwiseMin(p.reading_m);
    high = high.cwiseMax(p.reading_m);
  }
  return std::min(kSamePlace_m, kSamePlaceOfExtent * (high - low).norm());
}

/// The shots of each place, in the order of the first shots. A shot belongs to the first place
/// whose first shot is near enough. Comparing with the first shot only prevents that a row of
/// points at small distances becomes one place.
std::vector<std::vector<std::size_t>> shots_of_places(std::span<const MeasuredPoint> points,
                                                      double same_place_m) {
  std::vector<std::vector<std::size_t>> places;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto place =
        std::find_if(places.begin(), places.end(), [&](const std::vector<std::size_t>& shots) {
          return (points[shots.front()].reading_m - points[i].reading_m).norm() <= same_place_m;
        });
    if (place == places.end()) {
      places.push_back({i});
    } else {
      place->push_back(i);
    }
  }
  return places;
}

/// Mean reading and mean measured point of the shots.
MeasuredPoint mean_of_place(std::span<const MeasuredPoint> points,
                            const std::vector<std::size_t>& shots) {
  // The mean is computed relative to the first shot, so that the mean of a single shot has the same
  // bits as the shot.
  MeasuredPoint mean = points[shots.front()];
  Vector3 reading = Vector3::Zero(), measured = Vector3::Zero();
  for (const std::size_t shot : shots) {
    reading += points[shot].reading_m - mean.reading_m;
    measured += points[shot].measured_m - mean.measured_m;
  }
  mean.reading_m += reading / static_cast<double>(shots.size());
  mean.measured_m += measured / static_cast<double>(shots.size());
  return mean;
}

/// Computes Observations::repeatability_m.
std::optional<double> repeatability_m(std::span<const MeasuredPoint> points,
                                      const Observations& o) {
  if (points.size() == o.shots.size()) {
    return std::nullopt;
  }
  double squares = 0.0;
  for (std::size_t place = 0; place < o.shots.size(); ++place) {
    for (const std::size_t shot : o.shots[place]) {
      const Vector3 V = o.T_machine_tracker * points[shot].measured_m - points[shot].reading_m;
      squares += (V - o.V_m[place]).squaredNorm();
    }
  }
  return std::sqrt(squares / static_cast<double>(points.size() - o.shots.size()));
}

}  // namespace

std::size_t Observations::shot_count() const noexcept {
  std::size_t count = 0;
  for (const auto& of_place : shots) {
    count += of_place.size();
  }
  return count;
}

Result<Observations> observe(std::span<const MeasuredPoint> points, Frame frame,
                             const ErrorsAt& errors_at) {
  ABBE_TRY(check_finite(points));

  Observations o;
  o.frame = frame;
  o.shots = shots_of_places(points, same_place_m(points));
  for (const auto& shots : o.shots) {
    const MeasuredPoint mean = mean_of_place(points, shots);
    o.readings_m.push_back(mean.reading_m);
    o.measured_m.push_back(mean.measured_m);
  }

  const auto extent = extent_of(o.readings_m);
  ABBE_TRY(extent);

  if (frame == Frame::BestFit) {
    const auto T = fit_rigid(o.measured_m, o.readings_m);
    ABBE_TRY(T);
    o.T_machine_tracker = *T;
  }

  for (std::size_t place = 0; place < o.shots.size(); ++place) {
    o.V_m.emplace_back(o.T_machine_tracker * o.measured_m[place] - o.readings_m[place]);
  }
  o.repeatability_m = repeatability_m(points, o);

  ABBE_TRY(check_lack_of_fit(o, points, *extent, errors_at));

  return o;
}

}  // namespace abbe::calib::verify
