#include "abbed_options.hpp"

#include <string>

#include "abbe/devices/device_kind.hpp"
#include "abbe/messages/dds_security.hpp"

namespace abbe::daemon {

RecorderThreadOptions recorder_options(const Config& config, const std::string& name) {
  RecorderThreadOptions options;
  options.recorder.directory = config.recording.dir;
  options.recorder.name = name;
  options.recorder.chunk_bytes = config.recording.chunk_bytes;
  options.recorder.chunk_period = config.recording.chunk_period;
  options.recorder.min_free_bytes = config.recording.min_free_bytes;
  options.recorder.max_file_bytes = config.recording.max_file_bytes;
  options.recorder.sensors = sensor_check_options(config);
  options.recorder.weather_station = device_names(config).tracker;
  options.recorder.watermark = config.daemon.watermark;
  options.raw = config.recording.raw;

  options.devices = device_names(config);
  return options;
}

PublisherOptions publisher_options(const Config& config) {
  return {.machine = config.machine.name,
          .tool_offset_m = config.machine.target_offset_m,
          .snapshot_hz = config.dds.snapshot_hz,
          .compensation_hz = config.dds.compensation_hz,
          .validity = config.dds.validity,
          .security_warning = dds_is_secured(config.dds.security, config.dds.profile)
                                  ? std::string{}
                                  : dds_security_is_off(config.dds.domain),
          .identity = {.devices_simulated = config.daemon.simulated}};
}

DdsSupervisor::Options abbe_dds_options(const Config& config, const std::string& program,
                                        DdsProcess& process) {
  DdsSupervisor::Options child{.program = program,
                               .arguments = {"--socket", config.dds.socket.string(), "--domain",
                                             std::to_string(config.dds.domain)},
                               .priority = config.dds.priority,
                               .process = &process};

  if (!config.dds.profile.empty()) {
    child.arguments.insert(child.arguments.end(), {"--profile", config.dds.profile.string()});
  }

  if (!config.dds.security.empty()) {
    child.arguments.insert(child.arguments.end(), {"--security", config.dds.security.string()});
  }

  return child;
}

}  // namespace abbe::daemon
