#include "abbe/tables/input_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "abbe/base/parsed_table.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/result/try.hpp"
#include "repeated_points.hpp"

namespace abbe::daemon {

namespace {

constexpr double kSecondsPerMinute = 60.0;

AxisPosition position_m(const NumberTable& table, std::size_t row, std::size_t first) {
  return {table.at(row, first) / kMmPerM, table.at(row, first + 1) / kMmPerM,
          table.at(row, first + 2) / kMmPerM};
}

/// Directions in three columns with the words "-", "0", "+".
calib::AxisTravel travel_in_row(const NumberTable& table, std::size_t row, std::size_t first) {
  calib::AxisTravel all{};
  for (std::size_t axis = 0; axis < all.size(); ++axis)
    all[axis] = static_cast<calib::Travel>(std::lround(table.at(row, first + axis)) - 1);
  return all;
}

// The check_...() functions below skip rows that already have a fault.

void check_time_ascends(ParsedTable& parsed) {
  const auto& table = parsed.table;
  std::optional<double> before_s;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (!table.sound(row)) continue;
    const double time_s = table.at(row, 0);
    if (before_s && time_s <= *before_s)
      parsed.faults.add_kind("ascend", table.line(row), 1, "time_s",
                             fmt::format("{} after {}: time must ascend", time_s, *before_s));
    before_s = time_s;
  }
}

void check_path(ParsedTable& parsed) {
  const auto& table = parsed.table;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (!table.sound(row)) continue;
    if (row > 0 && table.sound(row - 1) &&
        position_m(table, row, 0) == position_m(table, row - 1, 0))
      parsed.faults.add(table.line(row), 1, "", "the same vertex as in the row before");
    if (table.has(3) && table.at(row, 3) <= 0.0)
      parsed.faults.add(table.line(row), 1, "feed_mm_per_min", "must be positive");
  }
}

// Variants of the columns of tracker.csv.
constexpr std::size_t kSpherical = 0, kTrackerFrame = 1, kUnstatedFrame = 2;

struct Limits {
  double least = 0.0, most = 0.0;
  [[nodiscard]] bool contain(const Limits& other) const {
    return least <= other.least && other.most <= most;
  }
};

/// The smallest and the largest value of a column.
Limits limits_of(const NumberTable& table, std::size_t column) {
  Limits found{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (!table.sound(row)) continue;
    found.least = std::min(found.least, table.at(row, column));
    found.most = std::max(found.most, table.at(row, column));
  }
  return found;
}

/// Text that names the unit in which all angles of a column would be possible, "; they fit as
/// degrees". Empty if there is none.
std::string azimuths_fit_as(const Limits& found) {
  if (Limits{-360.0, 360.0}.contain(found)) return "; they fit as degrees, or as gon";
  if (Limits{-400.0, 400.0}.contain(found)) return "; they fit as gon";
  return {};
}

std::string elevations_fit_as(const Limits& found, bool other_unit) {
  constexpr Limits kZenith{0.0, std::numbers::pi};
  if (!other_unit && kZenith.contain(found)) return "; they fit as zenith angles";
  if (Limits{-90.0, 90.0}.contain(found)) return "; they fit as degrees, or as gon";
  if (Limits{0.0, 180.0}.contain(found)) return "; they fit as zenith angles in degrees";
  if (Limits{-100.0, 100.0}.contain(found)) return "; they fit as gon";
  if (Limits{0.0, 200.0}.contain(found)) return "; they fit as zenith angles in gon";
  return {};
}

void check_spherical(ParsedTable& parsed) {
  constexpr std::size_t kAzimuth = 2, kElevation = 3;
  const auto& table = parsed.table;
  if (table.form() != kSpherical) return;
  const Limits azimuth = limits_of(table, kAzimuth);
  const bool other_unit =
      std::max(std::abs(azimuth.least), std::abs(azimuth.most)) > 2.0 * std::numbers::pi;
  const std::string azimuths = azimuths_fit_as(azimuth),
                    elevations = elevations_fit_as(limits_of(table, kElevation), other_unit);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (!table.sound(row)) continue;
    if (table.at(row, 1) <= 0.0)
      parsed.faults.add(table.line(row), 1, "range_mm", "must be positive");
    if (std::abs(table.at(row, kAzimuth)) > 2.0 * std::numbers::pi)
      parsed.faults.add(table.line(row), 1, "azimuth_rad", "more than one revolution" + azimuths);
    if (std::abs(table.at(row, kElevation)) > std::numbers::pi / 2.0)
      parsed.faults.add(table.line(row), 1, "elevation_rad", "beyond the vertical" + elevations);
  }
}

