#pragma once
/// Reads the CSV files of the user and converts to SI. A reader reports all faults of a file at
/// once (at most 20, each "file:line:column: column name: what is wrong"); a file with a fault is
/// not used at all. Faults are NaN and infinity, a missing or unknown column, a row with too few or
/// too many values, times that do not ascend, and a last line without newline. Format: comma as
/// separator, decimal point, one header row; lines that begin with # are comments. The functions
/// may be called from any thread.

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/geometry/machine_state.hpp"
#include "abbe/calib/otf/run/run.hpp"
#include "abbe/calib/verify/observe.hpp"

namespace abbe::daemon {

/// path.csv: `x_mm,y_mm,z_mm[,feed_mm_per_min]`, at least two vertices; consecutive vertices
/// differ.
struct PathFile {
  InputFile source;
  std::vector<AxisPosition> vertices_m;
  /// The feed at each vertex; NaN for an empty cell. Empty vector if the file has no column
  /// feed_mm_per_min.
  std::vector<double> feed_m_per_s;
  std::vector<std::size_t> lines;  ///< line in the file, one per vertex
};
[[nodiscard]] Result<PathFile> read_path_csv(const std::filesystem::path& file);
/// Same as read_path_csv() for the content of a file; `file` is its name in messages.
[[nodiscard]] Result<PathFile> parse_path_csv(std::string_view text,
                                              const std::filesystem::path& file);

/// The times in a file are relative to the time of its first row. Absolute times since 1970 would
/// lose accuracy in sums (steps of 0.24 us). The subtraction is exact.
struct TimesOfFile {
  double first_time_s = 0.0;  ///< time of the first row as in the file
  std::size_t first_line = 0, last_line = 0;
};

/// tracker.csv: `time_s,range_mm,azimuth_rad,elevation_rad[,status]`,
/// `time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm[,status]`, or `time_s,x_mm,y_mm,z_mm[,status]` in
/// a frame that the file does not state: see place_tracker(). Status of the device: 0 valid, 1
/// speed warning (valid); a point with another status remains in the sequence but is not used.
struct TrackerFile {
  InputFile source;
  std::vector<calib::otf::TrackerObservation> points;  ///< times: since the first point
  TimesOfFile times{};
  enum class Frame {
    Spherical,
    Tracker,   ///< columns tracker_x_mm, tracker_y_mm, tracker_z_mm
    Unstated,  ///< columns x_mm, y_mm, z_mm
    /// after place_tracker(): the tracker is at the origin, the axes are those of the frame of the
    /// file
    Parallel,
  };
  Frame frame = Frame::Spherical;
  /// position of the tracker in the frame of the file
  calib::Vector3 centre_m = calib::Vector3::Zero();
};
/// Moves the points of a file with x_mm, y_mm, z_mm so that the tracker, which is at `centre_m` of
/// their frame, is at their origin: noise and offset of the ranges act along the beams. `option`:
/// the option that states `centre_m`, for messages. BadInput if `centre_m` is missing, if it is
/// given for a file in the frame of the tracker, or if a point would be nearer to the tracker than
/// 0.2 m.
[[nodiscard]] Result<void> place_tracker(TrackerFile& points,
                                         const std::optional<calib::Vector3>& centre_m,
                                         const std::filesystem::path& file,
                                         std::string_view option);
[[nodiscard]] Result<TrackerFile> read_tracker_csv(const std::filesystem::path& file,
                                                   const ReadProgress& progress = {});

/// One row of encoder.csv: `time_s,x_mm,y_mm,z_mm`, time of the machine's clock since the first
/// row, and scale readings.
struct EncoderRow {
  double time_s = 0.0;
  AxisPosition reading_m{};
};
struct EncoderFile {
  InputFile source;
  std::vector<EncoderRow> rows;
  TimesOfFile times{};
};
[[nodiscard]] Result<EncoderFile> read_encoder_csv(const std::filesystem::path& file,
                                                   const ReadProgress& progress = {});

/// points.csv: `x_mm,y_mm,z_mm[,dx,dy,dz]`, scale readings, at least one row. dx, dy, dz: direction
/// in which the axis last moved, `+`, `-`, or `0` if it is not known.
struct PointsFile {
  InputFile source;
  std::vector<AxisPosition> points_m;
  std::vector<calib::AxisTravel> travel;  ///< empty without the columns dx, dy, dz
};
[[nodiscard]] Result<PointsFile> read_points_csv(const std::filesystem::path& file);

/// verification.csv: `x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm`: scale reading, and
/// the independent measurement of the same point in the frame of the tracker; at least one row. A
/// row that repeats an earlier row in every digit is not another measurement: it counts once.
struct VerificationFile {
  InputFile source;
  std::vector<calib::verify::MeasuredPoint> points{};
  /// line of each point in the file; empty if the points do not come from a file
  std::vector<std::size_t> lines{};
  std::size_t repeated = 0;  ///< rows left out because they repeat another row
  /// file with the readings of points that another program exported
  std::optional<InputFile> readings{};
};
[[nodiscard]] Result<VerificationFile> read_verification_csv(const std::filesystem::path& file);
[[nodiscard]] std::string to_verification_csv(std::span<const calib::verify::MeasuredPoint> points);

}  // namespace abbe::daemon
