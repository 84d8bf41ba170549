#include "abbe/service/tracker_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "abbe/config/capabilities.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

using drivers::TrackerOrder;
using drivers::TrackerOrderReport;

/// The fault of the order; empty if it is valid.
std::string order_fault(const TrackerOrder& order) {
  const bool reachable = order.distance_m > 0.0 && order.distance_m <= drivers::kLongestSearch_m;
  if (order.what == TrackerOrder::What::FindReflector && !reachable)
    return fmt::format("the distance must be above 0 and at most {:g} m",
                       drivers::kLongestSearch_m);
  const bool named =
      !order.reflector.empty() && order.reflector.size() <= drivers::kLongestReflectorName;
  if (order.what == TrackerOrder::What::SetReflector && !named)
    return fmt::format("the reflector's name or id must have 1 to {} bytes",
                       drivers::kLongestReflectorName);
  return {};
}

}  // namespace

const TrackerService::Order* TrackerService::running() const noexcept {
  return !orders_.empty() && !orders_.back().report ? &orders_.back() : nullptr;
}

Result<void> TrackerService::check(const TrackerOrder& order, bool takes_readings) const {
  const auto not_now = [&](ErrorCode code, const std::string& why) {
    return fail(code, fmt::format("tracker: {}: {}", drivers::name_of(order.what), why));
  };

  if (const std::string fault = order_fault(order); !fault.empty())
    return not_now(ErrorCode::Usage, fault);
  const auto status = devices_.tracker_status();
  if (!status)
    return not_now(ErrorCode::Refused,
                   fmt::format("there is no tracker, {} host, in the configuration",
                               tables_with(Capability::TrackerPoints)));
  if (takes_readings)
    return not_now(ErrorCode::Refused,
                   "a calibration takes readings: wait until it has ended, or cancel it (`abbe "
                   "calibrate ... --cancel`)");
  if (const Order* other = running(); other != nullptr)
    return not_now(ErrorCode::Refused, fmt::format("\"{}\" of {} is under way",
                                                   drivers::name_of(other->asked.what), other->by));
  if (!status->connected)
    return not_now(
        ErrorCode::Refused,
        fmt::format("the tracker is not connected: {}{}{}", status->state,
                    status->last_fault.empty() ? "" : "; last fault: ", status->last_fault));

  return {};
}

Result<std::uint64_t> TrackerService::start(TrackerOrder order, Asked asked) {
  ABBE_TRY(check(order, asked.takes_readings));
  order.number = ++number_;
  orders_.push_back({order, std::move(asked.by), asked.now, std::nullopt});
  if (orders_.size() > kKept) orders_.pop_front();
  devices_.order_tracker(std::move(order));
  return number_;
}

void TrackerService::cycle(protocol::HostTime now) {
  for (TrackerOrderReport& report : devices_.tracker_reports()) {
    const auto order =
        std::ranges::find(orders_, report.number, [](const Order& o) { return o.asked.number; });
    if (order != orders_.end()) order->report = std::move(report);
  }
  report_silence(now);
}

/// Sets the outcome of an order to Failed if no report has come within longest_order_. The
/// tracker's thread reports every order, so without a report it has ended or hangs. A report that
/// arrives later replaces this outcome.
void TrackerService::report_silence(protocol::HostTime now) {
  const Order* const order = running();
  if (order == nullptr || now - order->since <= longest_order_) return;
  const double waited_s = std::chrono::duration<double>(longest_order_).count();
  orders_.back().report = TrackerOrderReport{
      .number = order->asked.number,
      .outcome = TrackerOrderReport::Outcome::Failed,
      .text = fmt::format("no report in {:g} s: the outcome is not known; look at the "
                          "tracker",
                          waited_s),
      .reflectors = {}};
}

}  // namespace abbe::daemon
