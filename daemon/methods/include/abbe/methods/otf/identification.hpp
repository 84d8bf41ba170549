#pragma once
/// An acquired run becomes a judged model: observe, solve, judge in a row, the same for a live
/// session and its replay. Pure and deterministic: equal points give equal bits. About a second;
/// runs on a thread of its own in the daemon.

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/calib/gate.hpp"
#include "abbe/calib/otf/solve.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/identification_watch.hpp"
#include "abbe/methods/otf/acquisition.hpp"

namespace abbe::daemon {

struct OtfRun {
  /// The path as snapshots see it: grown with the scales where [[thermal]] is configured. The model
  /// is of corrected positions then; what a scale grew by is not in it a second time.
  std::vector<AxisPosition> path_m;
  std::vector<RunPoint> points;
  double u_scale = 0.0;                  ///< see calib::otf::Noise
  std::array<double, 3> u_axis_scale{};  ///< see calib::otf::Noise
  /// Note of the verdict: the air the ranges were corrected for without measuring it. None: it was
  /// measured.
  std::optional<std::string> unmeasured_air;
};

struct OtfCandidate {
  calib::otf::Solution solution;
  calib::Verdict verdict;
};

/// `active` may be null.
/// DataInsufficient when the run does not determine the model, with what is missing.
[[nodiscard]] Result<OtfCandidate> identify_run(const OtfRun& run, const MachineConfig& machine,
                                                const GateConfig& gate,
                                                const calib::VolumetricModel* active,
                                                const IdentificationWatch& watch = {});

/// SHA-256 in hex over the points as they entered the identification: times, positions and whether
/// usable.
[[nodiscard]] std::string points_sha256(std::span<const RunPoint> points);

}  // namespace abbe::daemon
