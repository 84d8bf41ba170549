#pragma once
/// Passes orders of an operator to the laser tracker, one at a time, and keeps their outcomes: the
/// daemon's part of `abbe tracker`. The tracker's thread executes an order and reports the answer
/// of the tracker, or that no answer came. For the hub's thread only; no call waits.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/drivers/tracker/order.hpp"
#include "abbe/pipeline/sample_source.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

class TrackerService {
 public:
  /// Number of orders that are kept, including the running one.
  static constexpr std::size_t kKept = 4;

  struct Order {
    drivers::TrackerOrder asked;
    std::string by;  ///< user who sent the order
    protocol::HostTime since{};
    std::optional<drivers::TrackerOrderReport> report;  ///< nullopt: the order is still running
  };
  /// Input of start() besides the order.
  struct Asked {
    std::string by;
    bool takes_readings = false;  ///< a calibration takes readings
    protocol::HostTime now{};
  };

  /// `longest_order`: host time. An order that is not reported within this time counts as Failed.
  TrackerService(SampleSource& devices, std::chrono::nanoseconds longest_order)
      : devices_(devices), longest_order_(longest_order) {}

  /// Starts an order and returns its number. Usage for an invalid distance or reflector name.
  /// Refused without a tracker, while a calibration takes readings, while another order runs, and
  /// while the tracker is not connected.
  [[nodiscard]] Result<std::uint64_t> start(drivers::TrackerOrder order, Asked asked);
  /// Takes the reports of the tracker's thread. Call in every cycle.
  void cycle(protocol::HostTime now);

  /// The orders that are kept, oldest first.
  [[nodiscard]] const std::deque<Order>& orders() const noexcept { return orders_; }
  /// The running order; null: none.
  [[nodiscard]] const Order* running() const noexcept;

 private:
  [[nodiscard]] Result<void> check(const drivers::TrackerOrder& order, bool takes_readings) const;
  void report_silence(protocol::HostTime now);

  SampleSource& devices_;
  std::chrono::nanoseconds longest_order_;
  std::uint64_t number_ = 0;
  std::deque<Order> orders_;
};

}  // namespace abbe::daemon
