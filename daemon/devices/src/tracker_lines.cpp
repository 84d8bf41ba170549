#include "tracker_lines.hpp"

#include <utility>
#include <vector>

#include "abbe/result/try.hpp"
#include "running_lines.hpp"

namespace abbe::daemon {
namespace {

/// abbe sends nothing to a program that prints lines: it refuses every order.
class RunningLineTracker final : public RunningLines<drivers::LinePoints, &Batch::points>,
                                 private TrackerOrders {
 public:
  using RunningLines::RunningLines;
  [[nodiscard]] TrackerOrders* orders() noexcept override { return this; }

 private:
  [[nodiscard]] drivers::DeviceStatus status() const override { return device_status(); }
  [[nodiscard]] std::chrono::nanoseconds longest_order() const override {
    return std::chrono::seconds{1};
  }
  void order(drivers::TrackerOrder order) override {
    drivers::TrackerOrderReport report;
    report.number = order.number;
    report.outcome = drivers::TrackerOrderReport::Outcome::Refused;
    report.text = "protocol = \"lines\" has no orders: use the program that sends the lines";
    reports_.push_back(std::move(report));
  }
  [[nodiscard]] std::vector<drivers::TrackerOrderReport> reports() override {
    return std::exchange(reports_, {});
  }

  std::vector<drivers::TrackerOrderReport> reports_;
};

}  // namespace

Result<std::unique_ptr<RunningDevices>> start_line_tracker(
    const DeviceStart& start, const drivers::LineTrackerOptions& options, std::size_t place) {
  const DaemonConfig& daemon = start.config.daemon;
  auto running =
      run(drivers::LineTrackerDevice::create(options, start.time),
          thread_options(daemon, "abbe-tracker", daemon.tracker_priority, daemon.tracker_cpu));
  ABBE_TRY(running);
  // Not judged by its rate: a program prints when it measures.
  return std::make_unique<RunningLineTracker>(std::move(*running), place, 0.0);
}

std::unique_ptr<RawDecoders> line_decoder(const drivers::LineTrackerOptions& options) {
  return std::make_unique<LinesDecoder<drivers::LinePoints, &Batch::points>>(options);
}

}  // namespace abbe::daemon
