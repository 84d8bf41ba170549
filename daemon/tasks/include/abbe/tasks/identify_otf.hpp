#pragma once
/// Identifies a model from laser tracker points along a path: of one run from files, of a
/// recording, or of runs with several targets.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tasks/identified_model.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// Arguments as given by the user: file names and values.
struct IdentifyOtfArguments {
  std::string machine, path, tracker, encoder, recording, keep, mode, tables;
  std::optional<std::string> estimator;  // default: the value of [otf]
  std::size_t segment_samples = 0;       // 0: segments are formed by travel
  std::optional<double> u_scale_ppm;     // default: the value of the configured tracker
  std::string backlash;                  // empty: as in [otf]
  std::string smoothness;                // empty: as in [otf]
  double encoder_u_time_us = 20.0;       // standard uncertainty of the time of a scale reading
  bool scales_corrected = false, accept_path_orientation = false;
  std::vector<std::string> accept{};         // see accept_also()
  std::vector<std::string> targets;          // X,Y,Z=FILE, one per run
  std::vector<std::string> tracker_centres;  // elements of --tracker-centre-mm, "X,Y,Z"
  // default: the values of the configuration
  std::optional<calib::Vector3> target_offset_m{}, tracker_position_m{};
  /// Position of the tracker in the frame of the points x_mm, y_mm, z_mm. One element for all
  /// files, or one per target.
  std::vector<calib::Vector3> tracker_centres_m{};
  std::string centre_option = "--tracker-centre-mm X,Y,Z";
  /// Information that files of other programs do not contain: for exported points, and for a log of
  /// camonitor.
  std::string tracker_unit{}, encoder_unit{};
  std::optional<double> tracker_points_per_s{};
  std::vector<std::string> encoder_pvs{};  // X=NAME, Y=NAME, Z=NAME
  /// The element for the file of a target; for a single run `file` is 0.
  [[nodiscard]] std::optional<calib::Vector3> tracker_centre_m(std::size_t file) const {
    if (tracker_centres_m.empty()) return std::nullopt;
    return tracker_centres_m.size() > 1 ? tracker_centres_m.at(file) : tracker_centres_m.front();
  }
};

struct OtfOutcome {
  ModelDocument document;
  calib::Verdict verdict;
  std::size_t segments = 0, segments_used = 0;
  std::vector<calib::otf::RangeOffset> range_offsets;  ///< one per run
  std::optional<calib::otf::Synchronisation> synchronisation{};
  std::optional<calib::otf::Smoothness> smoothness{};
};

/// The text of the stage that Progress shows.
[[nodiscard]] std::string_view words(calib::otf::Stage stage);

/// A run from files or from a recording, identified and judged.
struct OtfFromFiles {
  Config config;
  std::vector<InputFile> sources;
  calib::otf::Noise noise;
  calib::otf::Mode mode = calib::otf::Mode::OnTheFly;
  calib::otf::Identification found;
  calib::Verdict verdict;
  std::vector<RunResiduals> residuals;
};
/// Identifies one run from the files --machine, --path, --tracker and --encoder.
[[nodiscard]] Result<OtfFromFiles> identify_files(const IdentifyOtfArguments& arguments,
                                                  const std::optional<ActiveDocument>& active,
                                                  const Progress& progress);

/// Identifies the last complete run of --recording with the configuration --machine. The recorded
/// configuration states how the run was acquired. It also states the reflector and the tracker
/// position, unless the arguments state others.
[[nodiscard]] Result<OtfFromFiles> identify_recorded(const IdentifyOtfArguments& arguments,
                                                     const Progress& progress);

/// Identifies the run that the arguments name: from several targets, from files or from a
/// recording. Usage if arguments are missing or contradict each other.
[[nodiscard]] Result<OtfOutcome> identify_otf_from(IdentifyOtfArguments arguments,
                                                   const Progress& progress);

}  // namespace abbe::daemon
