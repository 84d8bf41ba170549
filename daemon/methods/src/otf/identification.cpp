#include "abbe/methods/otf/identification.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
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

calib::Result<calib::otf::Identification> identified(const OtfTask& task,
                                                     const calib::otf::Machine& machine) {
  if (!task.scales)
    return calib::otf::identify(task.points, machine, task.path, task.noise, task.options);

  calib::otf::Options with_scales = task.options;
  with_scales.encoders = &*task.scales;
  auto found = calib::otf::identify(task.points, machine, task.path, task.noise, with_scales);
  if (found || found.error().code != calib::ErrorCode::AlignmentFailed) return found;

  const std::string why = found.error().text;
  found = calib::otf::identify(task.points, machine, task.path, task.noise, task.options);
  if (found)
    found->observations.notes.push_back("the scale readings were not used along the path: " + why);
  return found;
}

}  // namespace

OtfTask otf_task(const OtfRun& run, const Config& config, const IdentificationWatch& watch) {
  OtfTask task{.points = otf_observations(run.points),
               .path = otf_path(run.path_m),
               .noise = otf_noise(config.machine),
               .options = {}};
  task.noise.u_scale = run.u_scale;
  task.noise.u_axis_scale = run.u_axis_scale;
  task.options = otf_options(task.points, config);
  task.options.mode = run.mode;
  task.unmeasured_air = run.unmeasured_air;

  // A live run has scale readings. The acquisition has already compared them with the path at its
  // vertices, and they agree.
  task.options.orientation.scales_agree = true;
  task.options.stopped = watch.stopped;
  if (watch.progress)
    task.options.progress = [progress = watch.progress](calib::otf::Stage stage, double fraction) {
      progress(overall(stage, fraction));
    };
  return task;
}

Result<IdentifiedRun> identify_otf(const OtfTask& task, const Config& config,
                                   const calib::VolumetricModel* active) {
  const auto machine = otf_machine(config.machine);
  ABBE_TRY(machine);
  auto found = identified(task, *machine);
  if (!found) return tl::unexpected(error_of(found.error()));

  std::vector<RunResiduals> residuals{
      calib::otf::placed_residuals(found->observations, found->solution.residuals)};
  auto verdict =
      calib::otf::judge(found->observations, found->solution, active, gate_limits(config.gate),
                        task.options, calib::otf::held_out_into(residuals));
  if (!verdict) return tl::unexpected(error_of(verdict.error()));
  if (task.unmeasured_air) verdict->notes.push_back(*task.unmeasured_air);
  return IdentifiedRun{task.noise, *std::move(found), *std::move(verdict), std::move(residuals)};
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
