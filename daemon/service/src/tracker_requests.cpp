#include "tracker_requests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>
#include <utility>

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {
namespace {

using drivers::TrackerOrder;
using drivers::TrackerOrderReport;
using nlohmann::json;

/// All orders except the list of reflectors, which has a separate request because it moves nothing.
constexpr std::array kMovingOrders{TrackerOrder::What::Initialize, TrackerOrder::What::GoHome,
                                   TrackerOrder::What::FindReflector,
                                   TrackerOrder::What::SetReflector};

const char* outcome_word(TrackerOrderReport::Outcome outcome) {
  switch (outcome) {
    case TrackerOrderReport::Outcome::Done:
      return "done";
    case TrackerOrderReport::Outcome::Refused:
      return "refused";
    case TrackerOrderReport::Outcome::Failed:
      break;
  }
  return "failed";
}

json order_json(const TrackerService::Order& order) {
  json out{{"number", order.asked.number},
           {"order", drivers::name_of(order.asked.what)},
           {"by", order.by},
           {"outcome", order.report ? outcome_word(order.report->outcome) : "running"},
           {"text", order.report ? order.report->text : ""}};
  if (!order.report || order.report->reflectors.empty()) return out;
  json& list = out["reflectors"] = json::array();
  for (const auto& r : order.report->reflectors)
    list.push_back({{"id", r.id}, {"name", r.name}, {"in_use", r.in_use}});
  return out;
}

}  // namespace

std::optional<SeenTracker> look_at_tracker(const HubParts& parts) {
  auto status = parts.devices.tracker_status();
  if (!status || parts.tracker == nullptr) return std::nullopt;
  return SeenTracker{std::move(*status), parts.tracker->orders()};
}

json tracker_json(const SeenTracker& seen) {
  json orders = json::array();
  for (const auto& order : seen.orders) orders.push_back(order_json(order));
  return {{"name", seen.status.name},
          {"state", seen.status.state},
          {"connected", seen.status.connected},
          {"last_fault", seen.status.last_fault},
          {"orders", std::move(orders)}};
}

Result<TrackerOrder> tracker_order_from_json(const json& request) {
  const auto word = request.at("order").get<std::string>();
  const auto what = std::ranges::find(kMovingOrders, word, [](TrackerOrder::What order) {
    return std::string_view{drivers::name_of(order)};
  });

  if (what == kMovingOrders.end())
    return fail(ErrorCode::Usage,
                "tracker: unknown order: known are initialize, home, find, reflector set");
  TrackerOrder order{.what = *what};
  if (order.what == TrackerOrder::What::SetReflector)
    order.reflector = request.at("reflector").get<std::string>();

  if (order.what == TrackerOrder::What::FindReflector) {
    // the distance is missing or not a number; JSON has no NaN
    const json distance = request.value("distance_m", json{});
    order.distance_m =
        distance.is_number() ? distance.get<double>() : std::numeric_limits<double>::quiet_NaN();
  }

  return order;
}

Result<std::uint64_t> order_tracker(const HubParts& parts, const TrackerOrder& order,
                                    const std::string& by) {
  if (parts.tracker == nullptr) return fail(ErrorCode::Refused, "tracker: not in this daemon");
  return parts.tracker->start(order,
                              {.by = by,
                               .takes_readings = takes_readings(parts.calibration.status().state),
                               .now = parts.time.now()});
}

}  // namespace abbe::daemon
