#include "points_with_mistakes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/geometry/range_change.hpp"

namespace abbe::calib::verify {
namespace {

using Points = std::vector<MeasuredPoint>;

constexpr double kDoesNotFit = std::numeric_limits<double>::infinity();
constexpr double kLeastInside = 0.7;  // share of the points at which the model must be valid
constexpr std::size_t kFewestOfMistakes = 4;
constexpr const char* kMirrored =
    "one axis reversed or two axes swapped (measured points, a left-handed frame)";

/// Residuals of points after a fit.
struct Left {
  double rms_m = kDoesNotFit;
  double relative = kDoesNotFit;  ///< rms / diagonal of the box around the readings
};

/// Residuals after the best-fit rigid motion (Frame::Machine: best shift) from the measured points
/// to reading + V. Without `errors_at`, V is 0.
Left left_by(std::span<const MeasuredPoint> points, Frame frame, const ErrorsAt& errors_at) {
  std::vector<Vector3> from, to;
  for (const MeasuredPoint& p : points) {
    const auto V = errors_at ? errors_at(p.reading_m) : std::optional(Vector3(Vector3::Zero()));
    if (V) {
      from.push_back(p.measured_m);
      to.emplace_back(p.reading_m + *V);
    }
  }
  const auto n = static_cast<double>(from.size());
  if (from.size() < kFewestOfMistakes || n < kLeastInside * static_cast<double>(points.size())) {
    return {};
  }

  Vector3 low = to.front(), high = to.front(), shift = Vector3::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    low = low.cwiseMin(to[i]);
    high = high.cwiseMax(to[i]);
    shift += (to[i] - from[i]) / n;
  }
  RigidTransform T{Matrix3::Identity(), shift};
  if (frame == Frame::BestFit) {
    const auto fitted = fit_rigid(from, to);
    if (!fitted) {
      return {};
    }
    T = *fitted;
  }

  double squares = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    squares += (T * from[i] - to[i]).squaredNorm();
  }
  const double rms_m = std::sqrt(squares / n), diagonal_m = (high - low).norm();
  return diagonal_m > 0.0 ? Left{rms_m, rms_m / diagonal_m} : Left{};
}

template <class Change>
Points changed(std::span<const MeasuredPoint> points, const Change& change) {
  Points out(points.begin(), points.end());
  for (MeasuredPoint& p : out) {
    change(p);
  }
  return out;
}

Points in_opposite_order(std::span<const MeasuredPoint> points) {
  Points out(points.begin(), points.end());
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].measured_m = points[out.size() - 1 - i].measured_m;
  }
  return out;
}

/// Points in which each row has the measured point of the next row (`next` = 1) or of the previous
/// row (-1).
Points one_row_off(std::span<const MeasuredPoint> points, std::ptrdiff_t next) {
  Points out;
  for (std::ptrdiff_t i = 0; i < std::ssize(points); ++i) {
    const std::ptrdiff_t other = i + next;
    if (other >= 0 && other < std::ssize(points)) {
      out.push_back({points[static_cast<std::size_t>(i)].reading_m,
                     points[static_cast<std::size_t>(other)].measured_m});
    }
  }
  return out;
}

struct Corrected {
  std::string text;
  Points points;
};

/// The points with the constant change of all ranges that fits best; nullopt: the change is too
/// small to be a mistake.
std::optional<Corrected> with_other_ranges(std::span<const MeasuredPoint> points, Frame frame,
                                           const ErrorsAt& errors_at) {
  constexpr double kLeast_m = 2e-3;  // a smaller change only absorbs another error
  const auto with = [&](double change_m) {
    return changed(points, [&](MeasuredPoint& p) {
      p.measured_m = with_longer_range(p.measured_m, change_m);
    });
  };
  const auto change_m = best_range_change_m([&](double tried_m) {
    const Left left = left_by(with(tried_m), frame, errors_at);
    return std::isfinite(left.rms_m) ? std::optional(left.rms_m) : std::nullopt;
  });
  if (!change_m || std::abs(*change_m) < kLeast_m) {
    return std::nullopt;
  }
  return Corrected{range_change_text(*change_m), with(*change_m)};
}

