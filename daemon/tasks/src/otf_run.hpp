#pragma once
/// Functions for the identification of one run, of a recording and of several targets.

#include <optional>
#include <string>
#include <vector>

#include "abbe/tasks/identify_otf.hpp"

namespace abbe::daemon {

[[nodiscard]] OtfOutcome outcome_of(OtfCandidate candidate, const Config& config,
                                    std::vector<InputFile> sources);

struct MachineAndPath {
  Config config;
  PathFile path;
  std::vector<InputFile> sources;  ///< both files
};
/// Reads --machine and --path.
[[nodiscard]] Result<MachineAndPath> read_machine_and_path(const IdentifyOtfArguments& arguments);

/// The value of --u-scale-ppm, or that of the configured tracker; 0 if neither is given.
[[nodiscard]] double u_scale_of(const IdentifyOtfArguments& arguments, const Config& config);

/// Sets the prior for smooth tables as --smoothness-um (`text`) states: none, UM or
/// UM_X,UM_Y,UM_Z. Error Usage for another text.
[[nodiscard]] Result<void> apply_smoothness(const std::string& text, Config& config);
/// Replaces settings of the configuration by the options of the command, except --smoothness-um.
void apply(const IdentifyOtfArguments& arguments, Config& config);

/// Adds a refusal to the verdict if the noise of the points contradicts the place of the tracker
/// that the points state. The gate may be configured to accept such a model.
void judge_beams(const TrackerFile& points, const calib::otf::Observations& observations,
                 const calib::otf::Solution& solution, const GateConfig& gate,
                 calib::Verdict& verdict);
/// Adapts the options to the frame of the points: if it is not the frame of the tracker, the
/// vertical of the tracker is unknown. Error if there are reference nests, because their positions
/// are in the frame of the tracker.
[[nodiscard]] Result<void> apply_frame(const TrackerFile& points, const std::string& file,
                                       calib::otf::Options& options);

/// Makes the checks of the path that the daemon makes before the machine moves. The message for a
/// vertex outside the travel gives line and column.
[[nodiscard]] Result<void> check_path(const std::string& file, const PathFile& path,
                                      const Config& config);

/// Identifies the last complete run of --recording.
[[nodiscard]] Result<OtfOutcome> from_recording(const IdentifyOtfArguments& arguments,
                                                const std::optional<ActiveDocument>& active,
                                                const Progress& progress);

/// Identifies all 18 tables from the runs of --target-mm.
[[nodiscard]] Result<OtfOutcome> from_targets(const IdentifyOtfArguments& arguments,
                                              const std::optional<ActiveDocument>& active,
                                              const Progress& progress);

}  // namespace abbe::daemon
