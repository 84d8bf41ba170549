#include "abbe/service/motion_volume.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "abbe/config/capabilities.hpp"
#include "abbe/config/linear_axes.hpp"

namespace abbe::daemon {
namespace {

constexpr double kMmPerM = 1e3;
/// Tolerance for the length of a normal. It is larger than the rounding of a normal with nine
/// decimals, and much smaller than the error of a wrong direction.
constexpr double kUnitTolerance = 1e-6;
constexpr std::array<char, 3> kAxes{'X', 'Y', 'Z'};

std::optional<std::string> place_fault(const MotionVolume& volume,
                                       const std::array<double, 3>& p_m) {
  for (std::size_t i = 0; i < p_m.size(); ++i) {
    if (!std::isfinite(p_m[i])) return fmt::format("{} is not a finite number", kAxes[i]);
    const bool below = p_m[i] < volume.min_m[i];
    if (!below && p_m[i] <= volume.max_m[i]) continue;
    return fmt::format("{} {:.10g} mm is {} {:.10g} mm ({})", kAxes[i], kMmPerM * p_m[i],
                       below ? "below" : "above",
                       kMmPerM * (below ? volume.min_m : volume.max_m)[i], volume.limited_by[i]);
  }
  return std::nullopt;
}

std::optional<std::string> normal_fault(const std::array<double, 3>& n) {
  const double length = std::hypot(n[0], n[1], n[2]);
  if (std::abs(length - 1.0) <= kUnitTolerance) return std::nullopt;  // false for NaN
  return fmt::format("its normal ({:g}, {:g}, {:g}) has the length {:g}: a unit vector is needed",
                     n[0], n[1], n[2], length);
}

/// Counts the faults and keeps the text of the first one.
class PlaceFaults {
 public:
  explicit PlaceFaults(const MotionVolume& volume) : volume_(volume) {}

  /// Counts a fault of the place. `name` makes the name of the place; it is called for the first
  /// fault only.
  template <class Name>
  void look(const drivers::ProbePoint& place, const Name& name) {
    auto fault = place_fault(volume_, place.position_m);
    if (!fault && place.touch) fault = normal_fault(place.normal);
    if (fault && count_++ == 0) first_ = fmt::format("{}: {}", name(), *fault);
  }

  [[nodiscard]] Result<void> result() const {
    if (count_ == 0) return {};
    return fail(ErrorCode::Refused,
                fmt::format("touch: refused, nothing of it was sent: {}{}", first_,
                            count_ == 1 ? "" : fmt::format(" (and {} more places)", count_ - 1)));
  }

 private:
  const MotionVolume& volume_;
  std::size_t count_ = 0;
  std::string first_;
};

}  // namespace

MotionVolume motion_volume(const Config& config) {
  MotionVolume volume;
  const auto source = motion_source(config);
  const auto& axes = config.machine.axes;  // X, Y, Z are the first axes
  for (std::size_t i = 0; i < kLinearAxes && i < axes.size(); ++i) {
    volume.min_m[i] = axes[i].min;
    volume.max_m[i] = axes[i].max;
    volume.limited_by[i] = fmt::format("[axes.{}] travel", axes[i].name);
  }
  if (!source || !source->volume) return volume;

  volume.min_m = source->volume->min_m;
  volume.max_m = source->volume->max_m;
  volume.limited_by.fill(fmt::format("[{}] volume", source->key));
  return volume;
}

Result<void> check_places(const MotionVolume& volume, std::span<const TouchRequest> touches,
                          std::span<const drivers::ProbePoint> leave) {
  PlaceFaults faults{volume};
  for (std::size_t t = 0; t < touches.size(); ++t) {
    const auto& way = touches[t].way;
    for (std::size_t w = 0; w < way.size(); ++w)
      faults.look(way[w], [&] {
        return fmt::format("point {} of {}, place {} of {} on the way to it", t + 1, touches.size(),
                           w + 1, way.size());
      });
    faults.look(touches[t].point,
                [&] { return fmt::format("point {} of {}", t + 1, touches.size()); });
  }
  for (std::size_t l = 0; l < leave.size(); ++l)
    faults.look(leave[l],
                [&] { return fmt::format("place {} of {} on the way out", l + 1, leave.size()); });

  return faults.result();
}

}  // namespace abbe::daemon
