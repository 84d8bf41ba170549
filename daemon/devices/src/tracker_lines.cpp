#include "tracker_lines.hpp"

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "abbe/drivers/lines/receiver.hpp"
#include "abbe/result/try.hpp"
#include "running.hpp"

namespace abbe::daemon {
namespace {

/// abbe sends nothing to a program that prints lines: it refuses every order.
class RunningLineTracker final : public RunningDevices, private TrackerOrders {
 public:
  RunningLineTracker(Running<drivers::LineTrackerDevice> running, std::size_t place)
      : running_(std::move(running)), place_(place) {}

  void drain(Batch& batch) override {
    drain_ring(running_.device->points(), points_, batch.points);
    drain_raw(running_.device->raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] TrackerOrders* orders() noexcept override { return this; }

 private:
  [[nodiscard]] drivers::DeviceStatus status() const override { return running_.thread->status(); }
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

  Running<drivers::LineTrackerDevice> running_;
  std::size_t place_;
  std::vector<drivers::TrackerOrderReport> reports_;
  std::array<protocol::TrackerPoint, kMostSamples> points_;
  BlockBuffer blocks_;
};

/// Gives the receiver whole reads, as the device does: the last point of a read is the one that the
/// clock model observes.
class LineDecoder final : public RawDecoders {
 public:
  explicit LineDecoder(const drivers::LineTrackerOptions& options)
      : name_(options.name), receiver_(drivers::receiver_options(options)) {}

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_ || block.direction != protocol::RawBlock::Direction::FromDevice) return;
    if (block.lost_before > 0) {
      read_.clear();
      receiver_.bytes_lost();
    }
    const auto bytes = std::span{block.bytes}.first(block.length);
    read_.insert(read_.end(), bytes.begin(), bytes.end());
    if (block.continued) return;
    receiver_.push(read_, block.time);
    for (auto points = receiver_.next(); !points.empty(); points = receiver_.next())
      batch.points.insert(batch.points.end(), points.begin(), points.end());
    read_.clear();
  }

 private:
  std::string name_;
  drivers::LineReceiver receiver_;
  std::vector<std::byte> read_;
};

}  // namespace

Result<std::unique_ptr<RunningDevices>> start_line_tracker(
    const DeviceStart& start, const drivers::LineTrackerOptions& options, std::size_t place) {
  const DaemonConfig& daemon = start.config.daemon;
  auto running =
      run(drivers::LineTrackerDevice::create(options, start.time),
          thread_options(daemon, "abbe-tracker", daemon.tracker_priority, daemon.tracker_cpu));
  ABBE_TRY(running);
  return std::make_unique<RunningLineTracker>(std::move(*running), place);
}

std::unique_ptr<RawDecoders> line_decoder(const drivers::LineTrackerOptions& options) {
  return std::make_unique<LineDecoder>(options);
}

}  // namespace abbe::daemon
