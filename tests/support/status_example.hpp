#pragma once
/// An answer of abbed to "status", with the members that abbe-mtconnect and
/// abbe-notify read.

#include <nlohmann/json.hpp>

namespace abbe::test {

inline nlohmann::json stream(const char* name, const char* state, bool connected,
                             const char* last_fault = "", const char* condition = "") {
  return {{"name", name},
          {"state", state},
          {"connected", connected},
          {"last_fault", last_fault},
          {"condition", condition}};
}

/// Everything is in order.
inline nlohmann::json status() {
  return {
      {"ok", true},
      {"process", 4711},
      {"simulated", false},
      {"model",
       {{"state", "ACTIVE"},
        {"reason", "accepted by the gate"},
        {"id", "446300b9739c2c1a"},
        {"method", "otf"},
        {"hash", "e794"},
        {"created", "2026-11-26T08:30:00.123456789Z"},
        {"largest_U_um", 1.5}}},
      {"session",
       {{"id", 3}, {"state", "active"}, {"method", "otf"}, {"reason", "model is active"}}},
      {"streams",
       {stream("tracker", "streaming", true, "an old fault"), stream("encoder", "reading", true),
        stream("recorder", "recording", true), stream("dds_security", "on", true)}}};
}

}  // namespace abbe::test