std::vector<Corrected> corrections(std::span<const MeasuredPoint> points, Frame frame,
                                   const ErrorsAt& errors_at) {
  std::vector<Corrected> all;
  for (const AxisMistake& mistake : axis_mistakes()) {
    all.push_back({mistake.text + " (readings)", changed(points, [&](MeasuredPoint& p) {
                     p.reading_m = mistake.M * p.reading_m;
                   })});
  }
  all.push_back({kMirrored, changed(points, [](MeasuredPoint& p) { p.measured_m.x() *= -1.0; })});

  for (const UnitMistake& mistake : unit_mistakes()) {
    all.push_back({mistake.text + " (measured points)",
                   changed(points, [&](MeasuredPoint& p) { p.measured_m *= mistake.factor; })});
    all.push_back({mistake.text + " (readings)",
                   changed(points, [&](MeasuredPoint& p) { p.reading_m *= mistake.factor; })});
  }

  all.push_back({"the measured points in the opposite order", in_opposite_order(points)});
  all.push_back({"the measured point of the next row", one_row_off(points, 1)});
  all.push_back({"the measured point of the row before", one_row_off(points, -1)});
  all.push_back({"the columns of readings and measured points exchanged",
                 changed(points, [](MeasuredPoint& p) { std::swap(p.reading_m, p.measured_m); })});

  if (auto ranges = with_other_ranges(points, frame, errors_at)) {
    all.push_back(*std::move(ranges));
  }
  return all;
}

/// A correction, with what the corrected points leave.
struct Fit {
  Left left;
  Left left_without_model;
};

struct Fits {
  std::vector<TriedCorrection> best;  ///< best first; `left` is Left::relative
  Left as_given;
  std::vector<Fit> of_best;  ///< in the order of `best`
};

Fits fits_of(std::span<const MeasuredPoint> points, Frame frame, const ErrorsAt& errors_at) {
  Fits fits{{}, left_by(points, frame, errors_at), {}};
  std::vector<TriedCorrection> tried;
  std::map<std::string, Fit> fit_of;
  for (const Corrected& c : corrections(points, frame, errors_at)) {
    const Fit fit{left_by(c.points, frame, errors_at), left_by(c.points, frame, {})};
    tried.push_back({c.text, fit.left.relative});
    fit_of[c.text] = fit;
  }
  fits.best = far_better(fits.as_given.relative, std::move(tried));
  for (const TriedCorrection& t : fits.best) {
    fits.of_best.push_back(fit_of.at(t.text));
  }
  return fits;
}

/// Whether the corrected points prove the mistake: either they fit a rigid motion far better, or
/// the model explains most of the errors of six or more points. The model of a machine that has
/// changed explains neither; one of the many corrections may then fit by chance.
bool is_proven(const Fit& fit, const Left& given_without_model, std::size_t points) {
  constexpr std::size_t kFewestToExplain = 6;
  const double rigid = fit.left_without_model.relative;
  return rigid <= kFarBetter * given_without_model.relative ||
         (points >= kFewestToExplain && fit.left.relative <= kFarBetter * rigid);
}

/// The length in um, rounded to three decimals.
double um(double length_m) {
  constexpr double kDecimals = 1e3;
  return std::round(kDecimals * kUmPerM * length_m) / kDecimals;
}

/// Names of the best corrections. Without a model all mirror images fit equally well; they are then
/// combined in one text.
std::string names(const std::vector<TriedCorrection>& best) {
  constexpr std::size_t kMost = 2;
  std::vector<std::string> texts;
  for (const TriedCorrection& t : best) {
    texts.push_back(t.text);
  }
  const bool is_mirror = std::find(texts.begin(), texts.end(), kMirrored) != texts.end();
  return is_mirror && texts.size() > kMost
             ? "one axis reversed or two axes swapped (a left-handed frame)"
             : or_list(texts);
}

}  // namespace

std::string mistakes_that_fit(std::span<const MeasuredPoint> points, Frame frame,
                              const ErrorsAt& errors_at) {
  const Fits rigid = fits_of(points, frame, {});
  if (frame == Frame::Machine && left_by(points, Frame::BestFit, {}).relative <= kMostLackOfFit) {
    return "; they fit with a frame that is fitted to the readings (--frame fit)";
  }
  std::vector<TriedCorrection> best;
  for (const TriedCorrection& t : rigid.best) {
    if (t.left <= kMostLackOfFit) {
      best.push_back(t);
    }
  }
  if (best.size() > 1 && errors_at) {
    const Fits modelled = fits_of(points, frame, errors_at);
    if (!modelled.best.empty() && modelled.best.front().left <= kFarBetter * best.front().left) {
      best = modelled.best;
    }
  }
  return best.empty() ? "" : "; they fit with " + names(best);
}

std::vector<std::string> likely_mistakes(std::span<const MeasuredPoint> points, Frame frame,
                                         const ErrorsAt& errors_at) {
  const Fits fits = fits_of(points, frame, errors_at);
  const Left given_without_model = left_by(points, frame, {});
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < fits.best.size(); ++i) {
    if (!is_proven(fits.of_best[i], given_without_model, points.size())) {
      continue;
    }
    const std::string given = std::isfinite(fits.as_given.rms_m)
                                  ? message(", ", um(fits.as_given.rms_m), " um as given")
                                  : std::string();
    texts.push_back(
        message(fits.best[i].text, ": ", um(fits.of_best[i].left.rms_m), " um rms left", given));
  }
  return texts;
}

}  // namespace abbe::calib::verify
