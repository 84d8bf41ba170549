#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <variant>

#include "abbe/config/stretched.hpp"
#include "abbe/drivers/ippdme/device.hpp"
#include "abbe/drivers/ippdme/receiver.hpp"
#include "abbe/result/try.hpp"
#include "kinds.hpp"
#include "machine_hold.hpp"
#include "running.hpp"

namespace abbe::daemon {
namespace {

drivers::IppDeviceOptions machine_options(const CmmConfig& config, double speed) {
  drivers::IppDeviceOptions options;
  options.name = config.name;
  options.host = config.host;
  options.port = config.port;
  options.session.tool = config.tool;
  options.session.home = config.home;
  options.session.poll_period = stretched(options.session.poll_period, speed);
  options.session.store_timeout = stretched(options.session.store_timeout, speed);
  options.session.connect_timeout = stretched(options.session.connect_timeout, speed);
  options.session.command_timeout = stretched(config.command_timeout, speed);
  options.session.motion_timeout = stretched(config.motion_timeout, speed);
  options.receiver.probe = config.probe;
  options.receiver.u_position_m = config.u_position_m;

  return options;
}

// Wall time. A tip position older than this is not used; a machine that is ready to move reports
// ten positions in this time.
constexpr auto kPositionIsOld = std::chrono::seconds{1};
// Largest delay until the device thread handles a request to stop. At 200 mm/s the machine moves 1
// mm in this time.
constexpr auto kMostStopDelay = std::chrono::milliseconds{5};

/// A measuring machine behind an I++ DME server, as source of touches, and also of axis samples if
/// the configuration has no other device that reads the axes.
class RunningMachine final : public RunningDevices, private MachineMotion {
 public:
  RunningMachine(Running<drivers::IppDevice> running, bool is_the_axes, const DeviceStart& start)
      : running_(std::move(running)),
        place_(start.first),
        is_the_axes_(is_the_axes),
        time_(start.time) {}