/// The times of a table that has at least one row and whose first column is the time.
TimesOfFile times_of(const NumberTable& table) {
  return {.first_time_s = table.at(0, 0),
          .first_line = table.line(0),
          .last_line = table.line(table.rows() - 1)};
}

calib::otf::TrackerObservation observation(const NumberTable& table, std::size_t row) {
  // emScon point status "speed warning", the highest status of a valid point
  constexpr double kSpeedWarning = 1.0;
  calib::otf::TrackerObservation point;
  point.time_s = table.at(row, 0) - table.at(0, 0);
  point.valid = table.at(row, 4) >= 0.0 && table.at(row, 4) <= kSpeedWarning;

  if (table.form() == kSpherical) {
    point.p_tracker_m =
        calib::from_spherical(table.at(row, 1) / kMmPerM, table.at(row, 2), table.at(row, 3));
  } else {
    const auto p_m = position_m(table, row, 1);
    point.p_tracker_m = calib::Vector3(p_m[0], p_m[1], p_m[2]);
  }

  return point;
}

}  // namespace

Result<PathFile> read_path_csv(const std::filesystem::path& file) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  return parse_path_csv(*text, file);
}

Result<PathFile> parse_path_csv(std::string_view text, const std::filesystem::path& file) {
  auto parsed =
      parse_table(text, file,
                  {{{"x_mm"},
                    {"y_mm"},
                    {"z_mm"},
                    {.name = "feed_mm_per_min", .required = false, .may_be_empty = true}}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 2, "vertices");
  check_path(*parsed);
  if (parsed->faults.any()) return tl::make_unexpected(parsed->faults.to_error());
  const auto& table = parsed->table;
  PathFile path{parsed->source, {}, {}, {}};

  for (std::size_t row = 0; row < table.rows(); ++row) {
    path.vertices_m.push_back(position_m(table, row, 0));
    path.lines.push_back(table.line(row));
    if (table.has(3)) path.feed_m_per_s.push_back(table.at(row, 3) / kMmPerM / kSecondsPerMinute);
  }

  return path;
}

Result<TrackerFile> read_tracker_csv(const std::filesystem::path& file,
                                     const ReadProgress& progress) {
  auto parsed = parse_table(
      file,
      {{{"time_s"}, {"range_mm"}, {"azimuth_rad"}, {"elevation_rad"}, {"status", false}},
       {{"time_s"}, {"tracker_x_mm"}, {"tracker_y_mm"}, {"tracker_z_mm"}, {"status", false}},
       {{"time_s"}, {"x_mm"}, {"y_mm"}, {"z_mm"}, {"status", false}}},
      progress);
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "points");
  check_time_ascends(*parsed);
  check_spherical(*parsed);
  if (parsed->faults.any()) return tl::make_unexpected(parsed->faults.to_error());
  TrackerFile tracker{parsed->source, {}, times_of(parsed->table)};
  if (parsed->table.form() == kTrackerFrame) tracker.frame = TrackerFile::Frame::Tracker;
  if (parsed->table.form() == kUnstatedFrame) tracker.frame = TrackerFile::Frame::Unstated;
  tracker.points.reserve(parsed->table.rows());
  for (std::size_t row = 0; row < parsed->table.rows(); ++row)
    tracker.points.push_back(observation(parsed->table, row));

  return tracker;
}

namespace {

/// Checks the distances of the points: a tracker cannot measure a reflector that is nearer than a
/// limit.
Result<void> check_distances(const TrackerFile& points, const std::filesystem::path& file,
                             std::string_view where, std::string_view advice) {
  constexpr double kNearest_m = 0.2;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const auto& point : points.points)
    if (point.valid) nearest_m = std::min(nearest_m, point.p_tracker_m.norm());
  if (nearest_m >= kNearest_m) return {};
  return fail(ErrorCode::BadInput,
              fmt::format("{}: a point is {:.0f} mm from the tracker, {}, and no tracker measures "
                          "nearer than {:.0f} mm. {}",
                          file.string(), nearest_m * kMmPerM, where, kNearest_m * kMmPerM, advice));
}

}  // namespace

