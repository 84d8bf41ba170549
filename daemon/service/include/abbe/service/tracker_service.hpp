#pragma once
/// Orders of people to the laser tracker of [tracker], one at a time, and what came of them: the
/// daemon's part of `abbe tracker`. An order is handed to the tracker's thread; its report is what
/// the tracker answered, or that no answer came. The hub's thread only; no call waits for anything.

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
  /// The orders that are remembered, the one under way among them.
  static constexpr std::size_t kKept = 4;

  struct Order {
    drivers::TrackerOrder asked;
    std::string by;  ///< who asked
    protocol::HostTime since{};
    std::optional<drivers::TrackerOrderReport> report;  ///< none: under way
  };
  /// What start() has to know besides the order.
  struct Asked {
    std::string by;
    bool takes_readings = false;  ///< a calibration does
    protocol::HostTime now{};
  };

  /// `longest_order`, host time: an order without a report after it counts as Failed.
  TrackerService(SampleSource& devices, std::chrono::nanoseconds longest_order)
      : devices_(devices), longest_order_(longest_order) {}

  /// The number of the order. Usage for a distance or a name that cannot be. Refused without a
  /// tracker, while a calibration takes readings, while another order is under way, and while the
  /// tracker is not connected.
  [[nodiscard]] Result<std::uint64_t> start(drivers::TrackerOrder order, Asked asked);
  /// Every turn: takes the reports.
  void cycle(protocol::HostTime now);

  /// Oldest first.
  [[nodiscard]] const std::deque<Order>& orders() const noexcept { return orders_; }
  /// The order under way; null: none.
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
