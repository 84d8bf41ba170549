#include "abbe/tasks/evemu_input.hpp"

#include <fmt/format.h>

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/evemu/identification.hpp"
#include "abbe/methods/evemu/method.hpp"
#include "abbe/recording/recorded_clock.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe/tables/touches_not_seen.hpp"
#include "abbe/tables/travel_faults.hpp"
#include "abbe/tasks/opened_recording.hpp"
#include "abbe/tasks/scales_corrected.hpp"
#include "last_complete_run.hpp"
#include "target_offset.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;

/// The temperature of the array: from the option, else the fixed temperature of [evemu]. Values of
/// a sensor are not in the files.
std::optional<evemu::ArtefactTemperature> artefact_temperature(const EvemuInputArguments& arguments,
                                                               const EvemuConfig& config) {
  if (arguments.artefact_C)
    return evemu::ArtefactTemperature{*arguments.artefact_C + kZeroCelsius_K,
                                      arguments.u_artefact_K.value_or(0.0)};
  if (config.artefact && !config.artefact->sensor)
    return evemu::ArtefactTemperature{config.artefact->fixed_K, config.artefact->u_temperature_K};
  return std::nullopt;
}

Result<void> check_artefact(const EvemuInputArguments& arguments,
                            const evemu::Calibrator& calibrator, bool temperature_known,
                            const std::string& missing) {
  const auto fault = artefact_temperature_fault(
      calibrator, arguments.calibrator,
      !temperature_known     ? ""
      : arguments.artefact_C ? "--artefact-C"
                             : "[evemu] artefact_C",
      fmt::format(
          "{}give --artefact-C and --u-artefact-K (or [evemu] artefact_C and u_artefact_K in {})",
          missing.empty() ? "" : missing + "; ", arguments.machine));
  return fault.empty() ? Result<void>{} : fail(ErrorCode::BadInput, fault);
}

std::vector<calib::Vector3> positions_of(const std::vector<evemu::Touch>& touches) {
  std::vector<calib::Vector3> out;
  for (const evemu::Touch& touch : touches) out.push_back(touch.p_m);
  return out;
}

std::vector<calib::Vector3> positions_of(const std::vector<evemu::BallError>& errors) {
  std::vector<calib::Vector3> out;
  for (const evemu::BallError& error : errors) out.push_back(error.reading_m);
  return out;
}

tl::unexpected<Error> in_file(const std::string& file, const calib::Error& error) {
  Error out = error_of(error);
  out.text = fmt::format("{}: {}", file, out.text);
  return tl::unexpected(std::move(out));
}

Result<void> observe_touches(const EvemuInputArguments& arguments, const evemu::Machine& machine,
                             const evemu::ObserveOptions& options, EvemuInput& input) {
  const auto calibrator = read_calibrator_toml(arguments.calibrator);
  ABBE_TRY(calibrator);
  ABBE_TRY(check_artefact(arguments, calibrator->calibrator,
                          options.artefact_temperature.has_value(),
                          missing_array_sensor(arguments, input.config)));

  const auto touches = read_touches_csv(arguments.touches);
  ABBE_TRY(touches);
  ABBE_TRY(check_travel(arguments.touches, positions_of(touches->touches), touches->lines,
                        input.config.machine));

  input.sources.insert(input.sources.end(), {touches->source, calibrator->source});
  auto observed = evemu::observe(touches->touches, calibrator->calibrator, machine, options);
  if (!observed)
    return in_file(arguments.touches + line_not_seen(*touches, calibrator->calibrator, options),
                   observed.error());
  input.observations = std::move(*observed);

  return {};
}

Result<void> observe_errors(const EvemuInputArguments& arguments, const evemu::Machine& machine,
                            const evemu::ObserveOptions& options, EvemuInput& input) {
  const auto errors = read_errors_csv(arguments.errors);
  ABBE_TRY(errors);
  ABBE_TRY(check_travel(arguments.errors, positions_of(errors->errors), errors->lines,
                        input.config.machine));

  input.sources.push_back(errors->source);
  const auto rotation =
      arguments.rotation_known ? evemu::RotationOrigin::Independent : evemu::RotationOrigin::Blocks;
  auto observed = evemu::observe_errors(errors->errors, machine, rotation, options);
  if (!observed) return in_file(arguments.errors, observed.error());
  input.observations = std::move(*observed);

  return {};
}

