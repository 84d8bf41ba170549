#include "abbe/methods/evemu/method.hpp"

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "abbe/base/sha256.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/config/json_vector.hpp"
#include "abbe/methods/evemu/document.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;
using calib::Vector3;
using nlohmann::json;

json xyz(const Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

json calibrator_json(const evemu::Calibrator& c) {
  json balls = json::array(), blocks = json::array();
  for (const auto& b : c.balls)
    balls.push_back({{"number", b.number},
                     {"centre_m", xyz(b.centre_m)},
                     {"radius_m", b.radius_m},
                     {"u_m", b.u_m}});
  for (const auto& b : c.blocks)
    blocks.push_back({{"number", b.number}, {"normal", xyz(b.normal)}, {"u_rad", b.u_rad}});
  json out{
      {"name", c.name}, {"tip_radius_m", c.tip_radius_m}, {"balls", balls}, {"blocks", blocks}};

  if (const auto& expansivity = c.expansivity) {
    out["alpha_per_K"] = expansivity->alpha_per_K;
    out["u_alpha_per_K"] = expansivity->u_alpha_per_K;
  }

  return out;
}

evemu::Calibrator calibrator_of(const json& object) {
  evemu::Calibrator c;
  c.name = object.at("name").get<std::string>();
  c.tip_radius_m = object.at("tip_radius_m").get<double>();
  for (const json& b : object.at("balls"))
    c.balls.push_back({b.at("number").get<int>(), vector_of(b.at("centre_m")),
                       b.at("radius_m").get<double>(), b.at("u_m").get<double>()});
  for (const json& b : object.at("blocks"))
    c.blocks.push_back(
        {b.at("number").get<int>(), vector_of(b.at("normal")), b.at("u_rad").get<double>()});
  if (object.contains("alpha_per_K"))
    c.expansivity = {
        {object.at("alpha_per_K").get<double>(), object.at("u_alpha_per_K").get<double>()}};

  return c;
}

json reference_json(const RotationPoints& reference) {
  json points = json::array();
  for (const auto& p : reference.points)
    points.push_back({{"reading_m", xyz(p.reading_m)}, {"V_m", xyz(p.V_m)}});
  return {{"sigma_m", reference.sigma_m}, {"points", points}};
}

RotationPoints reference_of(const json& object) {
  RotationPoints reference{.sigma_m = object.at("sigma_m").get<double>()};
  for (const json& p : object.at("points"))
    reference.points.push_back(
        {.reading_m = vector_of(p.at("reading_m")), .V_m = vector_of(p.at("V_m"))});
  return reference;
}

std::string touches_sha256(std::span<const calib::evemu::Touch> touches) {
  Sha256 hash;
  for (const auto& t : touches) {
    hash.update_bytes_of(t.position);
    hash.update_bytes_of(t.feature);
    hash.update_bytes_of(t.number);
    for (const double p_m : t.p_m) hash.update_bytes_of(p_m);
  }
  return hash.hex();
}

}  // namespace

MethodNeeds EvemuMethod::needs(const Config& config) {
  const auto touches = touch_source(config);
  return {.axis_readings = !touches || !touches->reports_positions};
}

EvemuMethod::Options EvemuMethod::options(const Config& config) {
  return evemu_acquisition_options(config);
}

json EvemuMethod::to_json(const Request& request) {
  json sources = json::array();
  for (const auto& s : request.sources) sources.push_back({{"name", s.name}, {"sha256", s.sha256}});
  json out{{"calibrator", calibrator_json(request.calibrator)},
           {"positions", request.plan.positions},
           {"points_per_ball", request.plan.points_per_ball},
           {"points_per_block", request.plan.points_per_block},
           {"sources", sources}};
  if (request.rotation_reference)
    out["rotation_reference"] = reference_json(*request.rotation_reference);
  return out;
}

EvemuMethod::Request EvemuMethod::request_from(const json& object, const Config* config) {
  const evemu::TouchPlan plan = config != nullptr ? touch_plan(config->evemu) : evemu::TouchPlan{};
  EvemuRequest request{.calibrator = calibrator_of(object.at("calibrator"))};
  request.plan.positions = object.value("positions", plan.positions);
  request.plan.points_per_ball = object.value("points_per_ball", plan.points_per_ball);
  request.plan.points_per_block = object.value("points_per_block", plan.points_per_block);
  for (const json& s : object.at("sources"))
    request.sources.push_back({s.at("name").get<std::string>(), s.at("sha256").get<std::string>()});
  if (object.contains("rotation_reference"))
    request.rotation_reference = reference_of(object.at("rotation_reference"));
  return request;
}

Result<void> EvemuMethod::check(const Request& request, const Config& config) {
  return check_evemu(request, config);
}

Result<EvemuMethod::Acquisition> EvemuMethod::acquire(Request&& request, const Options& options) {
  return EvemuAcquisition::create(std::move(request), options);
}

EvemuMethod::Run EvemuMethod::run_of(Acquisition&& acquisition) {
  return acquisition.release();
}

Result<EvemuMethod::Candidate> EvemuMethod::identify(const Run& run, const Config& config,
                                                     const calib::VolumetricModel* active,
                                                     const IdentificationWatch& watch) {
  auto observations = evemu_observations(run, config);
  ABBE_TRY(observations);
  EvemuTask task{*std::move(observations), evemu_judge_options(config),
                 run.asked.rotation_reference};
  task.judging.watch.stopped = watch.stopped;
  return identify_with_array(std::move(task), active);
}

std::vector<InputFile> EvemuMethod::inputs_of(const Run& run) {
  std::vector<InputFile> inputs = run.asked.sources;
  inputs.push_back({"touches", touches_sha256(run.touches)});
  return inputs;
}

ModelDocument EvemuMethod::document_of(const Candidate& candidate, const Config& config,
                                       std::vector<InputFile> inputs, protocol::UtcTime created) {
  return evemu_document(candidate, config, std::move(inputs), created);
}

}  // namespace abbe::daemon
