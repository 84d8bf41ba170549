#pragma once
/// What lines of text can hold, each as one type that LineReceiverOf and LineDevice use: the format
/// of a line, its sample, and how the values of a line become the sample. Pure.

#include <chrono>
#include <cstdint>
#include <string_view>

#include "abbe/protocol/lines/tracker_line.hpp"
#include "abbe/protocol/lines/value_line.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace lines = protocol::lines;

/// Words of messages.
struct LineWords {
  std::string_view device;  ///< its usual name
  std::string_view one, many;
  std::string_view rate_key;  ///< of the configuration
};

/// Points of a tracker.
struct LinePoints {
  using Format = lines::LineFormat;
  using Line = lines::TrackerLine;
  using Sample = protocol::TrackerPoint;
  static constexpr LineWords kWords{"tracker", "point", "points", "point_rate_hz"};
  static constexpr std::chrono::milliseconds kUsualDuration{500};
  /// A point whose time does not fit is a sample that is marked PointInvalid.
  static constexpr bool kKeepsRefused = true;
  /// Format without a time column: of the lines of one read only the newest is used. The others are
  /// older than their arrival shows, and two samples would have one instant.
  static constexpr bool kNewestOfRead = false;
  /// An invalid status is a condition of the device, not of single points.
  static constexpr bool kStatusIsCondition = false;

  [[nodiscard]] static bool has_time(const Format& format) ABBE_RT {
    return format.has(lines::Column::Time);
  }
  /// Sets all of `sample` but its time; `number`: of the line, since start.
  static void fill(const Line& line, const Format& format, std::uint32_t number,
                   Sample& sample) ABBE_RT;
};

/// Positions of axes: value i of a line is axis i.
struct LineAxes {
  using Format = lines::ValueFormat;
  using Line = lines::ValueLine;
  using Sample = protocol::AxisSample;
  static constexpr LineWords kWords{"axes", "position", "positions", "sample_rate_hz"};
  static constexpr std::chrono::nanoseconds kUsualDuration{0};
  static constexpr bool kKeepsRefused = false;
  static constexpr bool kNewestOfRead = true;
  static constexpr bool kStatusIsCondition = true;
  /// AxisSample::count of a line: its position in this unit, m or rad.
  static constexpr double kCount = 1e-9;

  [[nodiscard]] static bool has_time(const Format& format) ABBE_RT {
    return format.has(lines::ColumnUse::Time);
  }
  static void fill(const Line& line, const Format& format, std::uint32_t number,
                   Sample& sample) ABBE_RT;
};

}  // namespace abbe::drivers
