#include "abbe/base/units.hpp"
#include "abbe/devices/encoder_options.hpp"

#include <string>

#include "abbe/config/stretched.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/can/socket_can_bus.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/result/try.hpp"
#include "kinds.hpp"
#include "running.hpp"

namespace abbe::daemon {
namespace {

drivers::SyncSource sync_source(SyncConfig sync) {
  switch (sync) {
    case SyncConfig::Daemon:
      return drivers::SyncSource::Thread;
    case SyncConfig::Kernel:
      return drivers::SyncSource::Kernel;
    case SyncConfig::External:
      return drivers::SyncSource::External;
  }
  return drivers::SyncSource::Thread;
}

std::unique_ptr<drivers::CanBus> make_bus(const EncoderConfig& config, double speed,
                                          const drivers::TimeSource& time) {
  if (config.transport == EncoderTransport::SocketCan) {
    return std::make_unique<drivers::SocketCanBus>(
        drivers::SocketCanOptions{.interface = config.interface, .speed = speed}, time);
  }

  return std::make_unique<drivers::UdpCanBus>(
      drivers::UdpCanOptions{.local_port = config.local_port,
                             .peer_address = config.peer_host,
                             .peer_port = config.peer_port,
                             .speed = speed},
      time);
}

class RunningEncoder final : public RunningDevices {
 public:
  RunningEncoder(Running<drivers::EncoderDevice> running, std::size_t place, double rate_hz)
      : running_(std::move(running)), place_(place), rate_hz_(rate_hz) {}

  void drain(Batch& batch) override {
    drain_ring(running_.device->samples(), axes_, batch.axes);
    drain_raw(running_.device->raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] double nominal_rate_hz() const override { return rate_hz_; }

 private:
  Running<drivers::EncoderDevice> running_;
  std::size_t place_;
  double rate_hz_;
  std::array<protocol::AxisSample, kMostSamples> axes_;
  BlockBuffer blocks_;
};

Result<std::unique_ptr<RunningDevices>> start_encoder(const DeviceStart& start) {
  const Config& config = start.config;
  const auto& encoder = config.of<EncoderConfig>();
  if (!encoder) return nullptr;
  auto options = device_options(*encoder, config.daemon.speed);
  if (config.daemon.simulated) options.delay_advice = kBusyComputer;
  auto running = run(drivers::EncoderDevice::create(
                         options, make_bus(*encoder, config.daemon.speed, start.time), start.time),
                     thread_options(config.daemon, "abbe-encoder", config.daemon.encoder_priority,
                                    config.daemon.encoder_cpu));
  ABBE_TRY(running);
  return std::make_unique<RunningEncoder>(std::move(*running), start.first,
                                          1.0 / in_seconds(encoder->sync_period));
}

class EncoderDecoder final : public RawDecoders {
 public:
  explicit EncoderDecoder(const Config& config)
      : name_(config.of<EncoderConfig>()->name),
        receiver_(device_options(*config.of<EncoderConfig>(), config.daemon.speed).receiver) {}

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_) return;
    receiver_.on_raw(block, [&](const protocol::AxisSample& s) { batch.axes.push_back(s); });
  }
  void finish(Batch& batch) override {
    for (const protocol::AxisSample& s : receiver_.on_end()) batch.axes.push_back(s);
  }

 private:
  std::string name_;
  drivers::EncoderReceiver receiver_;
};

void name_encoder(const Config& config, DeviceNames& names) {
  const auto& encoder = config.of<EncoderConfig>();
  if (!encoder) return;
  names.axes = encoder->name;
  names.all.push_back(encoder->name);
}

std::unique_ptr<RawDecoders> decoders_of_encoder(const Config& config,
                                                 const std::optional<CountingProgress>&) {
  return config.of<EncoderConfig>() ? std::make_unique<EncoderDecoder>(config) : nullptr;
}

}  // namespace

drivers::EncoderDeviceOptions device_options(const EncoderConfig& config, double speed) {
  drivers::EncoderDeviceOptions options;
  options.name = config.name;
  options.sync = sync_source(config.sync);
  options.receiver.external_sync = config.sync == SyncConfig::External;
  options.receiver.sync_period = config.sync_period;
  options.receiver.sampling_delay = config.sampling_delay;
  options.receiver.u_sampling_delay = config.u_sampling_delay;
  options.receiver.heartbeat_timeout = stretched_silence(options.receiver.heartbeat_timeout, speed);
  options.supervisor.silence = stretched_silence(options.supervisor.silence, speed);
  options.supervisor.sdo.timeout = stretched(options.supervisor.sdo.timeout, speed);
  options.reopen_after = stretched(options.reopen_after, speed);

  for (const EncoderNodeConfig& node : config.nodes) {
    drivers::EncoderAxis axis;
    axis.name = node.axis;
    axis.node = node.node;
    axis.kind = node.kind;
    axis.scale = node.step;
    axis.offset = node.offset;
    axis.middle = node.middle;
    axis.tpdo = static_cast<std::uint8_t>(node.tpdo);
    axis.position_byte = static_cast<std::uint8_t>(node.position_byte);
    axis.wrap_counts = static_cast<std::uint64_t>(node.wrap_counts);
    options.receiver.axes.push_back(axis);
  }

  return options;
}

const DeviceKind kEncoder{
    .name = &name_encoder, .start = &start_encoder, .decoders = &decoders_of_encoder};

}  // namespace abbe::daemon
