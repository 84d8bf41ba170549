#include "abbe/daemon/otf_identification.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "abbe/calib/otf/judge.hpp"
#include "abbe/calib/otf/observe.hpp"
#include "abbe/daemon/otf_inputs.hpp"
#include "abbe/daemon/sha256.hpp"

namespace abbe::daemon {
namespace {

// A block is averaged over about this much travel: fine against nodes 50 mm apart, and the length at which
// the reference evaluation of the method was made (100 points at 500 Hz and 2500 mm/min).
constexpr double kBlockTravel_m = 8.3e-3;
constexpr std::size_t kSmallestBlock = 10;  // the design rows of a block are averaged over ten of its points
constexpr std::size_t kLargestBlock = 1000;

/// Typical way between two points while the machine moves: the upper quartile, which standstill and ramps do
/// not reach.
double typical_step_m(std::span<const RunPoint> points) {
  std::vector<double> steps;
  steps.reserve(points.size());
  for (std::size_t i = 1; i < points.size(); ++i) {
    const auto& a = points[i - 1].p_tracker_m;
    const auto& b = points[i].p_tracker_m;
    steps.push_back(std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]));
  }
  if (steps.empty()) return 0.0;
  const auto quartile = steps.begin() + static_cast<std::ptrdiff_t>(3 * steps.size() / 4);
  std::nth_element(steps.begin(), quartile, steps.end());
  return *quartile;
}

std::size_t block_samples(std::span<const RunPoint> points) {
  const double step_m = typical_step_m(points);
  if (!(step_m > 0.0)) return kLargestBlock;
  return std::clamp(static_cast<std::size_t>(std::lround(kBlockTravel_m / step_m)), kSmallestBlock,
                    kLargestBlock);
}

/// The stages share one bar: the alignment takes most of the time.
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

template <class T>
void update(Sha256& hash, const T& value) {
  hash.update(std::as_bytes(std::span{&value, 1}));
}

}  // namespace

Result<OtfCandidate> identify_run(const OtfRun& run, const MachineConfig& machine_config,
                                  const GateConfig& gate, const calib::VolumetricModel* active,
                                  const std::function<void(double)>& progress) {
  const auto machine = otf_machine(machine_config);
  if (!machine) return tl::unexpected(machine.error());
  calib::otf::Options options;
  options.block_samples = block_samples(run.points);
  if (progress) {
    options.progress = [&progress](calib::otf::Stage stage, double fraction) {
      progress(overall(stage, fraction));
    };
  }
  auto observations = calib::otf::observe(otf_observations(run.points), *machine, otf_path(run.path_m),
                                          otf_noise(machine_config), options);
  if (!observations) return tl::unexpected(error_of(observations.error()));
  auto solution = calib::otf::solve(*observations, options);
  if (!solution) return tl::unexpected(error_of(solution.error()));
  const calib::GateLimits limits{.max_error_m = gate.max_error_m, .max_gradient = gate.max_gradient};
  auto verdict = calib::otf::judge(*observations, *solution, active, limits, options);
  if (!verdict) return tl::unexpected(error_of(verdict.error()));
  return OtfCandidate{std::move(*solution), std::move(*verdict)};
}

std::string points_sha256(std::span<const RunPoint> points) {
  Sha256 hash;
  for (const RunPoint& p : points) {
    update(hash, p.device_time.time_since_epoch().count());
    update(hash, p.p_tracker_m);
    update(hash, static_cast<std::uint8_t>(p.usable));
  }
  return hash.hex();
}

}  // namespace abbe::daemon
