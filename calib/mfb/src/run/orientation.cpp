#include "abbe/calib/internal/mfb/run/orientation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::mfb {
namespace {

/// Nominal y of hole i of a bar that lies in the given orientation.
double signature_at(std::span<const double> signature_m, std::size_t i, Orientation orientation) {
  const double as_planned = signature_m[i], reversed = signature_m[signature_m.size() - 1 - i];
  switch (orientation) {
    case Orientation::Normal:
      return as_planned;
    case Orientation::TurnedAboutX:
      return -as_planned;
    case Orientation::TurnedAboutY:
      return reversed;
    case Orientation::TurnedAboutZ:
      return -reversed;
  }
  return as_planned;
}

double rms_of(std::span<const Vector3> O_bar_m, std::span<const double> signature_m,
              Orientation orientation) {
  double squares = 0.0;
  for (std::size_t i = 0; i < O_bar_m.size(); ++i) {
    const double off = O_bar_m[i].y() - signature_at(signature_m, i, orientation);
    squares += off * off;
  }
  return std::sqrt(squares / static_cast<double>(O_bar_m.size()));
}

}  // namespace

std::string_view name(Orientation orientation) {
  switch (orientation) {
    case Orientation::Normal:
      return "as planned";
    case Orientation::TurnedAboutX:
      return "turned about x";
    case Orientation::TurnedAboutY:
      return "turned about y";
    case Orientation::TurnedAboutZ:
      return "turned about z";
  }
  return "";
}

Result<OrientationFit> orientation_of(std::span<const Vector3> O_bar_m,
                                      std::span<const double> signature_m) {
  constexpr double kClear = 5.0;
  if (O_bar_m.empty() || O_bar_m.size() != signature_m.size()) {
    return failure(ErrorCode::BadInput,
                   message("orientation of the bar: ", O_bar_m.size(), " points of interest, but ",
                           signature_m.size(), " nominal holes"));
  }
  if (signature_m.front() != 0.0 || signature_m.back() != 0.0) {
    return failure(ErrorCode::BadInput,
                   message("orientation of the bar: the nominal y of the first and last hole is ",
                           signature_m.front(), " m and ", signature_m.back(), " m, must be 0"));
  }

  std::array<OrientationFit, 4> fits;
  constexpr std::array kAll{Orientation::Normal, Orientation::TurnedAboutX,
                            Orientation::TurnedAboutY, Orientation::TurnedAboutZ};
  for (std::size_t k = 0; k < kAll.size(); ++k) {
    fits[k] = {kAll[k], rms_of(O_bar_m, signature_m, kAll[k]), 0.0};
  }
  std::stable_sort(fits.begin(), fits.end(), [](const OrientationFit& a, const OrientationFit& b) {
    return a.rms_m < b.rms_m;
  });
  fits[0].runner_up_rms_m = fits[1].rms_m;

  if (!(fits[1].rms_m > kClear * fits[0].rms_m)) {
    return failure(ErrorCode::NotApplicable,
                   message("orientation of the bar: ", name(fits[0].orientation), " fits to ",
                           fits[0].rms_m * kUmPerM, " um, ", name(fits[1].orientation), " to ",
                           fits[1].rms_m * kUmPerM, " um; the second must be at least ", kClear,
                           " times worse: check the bar and its nominal shifts of the holes"));
  }
  return fits[0];
}

}  // namespace abbe::calib::mfb
