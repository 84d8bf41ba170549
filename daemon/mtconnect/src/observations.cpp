#include "abbe/mtconnect/observations.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <string_view>

#include "abbe/base/units.hpp"

namespace abbe::mtconnect {
namespace {

using nlohmann::json;

constexpr std::array kEvents{"avail",       "process_state", "process_id", "process_kind",
                             "model_state", "model_id",      "model_hash", "model_date",
                             "u_volume",    "u_type",        "simulated"};
constexpr std::array kConditions{"devices", "system", "calibration"};

/// The state of a calibration as a value of the MTConnect data item PROCESS_STATE.
std::string process_state(const std::string& session_state) {
  static const std::map<std::string, std::string> kStates{
      {"idle", "READY"},         {"warming", "INITIALIZING"}, {"acquiring", "ACTIVE"},
      {"identifying", "ACTIVE"}, {"judged", "ACTIVE"},        {"active", "COMPLETE"},
      {"refused", "ABORTED"}};
  return kStates.at(session_state);
}

/// Largest combined standard uncertainty of V in mm. `largest_U_um`: expanded, k = 2.
std::string standard_uncertainty_mm(double largest_U_um) {
  constexpr double kCoverageFactor = 2.0;
  return fmt::format("{:.7f}", largest_U_um / kCoverageFactor / daemon::kUmPerM * daemon::kMmPerM);
}

std::optional<std::string> text_if_any(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || found->get_ref<const std::string&>().empty()) return std::nullopt;
  return found->get<std::string>();
}

void observe_session(const json& session, Observations& out) {
  const auto state = session.at("state").get<std::string>();
  out["process_state"] = std::optional(process_state(state));
  out["message"] = std::optional(Message{state, session.at("reason").get<std::string>()});

  const auto id = session.at("id").get<std::uint64_t>();
  if (id == 0) return;  // no calibration since abbed started
  out["process_id"] = std::optional(std::to_string(id));
  out["process_kind"] = text_if_any(session, "method");
}

void observe_model(const json& model, Observations& out) {
  out["model_state"] = text_if_any(model, "state");
  out["model_id"] = text_if_any(model, "id");
  out["model_hash"] = text_if_any(model, "hash");
  out["model_date"] = text_if_any(model, "created");
  if (!model.contains("largest_U_um")) return;
  out["u_volume"] = std::optional(standard_uncertainty_mm(model["largest_U_um"].get<double>()));
  out["u_type"] = std::optional<std::string>("COMBINED");
}

/// YES if the devices or the active model are simulated. Older versions of abbed do not report it.
std::optional<std::string> simulated(const json& status) {
  if (!status.contains("simulated")) return std::nullopt;
  const bool model = status.at("model").value("simulated", false);
  return model || status.at("simulated").get<bool>() ? "YES" : "NO";
}

}  // namespace

Observations nothing_observed() {
  Observations out;
  for (const char* name : kEvents) out[name] = std::optional<std::string>{};
  for (const char* name : kConditions) out[name] = std::optional<Condition>{};
  out["message"] = std::optional<Message>{};
  return out;
}

Observations observations_of(const json& status) {
  Observations out = nothing_observed();
  out["avail"] = std::optional<std::string>("AVAILABLE");
  observe_session(status.at("session"), out);
  observe_model(status.at("model"), out);
  out["simulated"] = simulated(status);
  out["devices"] = std::optional(daemon::device_condition(status));
  out["system"] = std::optional(daemon::system_condition(status));
  out["calibration"] = std::optional(daemon::model_condition(status));
  return out;
}

}  // namespace abbe::mtconnect
