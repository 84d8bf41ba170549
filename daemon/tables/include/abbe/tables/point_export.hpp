#pragma once
/// Points that another program exported as text: SpatialAnalyzer (ASCII), PolyWorks, and other
/// lists of names and coordinates. docs/files.md describes the formats and their sources. Faults as
/// in input_files.hpp.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

struct ExportedPoint {
  std::string group;  ///< collection and group, as in the file; may be empty
  std::string name;   ///< may be empty
  calib::Vector3 p_m = calib::Vector3::Zero();
  std::optional<double> time_s{};
  std::size_t line = 0;
};

struct PointExport {
  InputFile source;
  std::string frame;  ///< name of the frame in the file; may be empty
  std::vector<ExportedPoint> points;
};

/// Information in the comments of SpatialAnalyzer, or in a heading, at the beginning of a file.
/// Every member may be empty.
struct PointExportHeader {
  std::string frame, unit;  ///< `unit`: a word of metres_per(); empty if it is not known
};
[[nodiscard]] PointExportHeader point_export_header(std::string_view text);

/// True for a text with the comments of SpatialAnalyzer, with a heading that names X, Y and Z, or
/// with a name before three numbers. A list of numbers alone is not recognised.
[[nodiscard]] bool is_point_export(std::string_view text);

/// `unit`: a word of metres_per(). If the file states a unit, it must be the same. Faults are
/// columns that are not known, coordinates that are not Cartesian, and a point that occurs twice in
/// a group.
[[nodiscard]] Result<PointExport> parse_point_export(std::string_view text,
                                                     const std::filesystem::path& file,
                                                     std::string_view unit);

/// Converts the points to the form of a tracker.csv with columns x_mm, y_mm, z_mm; place_tracker()
/// then moves them. The times are those of the file, or i / `points_per_s`. Faults are missing
/// times and times that do not ascend. With `points_per_s`, a step of more than three times its
/// neighbours and more than 0.2 mm is a fault, too, because points are then missing.
[[nodiscard]] Result<TrackerFile> tracker_of_export(const PointExport& points,
                                                    const std::filesystem::path& file,
                                                    std::optional<double> points_per_s);

/// The points with the scale readings at which they were measured: rows of `readings_file` with
/// `name,x_mm,y_mm,z_mm`, or with `x_mm,y_mm,z_mm` in the order of the points. Points of different
/// groups may have the same name: they are measurements of one place. Faults are a point without
/// reading, and a name that occurs twice or is not in the export.
[[nodiscard]] Result<VerificationFile> verification_of_export(
    const PointExport& points, const std::filesystem::path& file,
    const std::filesystem::path& readings_file);

}  // namespace abbe::daemon
