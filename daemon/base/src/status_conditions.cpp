#include "abbe/base/status_conditions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

namespace abbe::daemon {
namespace {

using nlohmann::json;

/// Parts of abbed that "streams" lists in addition to the devices. Without the recorder or the
/// store a calibration is lost. Without DDS the machine runs without compensation; abbed reports
/// this as a warning, too.
struct Part {
  std::string_view stream;
  Level when_bad;
};
constexpr std::array kParts{Part{"recorder", Level::Fault}, Part{"models", Level::Fault},
                            Part{"dds", Level::Warning}, Part{"dds_security", Level::Warning},
                            Part{"identity", Level::Warning}};

const Part* part_of(const std::string& stream) {
  const auto* const part = std::ranges::find(kParts, stream, &Part::stream);
  return part != kParts.end() ? part : nullptr;
}

/// The text of a state: "connecting; last fault: tracker 10.0.0.7:700: no reply in 200 ms".
std::string text_of_state(const json& stream) {
  const auto fault = stream.at("last_fault").get<std::string>();
  return fmt::format("{}{}{}", stream.at("state").get<std::string>(),
                     fault.empty() ? "" : "; last fault: ", fault);
}

std::string upper(std::string text) {
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

}  // namespace

Condition device_condition(const json& status) {
  Condition out;
  for (const json& stream : status.at("streams")) {
    const auto name = stream.at("name").get<std::string>();
    if (part_of(name) != nullptr) continue;
    const auto condition = stream.at("condition").get<std::string>();
    if (!stream.at("connected").get<bool>()) {
      out[name] = {Level::Fault, text_of_state(stream)};
    } else if (!condition.empty()) {
      out[name] = {Level::Warning, condition};
    }
  }
  return out;
}

Condition system_condition(const json& status) {
  Condition out;
  for (const json& stream : status.at("streams")) {
    const auto name = stream.at("name").get<std::string>();
    const Part* const part = part_of(name);
    if (part == nullptr) continue;
    const auto condition = stream.at("condition").get<std::string>();
    if (!stream.at("connected").get<bool>()) {
      out[name] = {part->when_bad, text_of_state(stream)};
    } else if (!condition.empty()) {
      out[name] = {Level::Warning, condition};
    }
  }

  if (status.contains("clock"))
    out["CLOCK"] = {Level::Warning, status.at("clock").at(0).get<std::string>()};

  if (status.contains("release_awaited"))
    out["release"] = {Level::Fault,
                      fmt::format("{}; a person checks the machine, then: {}",
                                  status["release_awaited"].at("reason").get<std::string>(),
                                  status["release_awaited"].at("command").get<std::string>())};

  return out;
}

Condition model_condition(const json& status) {
  Condition out;
  const json& model = status.at("model");
  const auto state = model.at("state").get<std::string>();
  if (state != "ACTIVE")
    out["MODEL_" + state] = {state == "INVALID" ? Level::Fault : Level::Warning,
                             model.at("reason").get<std::string>()};

  if (model.contains("refused"))
    out["MODEL_REFUSED"] = {Level::Warning, model.at("reason").get<std::string>()};

  const json& session = status.at("session");
  if (session.at("state") == "refused")
    out["REFUSED_" + upper(session.at("code").get<std::string>())] = {
        Level::Warning, session.at("reason").get<std::string>()};

  if (status.contains("unmeasured_air"))
    out["AIR"] = {Level::Warning, status["unmeasured_air"].get<std::string>()};

  return out;
}

}  // namespace abbe::daemon