evemu::ObserveOptions observe_options(const EvemuInputArguments& arguments,
                                      const EvemuConfig& config, std::size_t positions) {
  evemu::ObserveOptions options;
  options.order = arguments.order.value_or(config.order);
  options.positions = arguments.positions.value_or(static_cast<int>(positions));
  return options;
}

Result<EvemuInput> from_files(const EvemuInputArguments& arguments) {
  auto config = load_config(arguments.machine);
  ABBE_TRY(config);
  const auto source = hashed_file(arguments.machine);
  ABBE_TRY(source);
  EvemuInput input;
  input.sources.push_back(*source);

  const auto* what = arguments.touches.empty() ? "errors" : "touches";
  ABBE_TRY(check_scales("identify evemu", what, *config, arguments.scales_corrected));
  if (const auto& t = arguments.tip_offset_m) set_target(*config, *t);
  if (const auto given = require_target(config->machine); !given)
    return fail(given.error().code, fmt::format("{}: {}", arguments.machine, given.error().text));
  const auto machine = evemu_machine(config->machine);
  ABBE_TRY(machine);

  auto options = observe_options(arguments, config->evemu, config->evemu.positions.size());
  options.artefact_temperature = artefact_temperature(arguments, config->evemu);
  input.config = std::move(*config);
  const auto observe = arguments.touches.empty() ? observe_errors : observe_touches;
  ABBE_TRY(observe(arguments, *machine, options, input));

  return input;
}

Result<EvemuInput> from_recording(const EvemuInputArguments& arguments, const Progress& progress) {
  auto recording = open_recording(arguments.recording, arguments.machine,
                                  [&progress] { return progress.stopped(); });
  ABBE_TRY(recording);
  ABBE_TRY(require_target(recording->config.machine));
  const auto run = last_complete_run<EvemuMethod>(*recording, recording->source.name,
                                                  "calibration with a ball array", progress);
  ABBE_TRY(run);
  auto observed = evemu_observations(*run, recording->config, arguments.order, arguments.positions);
  ABBE_TRY(observed);

  EvemuInput input{std::move(recording->config),
                   {recording->source},
                   std::move(*observed),
                   run->asked.rotation_reference};
  const auto entered = inputs_of(*run);
  input.sources.insert(input.sources.end(), entered.begin(), entered.end());
  input.recording_gap = recording->reader.damage();
  input.observed = run->observed;
  input.utc = recorded_clock(recording->reader).dates;
  input.judge_source = [reader = std::make_shared<RecordingReader>(std::move(recording->reader))](
                           calib::Verdict& verdict) { judge_recording(*reader, verdict); };

  return input;
}

}  // namespace

Result<EvemuInput> read_evemu_input(const EvemuInputArguments& arguments,
                                    const Progress& progress) {
  return arguments.recording.empty() ? from_files(arguments) : from_recording(arguments, progress);
}

Result<void> read_rotation_reference(const EvemuInputArguments& arguments, EvemuInput& input) {
  if (arguments.rotation_reference.empty()) return {};
  if (!arguments.u_reference_um || !(*arguments.u_reference_um > 0.0))
    return fail(ErrorCode::Usage,
                "--rotation-reference needs --u-reference-um, the standard uncertainty of its V");
  const auto points = read_errors_csv(arguments.rotation_reference);
  ABBE_TRY(points);
  ABBE_TRY(check_travel(arguments.rotation_reference, positions_of(points->errors), points->lines,
                        input.config.machine));
  input.sources.push_back(points->source);
  input.rotation_reference = RotationPoints{points->errors, *arguments.u_reference_um / kUmPerM};
  return {};
}

std::string missing_array_sensor(const EvemuInputArguments& arguments, const Config& config) {
  const auto& artefact = config.evemu.artefact;
  if (arguments.touches.empty() || arguments.artefact_C || !artefact || !artefact->sensor)
    return {};
  return fmt::format("[evemu] artefact_sensor \"{}\" is in no file of touches",
                     config.temperatures[*artefact->sensor]);
}

}  // namespace abbe::daemon