  void drain(Batch& batch) override {
    auto& device = *running_.device;
    drain_ring(device.touches(), touches_, batch.touches);
    while (const std::size_t n = device.positions().pop(axes_)) {
      stands_at_ = axes_[n - 1];
      if (is_the_axes_)
        batch.axes.insert(batch.axes.end(), axes_.begin(),
                          axes_.begin() + static_cast<std::ptrdiff_t>(n));
    }

    drain_raw(device.raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] MachineMotion* motion() noexcept override { return this; }

 private:
  void measure(std::span<const drivers::ProbePoint> points) override {
    running_.device->measure(points);
  }
  std::uint64_t stop() override { return running_.device->abort(); }
  [[nodiscard]] drivers::IppStop last_stop() const override { return running_.device->last_stop(); }
  void end() override { running_.device->end(); }
  drivers::IppStop finish() override {
    running_.thread->stop();
    return running_.device->finish();
  }
  [[nodiscard]] std::size_t points_left() const override { return running_.device->points_left(); }
  [[nodiscard]] std::optional<std::string> release_awaited() const override {
    if (!running_.device->held()) return std::nullopt;
    return running_.device->status().last_fault;
  }
  [[nodiscard]] Result<void> release() override;
  [[nodiscard]] std::optional<TipPlace> tip_place() const override {
    if (!stands_at_ || stands_at_->missing_mask != 0) return std::nullopt;
    return TipPlace{place(), time_.now() - stands_at_->head.time};
  }
  [[nodiscard]] Result<std::array<double, 3>> position() const override;
  [[nodiscard]] std::array<double, 3> place() const {
    return {stands_at_->position[0], stands_at_->position[1], stands_at_->position[2]};
  }

  Running<drivers::IppDevice> running_;
  std::size_t place_;
  bool is_the_axes_;
  const drivers::TimeSource& time_;
  std::optional<protocol::AxisSample> stands_at_;
  std::array<protocol::AxisSample, kMostSamples> axes_;
  std::array<protocol::ProbeTrigger, 16> touches_;
  BlockBuffer blocks_;
};

Result<void> RunningMachine::release() {
  auto& device = *running_.device;
  const auto status = device.status();
  const auto refused = [&](std::string_view why) {
    return fail(ErrorCode::Refused,
                fmt::format("machine: {} {}: it is {}", status.name, why, status.state));
  };

  if (!device.held()) return refused("awaits no release");
  if (!device.releasable()) return refused("cannot be released before its motion was stopped");
  device.release();
  return {};
}

Result<std::array<double, 3>> RunningMachine::position() const {
  const auto status = running_.thread->status();
  const auto refused = [&](std::string_view why) {
    return fail(
        ErrorCode::Refused,
        fmt::format("measuring machine {} {}{}{}", status.name, why,
                    status.last_fault.empty() ? "" : "; its last fault: ", status.last_fault));
  };

  if (release_awaited())
    return refused("awaits a release by the operator (`abbe machine release`)");
  if (status.state != drivers::name_of(drivers::IppState::Ready))
    return refused(fmt::format("is not ready: {}", status.state));
  if (!stands_at_ || time_.now() - stands_at_->head.time > time_.host(kPositionIsOld))
    return refused("has not reported its position within the last second");
  if (!std::ranges::all_of(place(), [](double p) { return std::isfinite(p); }))
    return refused("does not report a valid position");

  return place();
}

Result<std::unique_ptr<RunningDevices>> start_measuring_machine(const DeviceStart& start) {
  const Config& config = start.config;
  const auto& cmm = config.of<CmmConfig>();
  if (!cmm) return nullptr;
  auto options = machine_options(*cmm, config.daemon.speed);
  keep_hold(config.daemon.data_dir, options);
  auto thread = thread_options(config.daemon, "abbe-cmm", 0, std::nullopt);
  thread.wait_at_most = kMostStopDelay;
  auto running = run(drivers::IppDevice::create(options, start.time), std::move(thread));
  ABBE_TRY(running);
  return std::make_unique<RunningMachine>(std::move(*running), cmm_reads_axes(config), start);
}

class MachineDecoder final : public RawDecoders {
 public:
  explicit MachineDecoder(const Config& config)
      : name_(config.of<CmmConfig>()->name),
        is_the_axes_(cmm_reads_axes(config)),
        receiver_(std::make_unique<drivers::IppReceiver>(
            machine_options(*config.of<CmmConfig>(), config.daemon.speed).receiver)) {}

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_) return;
    const auto bytes = std::span{block.bytes}.first(block.length);
    if (block.direction == protocol::RawBlock::Direction::ToDevice)
      return receiver_->sent(bytes, block.time);

    // Lost bytes may cut a line in two: decoding restarts with the next connection.
    if (block.lost_before > 0) receiver_->push({}, block.time);
    receiver_->push(bytes, block.time);
    while (const auto message = receiver_->next()) {
      if (const auto* touch = std::get_if<protocol::ProbeTrigger>(&*message)) {
        batch.touches.push_back(*touch);
      } else if (const auto* sample = std::get_if<protocol::AxisSample>(&*message);
                 sample && is_the_axes_) {
        batch.axes.push_back(*sample);
      }
    }
  }

 private:
  std::string name_;
  bool is_the_axes_;
  std::unique_ptr<drivers::IppReceiver> receiver_;
};

void name_measuring_machine(const Config& config, DeviceNames& names) {
  const auto& cmm = config.of<CmmConfig>();
  if (!cmm) return;
  names.touches = cmm->name;
  if (cmm_reads_axes(config)) names.axes = cmm->name;
  names.all.push_back(cmm->name);
}

std::unique_ptr<RawDecoders> decoders_of_measuring_machine(const Config& config,
                                                           const std::optional<CountingProgress>&) {
  return config.of<CmmConfig>() ? std::make_unique<MachineDecoder>(config) : nullptr;
}

}  // namespace

const DeviceKind kMeasuringMachine{.moves = true,
                                   .name = &name_measuring_machine,
                                   .start = &start_measuring_machine,
                                   .decoders = &decoders_of_measuring_machine};

}  // namespace abbe::daemon
