#include "abbe/devices/device_options.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "abbe/base/units.hpp"
#include "abbe/config/stretched.hpp"
#include "abbe/config/touch_options.hpp"
#include "abbe/config/unmeasured_air.hpp"

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

protocol::emscon::Environment controller_units(const calib::Air& air) {
  return {.temperature = air.temperature_K - kZeroCelsius_K,
          .pressure = air.pressure_Pa * 1e-2,  // mbar
          .humidity = air.relative_humidity * 1e2};
}

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
    constexpr double kUnitsPerMetre = 1e3;  // abbe sets mm
    options.session.search = protocol::emscon::SetSearchParams{
        .radius = kUnitsPerMetre * config.search->radius_m,
        .timeout_ms =
            static_cast<std::int32_t>(config.search->timeout / std::chrono::milliseconds{1})};
  }

  options.clock.max_constant_delay = config.max_constant_delay;
  return options;
}

std::chrono::nanoseconds longest_tracker_order(const Config& config) {
  if (!config.tracker) return {};
  return drivers::longest_order(device_options(*config.tracker, config.daemon.speed).session);
}

drivers::EncoderDeviceOptions device_options(const EncoderConfig& config, double speed) {
  drivers::EncoderDeviceOptions options;
  options.name = config.name;
  options.sync = sync_source(config.sync);
  options.receiver.external_sync = config.sync == SyncConfig::External;
  options.receiver.sync_period = config.sync_period;
  options.receiver.sampling_delay = config.sampling_delay;
  options.receiver.u_sampling_delay = config.u_sampling_delay;
  options.receiver.heartbeat_timeout = stretched(options.receiver.heartbeat_timeout, speed);
  options.supervisor.silence = stretched(options.supervisor.silence, speed);
  options.supervisor.sdo.timeout = stretched(options.supervisor.sdo.timeout, speed);
  options.reopen_after = stretched(options.reopen_after, speed);

  for (const EncoderNodeConfig& node : config.nodes) {
    drivers::EncoderAxis axis;
    axis.name = node.axis;
    axis.node = node.node;
    axis.kind =
        node.kind == AxisKind::Rotary ? drivers::AxisKind::Rotary : drivers::AxisKind::Linear;
    axis.scale = node.step;
    axis.offset = node.offset;
    axis.tpdo = static_cast<std::uint8_t>(node.tpdo);
    axis.position_byte = static_cast<std::uint8_t>(node.position_byte);
    axis.wrap_counts = static_cast<std::uint64_t>(node.wrap_counts);
    options.receiver.axes.push_back(axis);
  }

  return options;
}

drivers::CounterCardOptions device_options(const CounterCardConfig& config, double speed) {
  drivers::CounterCardOptions options;
  options.name = config.name;
  options.serial = config.serial_number;
  options.receiver.wiring = config.wiring;
  options.receiver.clock.max_constant_delay = config.max_constant_delay;
  options.sample_every = config.sample_every;
  options.transfer_time = stretched(options.transfer_time, speed);
  auto& session = options.session;

  for (auto* time_out : {&session.open_timeout, &session.control_timeout, &session.silence,
                         &session.status_period, &session.reopen_after, &session.retry_after}) {
    *time_out = stretched(*time_out, speed);
  }

  return options;
}

drivers::EnvironmentDeviceOptions device_options(const EnvironmentConfig& config, double speed) {
  drivers::EnvironmentDeviceOptions options;
  options.name = config.name;
  options.address = config.address;
  options.map = config.map;
  options.period = config.period;
  options.answer_timeout = stretched(config.answer_timeout, speed);
  options.retry = stretched(options.retry, speed);
  options.refused_retry = stretched(options.refused_retry, speed);
  return options;
}

drivers::IppDeviceOptions device_options(const CmmConfig& config, double speed) {
  drivers::IppDeviceOptions options;
  options.name = config.name;
  options.host = config.host;
  options.port = config.port;
  options.session.tool = config.tool;
  options.session.home = config.home;
  options.session.poll_period = stretched(options.session.poll_period, speed);
  options.session.connect_timeout = stretched(options.session.connect_timeout, speed);
  options.session.command_timeout = stretched(config.command_timeout, speed);
  options.session.motion_timeout = stretched(config.motion_timeout, speed);
  options.receiver.probe = config.probe;
  options.receiver.u_position_m = config.u_position_m;

  return options;
}

}  // namespace abbe::daemon
