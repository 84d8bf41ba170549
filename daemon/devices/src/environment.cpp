#include <algorithm>
#include <string>

#include "abbe/config/stretched.hpp"
#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/environment/line.hpp"
#include "abbe/drivers/environment/receiver.hpp"
#include "abbe/result/try.hpp"
#include "kinds.hpp"
#include "running.hpp"

namespace abbe::daemon {
namespace {

drivers::EnvironmentDeviceOptions environment_options(const EnvironmentConfig& config,
                                                      double speed) {
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

/// One device of a line.
struct OnLine {
  drivers::EnvironmentDevice* device = nullptr;
  const drivers::DeviceThread* thread = nullptr;
};

/// Indices of the configured devices, grouped by line.
std::vector<std::vector<std::size_t>> devices_of_lines(
    const std::vector<EnvironmentConfig>& devices) {
  std::vector<std::vector<std::size_t>> lines;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const auto with_it = std::ranges::find_if(lines, [&](const auto& line) {
      return drivers::same_line(devices[line.front()].address, devices[i].address);
    });

    if (with_it != lines.end()) {
      with_it->push_back(i);
    } else {
      lines.push_back({i});
    }
  }

  return lines;
}

class RunningEnvironment final : public RunningDevices {
 public:
  [[nodiscard]] static Result<std::unique_ptr<RunningDevices>> of(const DeviceStart& start) {
    auto made = std::make_unique<RunningEnvironment>();
    const auto& configured = start.config.of<EnvironmentConfig>();
    made->devices_.resize(configured.size());
    made->first_ = start.first;
    for (const auto& devices : devices_of_lines(configured)) {
      ABBE_TRY(made->add_line(devices, start));
    }

    return made;
  }

  void drain(Batch& batch) override {
    for (std::size_t i = 0; i < devices_.size(); ++i) {
      auto& device = *devices_[i].device;
      for (protocol::EnvironmentSample sample; device.samples().pop({&sample, 1}) != 0;)
        batch.measured_environment.push_back({i, sample});
      drain_raw(device.raw(), blocks_, first_ + i, batch);
    }
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    std::vector<const drivers::DeviceThread*> all;
    for (const OnLine& device : devices_) all.push_back(device.thread);
    return all;
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    std::vector<std::string> out;
    for (const auto& line : lines_)
      out.insert(out.end(), line.thread->warnings().begin(), line.thread->warnings().end());
    return out;
  }

 private:
  Result<void> add_line(const std::vector<std::size_t>& devices, const DeviceStart& start) {
    std::vector<drivers::EnvironmentDeviceOptions> options;
    const auto& configured = start.config.of<EnvironmentConfig>();
    for (const std::size_t i : devices)
      options.push_back(environment_options(configured[i], start.config.daemon.speed));
    // The devices on the line are read once a second, so a thread without real-time priority is
    // sufficient.
    auto running = run(drivers::EnvironmentLine::create(options, start.time),
                       thread_options(start.config.daemon, "abbe-environ", 0, std::nullopt));
    ABBE_TRY(running);

    for (std::size_t k = 0; k < devices.size(); ++k)
      devices_[devices[k]] = {&running->device->device(k), running->thread.get()};
    lines_.push_back(std::move(*running));
    return {};
  }

  std::vector<Running<drivers::EnvironmentLine>> lines_;
  std::vector<OnLine> devices_;  // devices in the order of the configuration
  std::size_t first_ = 0;        // index of the first device in DeviceNames::all
  BlockBuffer blocks_;
};

Result<std::unique_ptr<RunningDevices>> start_environment(const DeviceStart& start) {
  if (start.config.of<EnvironmentConfig>().empty()) return nullptr;
  return RunningEnvironment::of(start);
}

class EnvironmentDecoders final : public RawDecoders {
 public:
  explicit EnvironmentDecoders(const Config& config) {
    for (const EnvironmentConfig& device : config.of<EnvironmentConfig>()) {
      names_.push_back(device.name);
      receivers_.emplace_back(device.map, drivers::transport_of(device.address));
    }
  }

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    for (std::size_t i = 0; i < receivers_.size(); ++i) {
      if (device == names_[i] && receivers_[i].on_raw(block))
        batch.measured_environment.push_back({i, receivers_[i].sample()});
    }
  }

 private:
  std::vector<std::string> names_;
  std::vector<drivers::EnvironmentReceiver> receivers_;
};

void name_environment(const Config& config, DeviceNames& names) {
  for (const EnvironmentConfig& device : config.of<EnvironmentConfig>()) {
    names.environment.push_back(device.name);
    names.all.push_back(device.name);
  }
}

std::unique_ptr<RawDecoders> decoders_of_environment(const Config& config,
                                                     const std::optional<CountingProgress>&) {
  return config.of<EnvironmentConfig>().empty() ? nullptr
                                                : std::make_unique<EnvironmentDecoders>(config);
}

}  // namespace

const DeviceKind kEnvironment{
    .name = &name_environment, .start = &start_environment, .decoders = &decoders_of_environment};

}  // namespace abbe::daemon
