#include "abbe/methods/mfb/method.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/calib/mfb/plan/plan_prediction.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/config/json_vector.hpp"
#include "abbe/methods/mfb/document.hpp"
#include "abbe/methods/mfb/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "usable_touch.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

using nlohmann::json;

json file_json(const MfbRequest::File& file) {
  return {{"file", file.name}, {"text", file.text}};
}

MfbRequest::File file_of(const json& object) {
  return {object.at("file").get<std::string>(), object.at("text").get<std::string>()};
}

/// Limits the size of a request, because every touch is compared with every place of the bar in the
/// hub's cycle, and the request is written into the recording.
Result<void> check_size(const MfbRequest& request) {
  // With 60 bytes for a touch, both together are below the largest request of the control socket, 4
  // MiB.
  constexpr std::size_t kMostText = 1 << 18, kMostEarlier = 50'000;
  if (request.bar.text.size() <= kMostText && request.plan.text.size() <= kMostText &&
      request.earlier_m.size() <= kMostEarlier)
    return {};
  return fail(ErrorCode::BadInput,
              fmt::format("calibrate mfb: bar.toml and plan.toml have at most {} bytes, earlier "
                          "recordings at most {} touches",
                          kMostText, kMostEarlier));
}

Result<void> check_source_of_touches(const Config& config) {
  const auto touches = touch_source(config);
  if (!touches)
    return fail(ErrorCode::Refused,
                fmt::format("calibrate mfb: neither {} is in the configuration: there is no source "
                            "of touches",
                            tables_with(Capability::Touches, "nor")));
  if (touches->compensated)
    return fail(ErrorCode::Refused,
                fmt::format("calibrate mfb: the measuring machine corrects the positions it "
                            "reports ([{}] axes_compensated = true): switch the correction off in "
                            "the machine and set axes_compensated = false",
                            touches->key));
  return {};
}

/// Checks that the plan determines all 21 errors.
Result<void> check_plan(const MfbRequest& request, const mfb::MfbMachine& machine) {
  const auto bar = parse_bar_toml(request.bar.text, request.bar.name);
  ABBE_TRY(bar);
  const auto plan = parse_bar_plan_toml(request.plan.text, request.plan.name, bar->bar);
  ABBE_TRY(plan);
  const auto predicted = mfb::predict(bar->bar, plan->plan, machine);
  if (!predicted)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: {}", request.plan.name, predicted.error().text));
  if (predicted->not_seen.empty()) return {};
  return fail(ErrorCode::BadInput,
              fmt::format("{}: the measurements do not show {}; abbe plan mfb writes a plan that "
                          "does",
                          request.plan.name, fmt::join(predicted->not_seen, ", ")));
}

std::string touches_sha256(const MfbRun& run) {
  Sha256 hash;
  for (std::size_t pass = 0; pass < run.passes.size(); ++pass)
    for (const mfb::Touch& touch : run.passes[pass]) {
      hash.update_bytes_of(pass);
      hash.update_bytes_of(touch.target.feature);
      hash.update_bytes_of(touch.target.index);
      hash.update_bytes_of(touch.target.side);
      hash.update_bytes_of(touch.target.k);
      for (const double q_m : touch.reading_m) hash.update_bytes_of(q_m);
    }
  return hash.hex();
}

}  // namespace

MethodNeeds MfbMethod::needs(const Config& config) {
  const auto touches = touch_source(config);
  return {.axis_readings = !touches || !touches->reports_positions};
}

MfbMethod::Options MfbMethod::options(const Config& config) {
  Options options{.touches = touch_rules(config),
                  .bar = config.mfb.bar,
                  .machine = mfb_machine(config.machine)};
  if (options.bar) options.bar_sensor = config.temperatures[*options.bar->sensor];
  return options;
}

json MfbMethod::to_json(const Request& request) {
  json earlier = json::array();
  for (const calib::Vector3& q_m : request.earlier_m)
    earlier.push_back({q_m.x(), q_m.y(), q_m.z()});
  return {{"bar", file_json(request.bar)},
          {"plan", file_json(request.plan)},
          {"earlier_m", std::move(earlier)}};
}

MfbMethod::Request MfbMethod::request_from(const json& object, const Config* /*config*/) {
  Request request{file_of(object.at("bar")), file_of(object.at("plan")), {}};
  if (object.contains("earlier_m"))
    for (const json& q_m : object.at("earlier_m")) request.earlier_m.push_back(vector_of(q_m));
  return request;
}

Result<void> MfbMethod::check(const Request& request, const Config& config) {
  ABBE_TRY(check_size(request));
  ABBE_TRY(check_source_of_touches(config));
  const auto machine = mfb_machine(config.machine);
  ABBE_TRY(machine);
  return check_plan(request, *machine);
}

Result<MfbMethod::Acquisition> MfbMethod::acquire(Request&& request, const Options& options) {
  return MfbAcquisition::create(request, options);
}

MfbMethod::Run MfbMethod::run_of(Acquisition&& acquisition) {
  return acquisition.release();
}

Result<MfbMethod::Candidate> MfbMethod::identify(const Run& run, const Config& config,
                                                 const calib::VolumetricModel* active,
                                                 const IdentificationWatch& watch) {
  const auto stopped = [&] { return watch.stopped && watch.stopped(); };
  const Error before_its_end{ErrorCode::DataInsufficient, "identification: stopped before its end"};
  if (stopped()) return tl::unexpected(before_its_end);
  auto candidate =
      identify_with_bar({.bar = run.bar, .plan = run.plan, .passes = run.passes}, config, active);
  if (stopped()) return tl::unexpected(before_its_end);
  return candidate;
}

std::vector<InputFile> MfbMethod::inputs_of(const Run& run) {
  std::vector<InputFile> inputs = run.sources;
  inputs.push_back({"touches", touches_sha256(run)});
  return inputs;
}

ModelDocument MfbMethod::document_of(const Candidate& candidate, const Config& config,
                                     std::vector<InputFile> inputs, protocol::UtcTime created) {
  return mfb_document(candidate, mfb::Options{}.solve.estimator, config, std::move(inputs),
                      created);
}

}  // namespace abbe::daemon
