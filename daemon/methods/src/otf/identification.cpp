#include "abbe/methods/otf/identification.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

/// Overall progress, 0 to 1; the alignment takes most of the time.
double overall(calib::otf::Stage stage, double fraction) {
  switch (stage) {
    case calib::otf::Stage::Observe:
      return 0.1 * fraction;
    case calib::otf::Stage::Align:
      return 0.1 + 0.5 * fraction;
    case calib::otf::Stage::Solve:
      return 0.6 + 0.2 * fraction;
    case calib::otf::Stage::Judge:
      return 0.8 + 0.2 * fraction;
  }
  return fraction;
}

}  // namespace

Result<IdentifiedRun> identify_observations(const OtfRun& run, const Config& config,
                                            const calib::VolumetricModel* active,
                                            const IdentificationWatch& watch) {
  const auto machine = otf_machine(config.machine);
  ABBE_TRY(machine);
  const auto points = otf_observations(run.points);
  calib::otf::Options options = otf_options(points, config);
  options.mode = run.mode;

  // A live run has scale readings, and they were found to agree with the path at its vertices.
  options.orientation.scales_agree = true;
  if (watch.progress) {
    options.progress = [&watch](calib::otf::Stage stage, double fraction) {
      watch.progress(overall(stage, fraction));
    };
  }

  options.stopped = watch.stopped;
  calib::otf::Noise noise = otf_noise(config.machine);
  noise.u_scale = run.u_scale;
  noise.u_axis_scale = run.u_axis_scale;
  auto found = calib::otf::identify(points, *machine, otf_path(run.path_m), noise, options);
  if (!found) return tl::unexpected(error_of(found.error()));
  std::vector<RunResiduals> residuals{
      calib::otf::placed_residuals(found->observations, found->solution.residuals)};
  auto verdict =
      calib::otf::judge(found->observations, found->solution, active, gate_limits(config.gate),
                        options, calib::otf::held_out_into(residuals));
  if (!verdict) return tl::unexpected(error_of(verdict.error()));
  if (run.unmeasured_air) verdict->notes.push_back(*run.unmeasured_air);

  return IdentifiedRun{noise, *std::move(found), std::move(*verdict), std::move(residuals)};
}

Result<OtfCandidate> identify_run(const OtfRun& run, const Config& config,
                                  const calib::VolumetricModel* active,
                                  const IdentificationWatch& watch) {
  auto identified = identify_observations(run, config, active, watch);
  ABBE_TRY(identified);
  return OtfCandidate{std::move(identified->found.solution), std::move(identified->verdict),
                      run.mode, std::move(identified->residuals), run.temperature_K};
}

std::string points_sha256(std::span<const RunPoint> points) {
  Sha256 hash;
  for (const RunPoint& p : points) {
    hash.update_bytes_of(p.device_time.time_since_epoch().count());
    hash.update_bytes_of(p.p_tracker_m);
    hash.update_bytes_of(static_cast<std::uint8_t>(p.usable));
  }
  return hash.hex();
}

}  // namespace abbe::daemon
