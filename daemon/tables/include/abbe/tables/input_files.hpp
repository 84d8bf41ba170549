#pragma once
/// The CSV files people hand to abbe, read into SI. Every reader gives all faults of a file at once
/// (at most 20, each "file:line:column: column name: what is wrong") and nothing of a file that has
/// one: NaN and infinity, a missing or unknown column, a row too short or too long, time that does
/// not ascend, a last line that does not end. Comma, one header row, lines that begin with # are
/// comments, decimal point. Functions, safe from any thread.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/otf/run.hpp"
#include "abbe/calib/verify/observe.hpp"

namespace abbe::daemon {

/// path.csv: `x_mm,y_mm,z_mm[,feed_mm_per_min]`, at least two vertices, no two neighbours equal.
struct PathFile {
  InputFile source;
  std::vector<AxisPosition> vertices_m;
  std::vector<double>
      feed_m_per_s;  ///< as long as vertices_m, or empty if the file has no such column
  std::vector<std::size_t> lines;  ///< of the vertices in the file
};
[[nodiscard]] Result<PathFile> read_path_csv(const std::filesystem::path& file);

/// tracker.csv: `time_s,range_mm,azimuth_rad,elevation_rad[,status]` or
/// `time_s,x_mm,y_mm,z_mm[,status]`. Status is the device's: 0 good, 1 speed warning (still good),
/// others mark a point that holds its place but is not used.
struct TrackerFile {
  InputFile source;
  std::vector<calib::otf::TrackerObservation> points;
};
[[nodiscard]] Result<TrackerFile> read_tracker_csv(const std::filesystem::path& file,
                                                   const ReadProgress& progress = {});

/// encoder.csv: `time_s,x_mm,y_mm,z_mm`, machine clock.
struct EncoderRow {
  double time_s = 0.0;
  AxisPosition reading_m{};
};
struct EncoderFile {
  InputFile source;
  std::vector<EncoderRow> rows;
};
[[nodiscard]] Result<EncoderFile> read_encoder_csv(const std::filesystem::path& file,
                                                   const ReadProgress& progress = {});

/// points.csv: `x_mm,y_mm,z_mm`, scale readings, at least one.
struct PointsFile {
  InputFile source;
  std::vector<AxisPosition> points_m;
};
[[nodiscard]] Result<PointsFile> read_points_csv(const std::filesystem::path& file);

/// verification.csv: `x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm`: scale reading and
/// independent measurement there, each in its own frame; at least one.
struct VerificationFile {
  InputFile source;
  std::vector<calib::verify::MeasuredPoint> points;
  std::vector<std::size_t> lines;  ///< where each stands in the file; empty for points out of none
};
[[nodiscard]] Result<VerificationFile> read_verification_csv(const std::filesystem::path& file);
[[nodiscard]] std::string to_verification_csv(std::span<const calib::verify::MeasuredPoint> points);

}  // namespace abbe::daemon
