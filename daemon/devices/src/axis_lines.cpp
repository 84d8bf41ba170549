#include "abbe/devices/axis_lines_options.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <string>

#include "abbe/config/stretched.hpp"
#include "abbe/result/try.hpp"
#include "kinds.hpp"
#include "running_lines.hpp"

namespace abbe::daemon {
namespace {

using RunningAxisLines = RunningLines<drivers::LineAxes, &Batch::axes>;
using AxisLinesDecoder = LinesDecoder<drivers::LineAxes, &Batch::axes>;

Result<std::unique_ptr<RunningDevices>> start_axis_lines(const DeviceStart& start) {
  const Config& config = start.config;
  const auto& axes = config.of<AxisLinesConfig>();
  if (!axes) return nullptr;
  auto running =
      run(drivers::LineAxesDevice::create(line_options(*axes, config.daemon.speed), start.time),
          thread_options(config.daemon, "abbe-axes", config.daemon.encoder_priority,
                         config.daemon.encoder_cpu));
  ABBE_TRY(running);
  return std::make_unique<RunningAxisLines>(std::move(*running), start.first, axes->sample_rate_hz);
}

void name_axis_lines(const Config& config, DeviceNames& names) {
  const auto& axes = config.of<AxisLinesConfig>();
  if (!axes) return;
  names.axes = axes->name;
  names.all.push_back(axes->name);
}

std::unique_ptr<RawDecoders> decoders_of_axis_lines(const Config& config,
                                                    const std::optional<CountingProgress>&) {
  const auto& axes = config.of<AxisLinesConfig>();
  if (!axes) return nullptr;
  return std::make_unique<AxisLinesDecoder>(line_options(*axes, config.daemon.speed));
}

}  // namespace

drivers::LineAxesOptions line_options(const AxisLinesConfig& config, double speed) {
  drivers::LineAxesOptions options;
  options.name = config.name;
  options.address = config.address;
  options.receiver.format = config.format;
  options.receiver.clock.max_constant_delay = config.latency.value_or(config.max_constant_delay);
  options.receiver.time_separation =
      std::chrono::nanoseconds{std::llround(1e9 / config.sample_rate_hz)};
  options.connect_timeout = stretched(config.connect_timeout, speed);
  options.silence_timeout = stretched_silence(config.silence_timeout, speed);
  return options;
}

const DeviceKind kAxisLines{
    .name = &name_axis_lines, .start = &start_axis_lines, .decoders = &decoders_of_axis_lines};

}  // namespace abbe::daemon
