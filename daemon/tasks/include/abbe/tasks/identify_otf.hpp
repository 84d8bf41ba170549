#pragma once
/// A model from laser tracker points along a path: of one run, of a recording, of several targets.

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

/// File names and values as a person gives them.
struct IdentifyOtfArguments {
  std::string machine, path, tracker, encoder, recording, keep, mode, tables;
  std::optional<std::string> estimator;  // without a value: that of [otf]
  std::size_t segment_samples = 0;       // 0: segments by travel
  std::optional<double> u_scale_ppm;     // without a value: that of the configured tracker
  std::string backlash;                  // empty: that of [otf]
  std::string smoothness;                // empty: that of [otf]
  double encoder_u_time_us = 20.0;       // standard uncertainty of the time of a scale reading
  bool scales_corrected = false, accept_path_orientation = false;
  std::vector<std::string> targets;          // X,Y,Z=FILE, one per run
  std::vector<std::string> tracker_centres;  // X,Y,Z of --tracker-centre-mm
  // without a value: those of the configuration
  std::optional<calib::Vector3> target_offset_m{}, tracker_position_m{};
  /// The tracker in the frame of points x_mm, y_mm, z_mm: of all files, or one per target.
  std::vector<calib::Vector3> tracker_centres_m{};
  std::string centre_option = "--tracker-centre-mm X,Y,Z";
  /// What files of other programs do not state: points that were exported, a log of camonitor.
  std::string tracker_unit{}, encoder_unit{};
  std::optional<double> tracker_points_per_s{};
  std::vector<std::string> encoder_pvs{};  // X=NAME, Y=NAME, Z=NAME
  /// Of the file of a target; of one run: 0.
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

/// For Progress.
[[nodiscard]] std::string_view words(calib::otf::Stage stage);

/// A run that was identified and judged, from files.
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
/// configuration states how the run was acquired, and its reflector and tracker position, unless
/// the arguments state others.
[[nodiscard]] Result<OtfFromFiles> identify_recorded(const IdentifyOtfArguments& arguments,
                                                     const Progress& progress);

/// The model of the run of the arguments: from several targets, files or a recording. Usage for
/// arguments that are missing or contradict each other.
[[nodiscard]] Result<OtfOutcome> identify_otf_from(IdentifyOtfArguments arguments,
                                                   const Progress& progress);

}  // namespace abbe::daemon
