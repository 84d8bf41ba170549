#pragma once
/// What `abbe identify otf` has in common for one run, a recording, and several targets.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/otf/identification.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tables/input_files.hpp"
#include "identified_model.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

struct IdentifyOtfArguments {
  std::string machine, path, tracker, encoder, recording, keep, out, mode, tables;
  std::optional<std::string> estimator;  // without a value: that of [otf]
  std::size_t block_samples = 0;         // 0: blocks by travel
  std::optional<double> u_scale_ppm;     // without a value: that of the configured tracker
  std::string backlash;                  // empty: that of [otf]
  std::string smoothness;                // empty: that of [otf]
  double encoder_u_time_us = 20.0;       // standard uncertainty of the time of a scale reading
  bool scales_corrected = false, accept_path_orientation = false;
  bool json = false;
  std::vector<std::string> targets;          // X,Y,Z=FILE, one per run
  std::vector<std::string> tracker_centres;  // X,Y,Z of --tracker-centre-mm
  // without a value: those of the configuration
  std::optional<calib::Vector3> target_offset_m{}, tracker_position_m{};
  /// The tracker in the frame of points x_mm, y_mm, z_mm: of all files, or one per target.
  std::vector<calib::Vector3> tracker_centres_m{};
  std::string centre_option = "--tracker-centre-mm X,Y,Z";
  /// Of the file of a target; of one run: 0.
  [[nodiscard]] std::optional<calib::Vector3> tracker_centre_m(std::size_t file) const {
    if (tracker_centres_m.empty()) return std::nullopt;
    return tracker_centres_m.size() > 1 ? tracker_centres_m.at(file) : tracker_centres_m.front();
  }
};

struct OtfOutcome {
  ModelDocument document;
  calib::Verdict verdict;
  std::size_t blocks = 0, blocks_used = 0;
  std::vector<calib::otf::RangeOffset> range_offsets;  ///< one per run
  std::optional<calib::otf::Synchronisation> synchronisation{};
  std::optional<calib::otf::Smoothness> smoothness{};
};

/// Words of the progress bar.
[[nodiscard]] std::string_view words(calib::otf::Stage stage);

[[nodiscard]] OtfOutcome outcome_of(OtfCandidate candidate, const Config& config,
                                    std::vector<InputFile> sources);

/// --u-scale-ppm, or that of the configured tracker; 0 without both.
[[nodiscard]] double u_scale_of(const IdentifyOtfArguments& arguments, const Config& config);

/// Sets the prior for smooth tables as --smoothness (`text`) states: none, UM or
/// UM_X,UM_Y,UM_Z. Error Usage for another text.
[[nodiscard]] Result<void> apply_smoothness(const std::string& text, Config& config);
/// The options of the command replace those of the configuration; --smoothness apart.
void apply(const IdentifyOtfArguments& arguments, Config& config);

/// Refuses the model of a run whose points state a place of the tracker that their noise
/// contradicts, unless the gate accepts it.
void judge_beams(const TrackerFile& points, const calib::otf::Observations& observations,
                 const calib::otf::Solution& solution, const GateConfig& gate,
                 calib::Verdict& verdict);
/// What the frame of the points leaves of the options: the vertical of the tracker is unknown in
/// another frame. Error for reference nests, whose positions are in the frame of the tracker.
[[nodiscard]] Result<void> apply_frame(const TrackerFile& points, const std::string& file,
                                       calib::otf::Options& options);

/// Makes the checks of the path that the daemon makes before the machine drives. The message for a
/// vertex outside the travel gives line and column.
[[nodiscard]] Result<void> check_path(const std::string& file, const PathFile& path,
                                      const Config& config);

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
                                                  ProgressBar& bar);

/// Identifies the last complete run of --recording with the configuration --machine. The recorded
/// configuration states how the run was acquired, and its reflector and tracker position, unless
/// the arguments state others.
[[nodiscard]] Result<OtfFromFiles> identify_recorded(const IdentifyOtfArguments& arguments,
                                                     ProgressBar& bar);

/// Identifies the last complete run of --recording.
[[nodiscard]] Result<OtfOutcome> from_recording(const IdentifyOtfArguments& arguments,
                                                const std::optional<ActiveDocument>& active,
                                                ProgressBar& bar);

/// Identifies all 18 tables from the runs of --target.
[[nodiscard]] Result<OtfOutcome> from_targets(const IdentifyOtfArguments& arguments,
                                              const std::optional<ActiveDocument>& active,
                                              ProgressBar& bar);

}  // namespace abbe::daemon
