#include "motion_requests.hpp"

#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

drivers::ProbePoint place_from(const json& place, bool touch) {
  return {.position_m = place.get<std::array<double, 3>>(), .touch = touch};
}

OnHub with_touching(std::function<Reply(TouchService&)> task) {
  return [task = std::move(task)](const Hub& hub) {
    TouchService* const service = hub.parts().touching;
    return service == nullptr ? reply(Error{ErrorCode::Refused, "touch: not in this daemon"})
                              : task(*service);
  };
}

/// The outcome of a touch job, copied on the hub's thread. Each touch has only the fields that the
/// answer contains.
struct SeenTouches {
  struct Made {
    std::array<double, 3> at_m{};
    double u_m = 0.0;
  };
  bool running = false;
  std::size_t asked = 0;
  std::string reason;
  drivers::IppStop stop;
  std::vector<Made> touches;
};

json touches_json(const SeenTouches& seen) {
  json made = json::array();
  for (const auto& t : seen.touches) made.push_back({{"at_m", t.at_m}, {"u_m", t.u_m}});
  json out{{"ok", true},
           {"running", seen.running},
           {"asked", seen.asked},
           {"reason", seen.reason},
           {"touches", std::move(made)}};
  add_stop(out, seen.stop);
  return out;
}

}  // namespace

void add_stop(json& answer, const drivers::IppStop& stop) {
  if (stop.outcome == drivers::IppStopOutcome::None) return;
  answer["stop"] = {
      {"number", stop.number}, {"outcome", name_of(stop.outcome)}, {"text", stop.text}};
}

Result<OnHub> cancel_touching(const HubParts&, const json&) {
  return with_touching([](TouchService& service) { return reply_done(service.cancel()); });
}

Result<OnHub> where_it_stands(const HubParts&, const json&) {
  return with_touching([](TouchService& service) {
    const auto at = service.where();
    return at ? reply(json{{"ok", true}, {"at_m", *at}}) : reply(at.error());
  });
}

Result<OnHub> begin_touching(const HubParts& parts, const json& request) {
  std::vector<TouchRequest> wanted;
  for (const json& point : request.at("points")) {
    TouchRequest& one = wanted.emplace_back();
    for (const json& place : point.at("way")) one.way.push_back(place_from(place, false));
    one.point = place_from(point.at("at_m"), true);
    one.point.normal = point.at("normal").get<std::array<double, 3>>();
  }

  std::vector<drivers::ProbePoint> leave;
  for (const json& place : request.value("leave", json::array()))
    leave.push_back(place_from(place, false));
  auto job = touch_job(motion_volume(parts.config), std::move(wanted), std::move(leave));
  ABBE_TRY(job);

  return with_touching(
      [shared = std::make_shared<TouchJob>(std::move(*job))](TouchService& service) {
        return reply_done(service.start(std::move(*shared)));
      });
}

Result<OnHub> look_at_touches(const HubParts&, const json&) {
  return with_touching([](TouchService& service) -> Reply {
    const TouchService::Status& status = service.look();
    SeenTouches seen{.running = status.running,
                     .asked = status.asked,
                     .reason = status.reason,
                     .stop = status.stop,
                     .touches = {}};
    seen.touches.reserve(status.touches.size());
    for (const auto& t : status.touches)
      seen.touches.push_back({{t.position[0], t.position[1], t.position[2]}, t.u_position[0]});
    return [seen = std::move(seen)] { return touches_json(seen); };
  });
}

Result<OnHub> release_machine(const HubParts&, const json&) {
  return [](const Hub& hub) {
    SampleSource& devices = hub.parts().devices;
    const auto awaited = devices.release_awaited();
    const auto released = devices.release_machine();
    return released ? reply(json{{"ok", true}, {"released", awaited.value_or("")}})
                    : reply(released.error());
  };
}

Result<OnHub> stop_machine(const HubParts& parts, const json&) {
  // This runs on the client's thread, so that a hub that hangs does not delay AbortE.
  const auto number = parts.devices.stop_machine();
  ABBE_TRY(number);
  return [number = *number](const Hub& hub) {
    auto* const touching = hub.parts().touching;
    if (touching != nullptr && touching->status().running) (void)touching->cancel();
    return reply(json{{"ok", true}, {"stop", number}});
  };
}

Result<OnHub> machine_state(const HubParts&, const json&) {
  return [](const Hub& hub) {
    SampleSource& devices = hub.parts().devices;
    const auto awaited = devices.release_awaited();
    json out{
        {"ok", true}, {"release_awaited", awaited.has_value()}, {"reason", awaited.value_or("")}};
    if (const auto tip = devices.tip_place()) {
      out["tip_m"] = tip->at_m;
      out["tip_age_s"] = in_seconds(tip->age);
    }
    add_stop(out, devices.machine_stop());
    return reply(std::move(out));
  };
}
}  // namespace abbe::daemon
