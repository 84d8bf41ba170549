#include "abbe/methods/otf/method.hpp"

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "abbe/config/capabilities.hpp"
#include "abbe/methods/otf/document.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

OtfMethod::Options OtfMethod::options(const Config& config) {
  return acquisition_options(config);
}

nlohmann::json OtfMethod::to_json(const Request& request) {
  nlohmann::json object{{"path_m", request.path_m}};
  if (request.mode) object["mode"] = calib::otf::name(*request.mode);
  return object;
}

namespace {

/// The mode of the request. Throws like json::get() for a text that is not a mode.
std::optional<calib::otf::Mode> mode_of(const nlohmann::json& object, const Config* config) {
  if (!object.contains("mode"))
    return config != nullptr ? std::optional{calib_of(config->otf.mode)} : std::nullopt;
  const auto text = object.at("mode").get<std::string>();
  const auto mode = calib::otf::mode_named(text);
  if (!mode)
    throw nlohmann::json::other_error::create(
        501, fmt::format("mode \"{}\": must be \"on-the-fly\" or \"standstill\"", text), &object);
  return mode;
}

}  // namespace

OtfMethod::Request OtfMethod::request_from(const nlohmann::json& object, const Config* config) {
  return {object.at("path_m").get<std::vector<AxisPosition>>(), mode_of(object, config)};
}

Result<void> OtfMethod::check(const Request& request, const Config& config) {
  if (const auto tracker = tracker_source(config); tracker && tracker->stationary_time)
    return fail(
        ErrorCode::Refused,
        fmt::format("calibrate otf: [{}] mode = \"stationary\" gives no points during motion",
                    tracker->key));
  return check_otf_path(request.path_m, config.machine,
                        request.mode.value_or(calib_of(config.otf.mode)),
                        calib_of(config.otf.backlash));
}

Result<OtfMethod::Acquisition> OtfMethod::acquire(Request&& request, const Options& options) {
  if (request.path_m.size() < 2)
    return fail(ErrorCode::BadInput, "calibrate otf: a path needs at least two vertices");
  return OtfAcquisition{std::move(request.path_m), options,
                        request.mode.value_or(calib::otf::Mode::OnTheFly)};
}

OtfMethod::Run OtfMethod::run_of(Acquisition&& acquisition) {
  const EnvironmentEffect effect = acquisition.environment();
  const EnvironmentUseOptions& use = acquisition.options().environment;
  std::vector<AxisPosition> path_m = acquisition.release_path();
  for (AxisPosition& q_m : path_m) q_m = at_temperature(q_m, effect, use);
  std::vector<RunPoint> points = acquisition.release();
  std::optional<std::array<protocol::HostTime, 2>> observed;
  if (!points.empty()) observed = {points.front().time, points.back().time};

  return {.path_m = std::move(path_m),
          .points = std::move(points),
          .u_scale = effect.u_scale,
          .u_axis_scale = effect.u_expansion_factor,
          .unmeasured_air = use.unmeasured_air,
          .mode = acquisition.mode(),
          .temperature_K = acquisition.temperature_K(),
          .observed = observed};
}

Result<OtfMethod::Candidate> OtfMethod::identify(const Run& run, const Config& config,
                                                 const calib::VolumetricModel* active,
                                                 const IdentificationWatch& watch) {
  auto identified = identify_otf(otf_task(run, config, watch), config, active);
  ABBE_TRY(identified);
  return OtfCandidate{std::move(identified->found.solution), std::move(identified->verdict),
                      run.mode, std::move(identified->residuals), run.temperature_K};
}

std::vector<InputFile> OtfMethod::inputs_of(const Run& run) {
  return {{"points", points_sha256(run.points)}};
}

ModelDocument OtfMethod::document_of(const Candidate& candidate, const Config& config,
                                     std::vector<InputFile> inputs, protocol::UtcTime created) {
  return otf_document(candidate, config, std::move(inputs), created);
}

}  // namespace abbe::daemon