Result<void> place_tracker(TrackerFile& points, const std::optional<calib::Vector3>& centre_m,
                           const std::filesystem::path& file, std::string_view option) {
  if (points.frame == TrackerFile::Frame::Spherical && !centre_m) return {};
  if (points.frame != TrackerFile::Frame::Unstated) {
    if (!centre_m)
      return check_distances(points, file, "the origin of tracker_x_mm, tracker_y_mm, tracker_z_mm",
                             "Points in another frame, as of the machine or a station, have the "
                             "columns x_mm, y_mm, z_mm");
    return fail(ErrorCode::BadInput,
                fmt::format("{}: its points are in the frame of the tracker; leave out {}",
                            file.string(), option));
  }
  if (!centre_m)
    return fail(
        ErrorCode::BadInput,
        fmt::format(
            "{}: the columns x_mm, y_mm, z_mm do not state their frame, and noise and offset of "
            "the ranges act along the beams. Points in the frame of the tracker: name the columns "
            "tracker_x_mm, tracker_y_mm, tracker_z_mm. Points exported in machine or station "
            "coordinates: state with {} where the tracker stands in them",
            file.string(), option));

  for (auto& point : points.points) point.p_tracker_m -= *centre_m;
  points.frame = TrackerFile::Frame::Parallel;
  points.centre_m = *centre_m;
  return check_distances(points, file, fmt::format("stated with {}", option),
                         "State its centre in the frame of the points");
}

Result<EncoderFile> read_encoder_csv(const std::filesystem::path& file,
                                     const ReadProgress& progress) {
  auto parsed = parse_table(file, {{{"time_s"}, {"x_mm"}, {"y_mm"}, {"z_mm"}}}, progress);
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "readings");
  check_time_ascends(*parsed);
  if (parsed->faults.any()) return tl::make_unexpected(parsed->faults.to_error());
  EncoderFile encoder{parsed->source, {}, times_of(parsed->table)};
  encoder.rows.reserve(parsed->table.rows());
  for (std::size_t row = 0; row < parsed->table.rows(); ++row)
    encoder.rows.push_back(
        {parsed->table.at(row, 0) - encoder.times.first_time_s, position_m(parsed->table, row, 1)});
  return encoder;
}

Result<PointsFile> read_points_csv(const std::filesystem::path& file) {
  constexpr std::size_t kWithDirection = 1;  // index of this variant of the file format
  const auto direction = [](std::string_view name) {
    return protocol::ColumnRule{.name = name, .words = {"-", "0", "+"}};
  };
  auto parsed = parse_table(
      file, {{{"x_mm"}, {"y_mm"}, {"z_mm"}},
             {{"x_mm"}, {"y_mm"}, {"z_mm"}, direction("dx"), direction("dy"), direction("dz")}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "points");
  if (parsed->faults.any()) return tl::make_unexpected(parsed->faults.to_error());

  const auto& table = parsed->table;
  PointsFile points{parsed->source, {}, {}};
  for (std::size_t row = 0; row < table.rows(); ++row) {
    points.points_m.push_back(position_m(table, row, 0));
    if (table.form() == kWithDirection) points.travel.push_back(travel_in_row(table, row, 3));
  }
  return points;
}

Result<VerificationFile> read_verification_csv(const std::filesystem::path& file) {
  auto parsed = parse_table(
      file, {{{"x_mm"}, {"y_mm"}, {"z_mm"}, {"tracker_x_mm"}, {"tracker_y_mm"}, {"tracker_z_mm"}}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "points");
  if (parsed->faults.any()) return tl::make_unexpected(parsed->faults.to_error());
  const auto& table = parsed->table;
  VerificationFile out{parsed->source};

  const auto vector_m = [&](std::size_t row, std::size_t first) {
    const auto p = position_m(table, row, first);
    return calib::Vector3(p[0], p[1], p[2]);
  };

  for (std::size_t row = 0; row < table.rows(); ++row) {
    out.points.push_back({vector_m(row, 0), vector_m(row, 3)});
    out.lines.push_back(table.line(row));
  }

  leave_out_repeated(out);
  return out;
}

void leave_out_repeated(VerificationFile& file) {
  std::set<std::array<double, 6>> seen;
  VerificationFile kept{file.source};
  for (std::size_t i = 0; i < file.points.size(); ++i) {
    const auto& [q, p] = file.points[i];
    if (!seen.insert({q.x(), q.y(), q.z(), p.x(), p.y(), p.z()}).second) continue;
    kept.points.push_back(file.points[i]);
    kept.lines.push_back(file.lines[i]);
  }
  file.repeated = file.points.size() - kept.points.size();
  file.points = std::move(kept.points);
  file.lines = std::move(kept.lines);
}

std::string to_verification_csv(std::span<const calib::verify::MeasuredPoint> points) {
  std::string text = "x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
  for (const auto& p : points) {
    const calib::Vector3 reading_mm = kMmPerM * p.reading_m, measured_mm = kMmPerM * p.measured_m;
    text += fmt::format("{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", reading_mm.x(),
                        reading_mm.y(), reading_mm.z(), measured_mm.x(), measured_mm.y(),
                        measured_mm.z());
  }
  return text;
}

}  // namespace abbe::daemon
