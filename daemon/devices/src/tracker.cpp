#include "abbe/devices/tracker_options.hpp"

#include <chrono>
#include <cmath>
#include <span>
#include <string>
#include <variant>

#include "abbe/base/units.hpp"
#include "abbe/config/stretched.hpp"
#include "abbe/config/unmeasured_air.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "abbe/result/try.hpp"
#include "kinds.hpp"
#include "running.hpp"
#include "tracker_lines.hpp"

namespace abbe::daemon {
namespace {

using protocol::emscon::WeatherMonitor;

WeatherMonitor weather_monitor(WeatherConfig weather) {
  switch (weather) {
    case WeatherConfig::None:
      return WeatherMonitor::None;
    case WeatherConfig::Read:
      return WeatherMonitor::Read;
    case WeatherConfig::Compute:
      return WeatherMonitor::ReadAndCompute;
  }
  return WeatherMonitor::None;
}

protocol::emscon::Environment controller_units(const AssumedAir& air) {
  return {.temperature = air.temperature_K - kZeroCelsius_K,
          .pressure = air.pressure_Pa * 1e-2,  // mbar
          .humidity = air.relative_humidity * 1e2};
}

class RunningTracker final : public RunningDevices, private TrackerOrders {
 public:
  RunningTracker(Running<drivers::TrackerDevice> running, std::size_t place,
                 std::chrono::nanoseconds longest_order, double rate_hz)
      : running_(std::move(running)),
        place_(place),
        longest_order_(longest_order),
        rate_hz_(rate_hz) {}

  void drain(Batch& batch) override {
    drain_ring(running_.device->points(), points_, batch.points);
    drain_ring(running_.device->environment(), weather_, batch.environment);
    drain_raw(running_.device->raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] double nominal_rate_hz() const override { return rate_hz_; }
  [[nodiscard]] TrackerOrders* orders() noexcept override { return this; }

 private:
  [[nodiscard]] drivers::DeviceStatus status() const override { return running_.thread->status(); }
  [[nodiscard]] std::chrono::nanoseconds longest_order() const override { return longest_order_; }
  void order(drivers::TrackerOrder order) override { running_.device->order(std::move(order)); }
  [[nodiscard]] std::vector<drivers::TrackerOrderReport> reports() override {
    return running_.device->reports();
  }

  Running<drivers::TrackerDevice> running_;
  std::size_t place_;
  std::chrono::nanoseconds longest_order_;
  double rate_hz_;
  std::array<protocol::TrackerPoint, kMostSamples> points_;
  std::array<protocol::EnvironmentSample, 16> weather_;
  BlockBuffer blocks_;
};

/// Samples per second that the tracker sends; 0 for a tracker that sends mean values, because it
/// sends them only while the target rests.
double nominal_rate_hz(const TrackerConfig& config) {
  return config.mode == TrackerModeConfig::Continuous ? config.point_rate_hz : 0.0;
}

Result<std::unique_ptr<RunningDevices>> start_tracker(const DeviceStart& start) {
  const Config& config = start.config;
  const auto& tracker = config.of<TrackerConfig>();
  if (!tracker) return nullptr;
  if (tracker->lines)
    return start_line_tracker(start, line_options(*tracker, config.daemon.speed), start.first);
  auto options = device_options(*tracker, config.daemon.speed);
  if (config.daemon.simulated) options.clock_advice = kBusyComputer;
  auto running = run(drivers::TrackerDevice::create(options, start.time),
                     thread_options(config.daemon, "abbe-tracker", config.daemon.tracker_priority,
                                    config.daemon.tracker_cpu));
  ABBE_TRY(running);
  return std::make_unique<RunningTracker>(std::move(*running), start.first,
                                          drivers::longest_order(options.session),
                                          nominal_rate_hz(*tracker));
}

class TrackerDecoder final : public RawDecoders {
 public:
  explicit TrackerDecoder(const Config& config)
      : name_(config.of<TrackerConfig>()->name),
        receiver_(drivers::receiver_options(
            device_options(*config.of<TrackerConfig>(), config.daemon.speed))) {}

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_ || block.direction != protocol::RawBlock::Direction::FromDevice) return;
    if (block.lost_before > 0) receiver_.bytes_lost();
    receiver_.push(std::span{block.bytes}.first(block.length), block.time);

