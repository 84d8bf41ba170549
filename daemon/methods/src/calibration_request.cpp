#include "abbe/methods/calibration_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "abbe/config/json_vector.hpp"
#include "abbe/messages/attachment_content.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;
using calib::Vector3;
using nlohmann::json;

// How an attachment begins, and the places for its number.
constexpr std::string_view kFromKey = R"({"from_ns":)";
constexpr std::size_t kDigitsOfFrom = 20;

json xyz(const Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

json to_json(const evemu::Calibrator& c) {
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

  if (const auto& grows = c.expansivity) {
    out["alpha_per_K"] = grows->alpha_per_K;
    out["u_alpha_per_K"] = grows->u_alpha_per_K;
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

json to_json(const RotationPoints& reference) {
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

json method_json(const OtfRequest& request) {
  return {{"path_m", request.path_m}};
}

json method_json(const EvemuRequest& request) {
  json sources = json::array();
  for (const auto& s : request.sources) sources.push_back({{"name", s.name}, {"sha256", s.sha256}});
  json out{{"calibrator", to_json(request.calibrator)},
           {"positions", request.plan.positions},
           {"points_per_ball", request.plan.points_per_ball},
           {"points_per_block", request.plan.points_per_block},
           {"sources", sources}};
  if (request.reference) out["rotation_reference"] = to_json(*request.reference);
  return out;
}

EvemuRequest evemu_request_of(const json& object, const evemu::TouchPlan& plan) {
  EvemuRequest request{.calibrator = calibrator_of(object.at("calibrator"))};
  request.plan.positions = object.value("positions", plan.positions);
  request.plan.points_per_ball = object.value("points_per_ball", plan.points_per_ball);
  request.plan.points_per_block = object.value("points_per_block", plan.points_per_block);
  for (const json& s : object.at("sources"))
    request.sources.push_back({s.at("name").get<std::string>(), s.at("sha256").get<std::string>()});
  if (object.contains("rotation_reference"))
    request.reference = reference_of(object.at("rotation_reference"));
  return request;
}

}  // namespace

std::string_view method_of(const CalibrationTask& task) noexcept {
  return std::holds_alternative<OtfRequest>(task) ? "otf" : "evemu";
}

json to_json(const CalibrationTask& task) {
  json out = std::visit([](const auto& request) { return method_json(request); }, task);
  out["method"] = method_of(task);
  return out;
}

Result<CalibrationTask> task_from_json(const json& object, const evemu::TouchPlan& plan) {
  try {
    const auto method = object.at("method").get<std::string>();
    if (method == "otf") return OtfRequest{object.at("path_m").get<std::vector<AxisPosition>>()};
    if (method == "evemu") return evemu_request_of(object, plan);
    return fail(ErrorCode::Usage,
                fmt::format("calibrate: unknown method \"{}\", known: \"otf\", \"evemu\"", method));
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput, fmt::format("calibrate: {}", e.what()));
  }
}

RecordingAttachment to_attachment(const CalibrationRequest& request) {
  auto attachment = to_attachment(request.task);
  set_from(attachment, request.from);
  return attachment;
}

RecordingAttachment to_attachment(const CalibrationTask& task) {
  std::string content = to_json(task).dump();
  content.replace(0, 1, fmt::format("{}{:{}},", kFromKey, 0, kDigitsOfFrom));
  return {.name = fmt::format("{}{}{}", kRequestNamePrefix, method_of(task), kRequestNameSuffix),
          .media_type = "application/json",
          .content = std::move(content)};
}

void set_from(RecordingAttachment& attachment, protocol::HostTime from) noexcept {
  char* const place = attachment.content.data() + kFromKey.size();
  std::fill_n(place, kDigitsOfFrom, ' ');  // which JSON allows before and behind a number
  (void)std::to_chars(place, place + kDigitsOfFrom, from.time_since_epoch().count());
}

Result<CalibrationRequest> from_attachment(const RecordingAttachment& attachment) {
  try {
    const auto parsed = content_of(attachment);
    if (!parsed) return tl::unexpected(parsed.error());
    const json& content = *parsed;
    const protocol::HostTime from{
        std::chrono::nanoseconds{content.at("from_ns").get<std::int64_t>()}};
    auto task = task_from_json(content);
    if (!task)
      return fail(ErrorCode::BadInput,
                  fmt::format("attachment {}: {}", attachment.name, task.error().text));
    CalibrationRequest request;
    request.task = std::move(*task);
    request.from = from;
    return request;
  } catch (const json::exception& e) {
    return fail(ErrorCode::BadInput, fmt::format("attachment {}: {}", attachment.name, e.what()));
  }
}

}  // namespace abbe::daemon
