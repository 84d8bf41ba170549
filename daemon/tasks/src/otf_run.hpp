#pragma once
/// What the identification of one run, of a recording and of several targets have in common.

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
  std::vector<InputFile> sources;  ///< of both
};
/// Reads --machine and --path.
[[nodiscard]] Result<MachineAndPath> read_machine_and_path(const IdentifyOtfArguments& arguments);

/// --u-scale-ppm, or that of the configured tracker; 0 without both.
[[nodiscard]] double u_scale_of(const IdentifyOtfArguments& arguments, const Config& config);

/// Sets the prior for smooth tables as --smoothness-um (`text`) states: none, UM or
/// UM_X,UM_Y,UM_Z. Error Usage for another text.
[[nodiscard]] Result<void> apply_smoothness(const std::string& text, Config& config);
/// The options of the command replace those of the configuration; --smoothness-um apart.
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

/// Identifies the last complete run of --recording.
[[nodiscard]] Result<OtfOutcome> from_recording(const IdentifyOtfArguments& arguments,
                                                const std::optional<ActiveDocument>& active,
                                                const Progress& progress);

/// Identifies all 18 tables from the runs of --target-mm.
[[nodiscard]] Result<OtfOutcome> from_targets(const IdentifyOtfArguments& arguments,
                                              const std::optional<ActiveDocument>& active,
                                              const Progress& progress);

}  // namespace abbe::daemon