    while (const auto message = receiver_.next()) {
      if (const auto* burst = std::get_if<drivers::TrackerBurst>(&*message)) {
        batch.points.insert(batch.points.end(), burst->points.begin(), burst->points.end());
      } else if (const auto* weather = std::get_if<protocol::EnvironmentSample>(&*message)) {
        batch.environment.push_back(*weather);
      }
    }
  }

 private:
  std::string name_;
  drivers::TrackerReceiver receiver_;
};

void name_tracker(const Config& config, DeviceNames& names) {
  const auto& tracker = config.of<TrackerConfig>();
  if (!tracker) return;
  names.tracker = tracker->name;
  names.all.push_back(tracker->name);
}

std::unique_ptr<RawDecoders> decoders_of_tracker(const Config& config,
                                                 const std::optional<CountingProgress>&) {
  const auto& tracker = config.of<TrackerConfig>();
  if (!tracker) return nullptr;
  if (tracker->lines) return line_decoder(line_options(*tracker, config.daemon.speed));
  return std::make_unique<TrackerDecoder>(config);
}

}  // namespace

drivers::TrackerDeviceOptions device_options(const TrackerConfig& config, double speed) {
  drivers::TrackerDeviceOptions options;
  options.name = config.name;
  options.host = config.host;
  options.port = config.port;
  options.session.time_separation_ms =
      static_cast<std::int32_t>(std::lround(1000.0 / config.point_rate_hz));
  if (config.mode == TrackerModeConfig::Stationary)
    options.session.mode = drivers::TrackerMode::Stationary;
  options.session.stationary_time_ms =
      static_cast<std::int32_t>(config.stationary_time / std::chrono::milliseconds{1});
  options.session.weather = weather_monitor(config.weather);
  options.session.environment = controller_units(assumed_air());
  options.session.connect_timeout = stretched(config.connect_timeout, speed);
  options.session.command_timeout = stretched(config.command_timeout, speed);
  options.session.initialize_timeout = stretched(config.initialize_timeout, speed);
  options.session.silence_timeout = stretched(config.silence_timeout, speed);
  options.session.reflector = config.reflector;
  options.session.home_after_initialize = config.home_after_initialize;

  if (config.search) {
    constexpr double kUnitsPerMetre = 1e3;  // abbe sets the controller's unit to mm
    options.session.search = protocol::emscon::SetSearchParams{
        .radius = kUnitsPerMetre * config.search->radius_m,
        .timeout_ms =
            static_cast<std::int32_t>(config.search->timeout / std::chrono::milliseconds{1})};
  }

  options.clock.max_constant_delay = config.max_constant_delay;
  return options;
}

drivers::LineTrackerOptions line_options(const TrackerConfig& config, double speed) {
  drivers::LineTrackerOptions options;
  options.name = config.name;
  options.address = config.lines->address;
  options.receiver.format = config.lines->format;
  options.receiver.clock.max_constant_delay = config.max_constant_delay;
  options.receiver.stationary_time = config.stationary_time;
  if (config.mode == TrackerModeConfig::Continuous)
    options.receiver.time_separation =
        std::chrono::nanoseconds{std::llround(1e9 / config.point_rate_hz)};
  options.connect_timeout = stretched(config.connect_timeout, speed);
  options.silence_timeout = stretched(config.silence_timeout, speed);
  return options;
}

Result<drivers::LineTrackerOptions> parse_line_options(std::string_view table) {
  const auto config = parse_tracker_table(table);
  ABBE_TRY(config);
  if (!config->lines) return fail(ErrorCode::BadInput, "the table has another protocol than lines");
  return line_options(*config, 1.0);
}

const DeviceKind kTracker{.moves = true,
                          .name = &name_tracker,
                          .start = &start_tracker,
                          .decoders = &decoders_of_tracker};

}  // namespace abbe::daemon
