#pragma once
/// Identifies a model from an acquired run with the estimator of [otf], and judges it. A live
/// session and its replay use the same function. Pure and deterministic: equal points give
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

  [[nodiscard]] const calib::VolumetricModel& model() const { return solution.model; }
};

/// What identify_run() computed, with the observations.
struct IdentifiedRun {
  calib::otf::Noise noise;
  calib::otf::Identification found;
  calib::Verdict verdict;
  std::vector<RunResiduals> residuals;
};
/// As identify_run(), for a caller that needs the observations.
[[nodiscard]] Result<IdentifiedRun> identify_observations(const OtfRun& run, const Config& config,
                                                          const calib::VolumetricModel* active,
                                                          const IdentificationWatch& watch = {});

/// Identifies and judges. `active`: the active model, with which the gate compares; null if there
/// is none. An Error DataInsufficient names what is missing if the run does not determine the
/// model.
[[nodiscard]] Result<OtfCandidate> identify_run(const OtfRun& run, const Config& config,
                                                const calib::VolumetricModel* active,
                                                const IdentificationWatch& watch = {});

/// SHA-256 in hex over the points used in the identification: times, positions and `usable`.
[[nodiscard]] std::string points_sha256(std::span<const RunPoint> points);

}  // namespace abbe::daemon
