#pragma once
/// Identifies a model from a run with a laser tracker and judges it. A live session, its replay and
/// `abbe identify otf` use the same function. Pure and deterministic: equal points give
/// bit-identical results. It takes about a second; the daemon runs it in a separate thread.

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/placed_residuals.hpp"
#include "abbe/config/config.hpp"
#include "abbe/methods/identification_watch.hpp"
#include "abbe/methods/otf/acquisition.hpp"

namespace abbe::daemon {

struct OtfRun {
  /// Vertices of the path in the coordinates of the snapshots. With [[thermal]], both are corrected
  /// for the thermal expansion of the scales; the model then applies to corrected readings and does
  /// not contain this expansion itself.
  std::vector<AxisPosition> path_m;
  std::vector<RunPoint> points;
  double u_scale = 0.0;                  ///< see calib::otf::Noise
  std::array<double, 3> u_axis_scale{};  ///< see calib::otf::Noise
  /// Note in the verdict if the air was not measured: states the air for which the ranges were
  /// corrected. nullopt: the air was measured.
  std::optional<std::string> unmeasured_air;
  calib::otf::Mode mode = calib::otf::Mode::OnTheFly;
  /// Lowest and highest temperature during the run; nullopt: not measured.
  std::optional<std::array<double, 2>> temperature_K{};
  /// Host times of the first and the last observation; nullopt: not known.
  std::optional<std::array<protocol::HostTime, 2>> observed{};
};

using RunResiduals = std::vector<calib::otf::PlacedResidual>;

struct OtfCandidate {
  calib::otf::Solution solution;
  calib::Verdict verdict;
  calib::otf::Mode mode = calib::otf::Mode::OnTheFly;
  std::vector<RunResiduals> residuals{};  ///< one element, or one per run of several targets
  std::optional<std::array<double, 2>> temperature_K{};  ///< OtfRun::temperature_K
};

/// Input of an identification from a run. The run is live, replayed or from files.
struct OtfTask {
  std::vector<calib::otf::TrackerObservation> points;
  calib::otf::Path path;
  calib::otf::Noise noise;
  /// options of the identification, with the callbacks for progress and stop
  calib::otf::Options options;
  /// Scale readings with times of the machine's clock; they improve the component of the error
  /// along the path. Readings from another motion than the run are not used; a note in the
  /// observations states why.
  std::optional<calib::otf::EncoderLog> scales{};
  std::optional<std::string> unmeasured_air{};  ///< OtfRun::unmeasured_air
};
/// Makes the task for an acquired run, with the options of [otf].
[[nodiscard]] OtfTask otf_task(const OtfRun& run, const Config& config,
                               const IdentificationWatch& watch);

struct IdentifiedRun {
  calib::otf::Noise noise;
  calib::otf::Identification found;
  calib::Verdict verdict;
  std::vector<RunResiduals> residuals;
};
/// Identifies a model and judges it. `active`: the active model, with which the gate compares; null
/// if there is none. An Error DataInsufficient names what is missing if the run does not determine
/// the model.
[[nodiscard]] Result<IdentifiedRun> identify_otf(const OtfTask& task, const Config& config,
                                                 const calib::VolumetricModel* active);

/// SHA-256 in hex over the points used in the identification: times, positions and `usable`.
[[nodiscard]] std::string points_sha256(std::span<const RunPoint> points);

}  // namespace abbe::daemon
