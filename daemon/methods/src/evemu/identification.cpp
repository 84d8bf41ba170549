#include "abbe/methods/evemu/identification.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "usable_touch.hpp"

namespace abbe::daemon {

namespace evemu = calib::evemu;

evemu::JudgeOptions evemu_judge_options(const Config& config) {
  evemu::JudgeOptions options;
  options.limits = gate_limits(config.gate);
  options.accept_shape_only = config.gate.accepts(evemu::kShapeOnly);
  // The names of estimator and folds were checked when the configuration was read, so value_or()
  // never takes effect.
  options.solve.estimator =
      evemu::estimator(config.evemu.estimator).value_or(evemu::Estimator::BayesPose);
  options.solve.sparse.folds =
      evemu::folds_by(config.evemu.folds).value_or(evemu::FoldsBy::Position);
  return options;
}

std::string artefact_temperature_fault(const evemu::Calibrator& calibrator, std::string_view named,
                                       std::string_view thermometer, std::string_view remedy) {
  if (calibrator.expansivity && thermometer.empty())
    return fmt::format("{} has alpha_um_per_m_K, but the temperature of the array is not given: {}",
                       named, remedy);
  if (!calibrator.expansivity && !thermometer.empty())
    return fmt::format(
        "{} gives the temperature of the array, but {} has no expansion coefficient: add "
        "alpha_um_per_m_K and u_alpha_um_per_m_K to its file",
        thermometer, named);
  return {};
}

evemu::TouchPlan touch_plan(const EvemuConfig& config) {
  return {config.positions, config.points_per_ball, config.points_per_block};
}

EvemuAcquisitionOptions evemu_acquisition_options(const Config& config) {
  EvemuAcquisitionOptions options{.touches = touch_rules(config)};
  if (const auto machine = otf_machine(config.machine)) options.travel = machine->nodes;
  options.artefact = config.evemu.artefact;
  if (options.artefact && options.artefact->sensor)
    options.artefact_sensor = config.temperatures[*options.artefact->sensor];
  return options;
}

/// Limits the size of a request, because every touch is compared with every ball in the hub's
/// cycle. Real arrays have ten balls and eight positions.
Result<void> check_size(const EvemuRequest& request) {
  constexpr std::size_t kMostBalls = 100, kMostPositions = 100, kMostPoints = 1000;
  const auto& plan = request.plan;
  const std::size_t balls = request.calibrator.balls.size(),
                    blocks = request.calibrator.blocks.size();
  if (balls <= kMostBalls && blocks <= kMostBalls && plan.positions.size() <= kMostPositions &&
      plan.points_per_ball <= kMostPoints && plan.points_per_block <= kMostPoints)
    return {};

  return fail(
      ErrorCode::BadInput,
      fmt::format(
          "calibrate evemu: an array has at most {} balls and blocks, a plan at most {} positions "
          "with {} points a ball or block",
          kMostBalls, kMostPositions, kMostPoints));
}

Result<void> check_evemu(const EvemuRequest& request, const Config& config) {
  ABBE_TRY(check_size(request));
  const auto touches = touch_source(config);
  if (!touches) {
    return fail(ErrorCode::Refused,
                fmt::format("calibrate evemu: neither {} is in the configuration: "
                            "there is no source of touches",
                            tables_with(Capability::Touches, "nor")));
  }

  if (touches->compensated) {
    return fail(
        ErrorCode::Refused,
        fmt::format(
            "calibrate evemu: the measuring machine corrects the positions it reports ([{}] "
            "axes_compensated = true): switch the correction off in the machine and set "
            "axes_compensated = false",
            touches->key));
  }

  ABBE_TRY(require_target(config.machine));
  ABBE_TRY(evemu_machine(config.machine));
  const auto& artefact = config.evemu.artefact;
  const auto fault = artefact_temperature_fault(
      request.calibrator, fmt::format("calibrator \"{}\"", request.calibrator.name),
      !artefact          ? ""
      : artefact->sensor ? "[evemu] artefact_sensor"
                         : "[evemu] artefact_C",
      "add artefact_sensor or artefact_C, and u_artefact_K, to [evemu]");
  if (!fault.empty()) return fail(ErrorCode::Refused, "calibrate evemu: " + fault);
  const auto guide = evemu::TouchGuide::create(request.calibrator, request.plan);
  if (!guide) return fail(ErrorCode::BadInput, "calibrate evemu: " + guide.error().text);

  return {};
}

Result<evemu::Observations> evemu_observations(const EvemuRun& run, const Config& config,
                                               std::optional<int> order,
                                               std::optional<int> positions) {
  const auto machine = evemu_machine(config.machine);
  ABBE_TRY(machine);
  evemu::ObserveOptions options;
  options.order = order.value_or(config.evemu.order);
  options.positions = positions.value_or(static_cast<int>(run.asked.plan.positions.size()));
  options.artefact_temperature = run.artefact;
  auto observations = evemu::observe(run.touches, run.asked.calibrator, *machine, options);
  if (!observations) return tl::unexpected(error_of(observations.error()));
  return *std::move(observations);
}

Result<EvemuCandidate> identify_with_array(EvemuTask task, const calib::VolumetricModel* active) {
  auto solution = evemu::solve(task.observations, task.judging.solve);
  if (solution && task.rotation_reference)
    solution = evemu::with_rotation_reference(
        std::move(*solution), {task.rotation_reference->points, task.rotation_reference->sigma_m});
  if (!solution) return tl::unexpected(error_of(solution.error()));

  const auto& stopped = task.judging.watch.stopped;
  if (stopped && stopped())
    return fail(ErrorCode::DataInsufficient, "identification: stopped before its end");
  auto verdict = evemu::judge(task.observations, *solution, active, task.judging);
  if (!verdict) return tl::unexpected(error_of(verdict.error()));
  return EvemuCandidate{std::move(task.observations), std::move(*solution), std::move(*verdict)};
}

}  // namespace abbe::daemon
