#include "abbe/devices/device_set.hpp"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "abbe/devices/device_kind.hpp"
#include "abbe/devices/starvation.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

using protocol::HostTime;

struct DeviceSet::State {
  std::vector<std::unique_ptr<RunningDevices>> started;  // devices in the order of starting
  std::vector<RunningDevices*> devices;                  // devices in the order of device_kinds()
  MachineMotion* motion = nullptr;   // motion functions of the measuring machine, if there is one
  TrackerOrders* tracker = nullptr;  // orders of the tracker, if there is one
  /// By stream: the time of the previous call of health(), and the number of samples at that time.
  std::map<std::string, std::pair<HostTime, std::uint64_t>> counted;

  State() = default;
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  /// Destroys the devices in reverse order of starting. A device that moves was started last, so it
  /// ends first.
  ~State() {
    while (!started.empty()) started.pop_back();
  }

  std::map<std::string, Starvation> starved;  // one detector per stream

  StreamHealth health_of(const drivers::DeviceThread& thread, double nominal_rate_hz,
                         HostTime now) {
    StreamHealth h{.status = thread.status()};
    h.latency = thread.latency().read();
    h.latency_p50_s = std::chrono::duration<double>(h.latency.quantile(0.50)).count();
    h.latency_p99_s = std::chrono::duration<double>(h.latency.quantile(0.99)).count();

    auto& [at, samples] = counted[h.status.name];
    const std::chrono::duration<double> passed = now - at;
    if (at != HostTime{} && passed.count() > 0.0) {
      h.rate_hz = static_cast<double>(h.status.samples - samples) / passed.count();
    }

    at = now;
    samples = h.status.samples;
    const std::string missing =
        starved[h.status.name].look(nominal_rate_hz, h.status.state == "streaming", now, samples);
    if (h.status.condition.empty()) h.status.condition = missing;
    return h;
  }
};

Result<DeviceSet> DeviceSet::start(const Config& config, const drivers::TimeSource& time,
                                   const std::optional<CountingProgress>& left) {
  auto state = std::make_unique<State>();
  DeviceNames names;
  std::vector<std::size_t> first;
  for (const DeviceKind& kind : device_kinds()) {
    first.push_back(names.all.size());
    kind.name(config, names);
  }

  std::vector<RunningDevices*> by_kind(device_kinds().size());
  for (const bool moves : {false, true}) {
    for (std::size_t k = 0; k < by_kind.size(); ++k) {
      const DeviceKind& kind = device_kinds()[k];
      if (kind.moves != moves) continue;
      auto running = kind.start({.config = config, .time = time, .first = first[k], .left = left});
      ABBE_TRY(running);
      if (*running == nullptr) continue;
      if (auto* const motion = (*running)->motion()) state->motion = motion;
      if (auto* const tracker = (*running)->orders()) state->tracker = tracker;
      by_kind[k] = running->get();
      state->started.push_back(std::move(*running));
    }
  }

  std::ranges::copy_if(by_kind, std::back_inserter(state->devices),
                       [](const RunningDevices* running) { return running != nullptr; });
  return DeviceSet{std::move(state)};
}

DeviceSet::DeviceSet(std::unique_ptr<State> state) : state_(std::move(state)) {}
DeviceSet::~DeviceSet() = default;
DeviceSet::DeviceSet(DeviceSet&&) noexcept = default;
DeviceSet& DeviceSet::operator=(DeviceSet&&) noexcept = default;

void DeviceSet::drain(Batch& batch) {
  for (auto* const running : state_->devices) running->drain(batch);
}

std::vector<StreamHealth> DeviceSet::health(HostTime now) {
  std::vector<StreamHealth> out;
  for (auto* const running : state_->devices) {
    for (const auto* const thread : running->threads())
      out.push_back(state_->health_of(*thread, running->nominal_rate_hz(), now));
  }

  return out;
}

std::vector<std::string> DeviceSet::warnings() const {
  std::vector<std::string> out;
  for (auto* const running : state_->devices) {
    for (auto& warning : running->warnings()) out.push_back(std::move(warning));
  }

  return out;
}

std::optional<CountingProgress> DeviceSet::card_progress() {
  for (auto* const running : state_->devices) {
    if (auto progress = running->take_progress()) return progress;
  }

  return std::nullopt;
}

void DeviceSet::measure(std::span<const drivers::ProbePoint> points) {
  if (state_->motion != nullptr) state_->motion->measure(points);
}

Result<std::uint64_t> DeviceSet::stop_machine() {
  return state_->motion != nullptr ? Result<std::uint64_t>{state_->motion->stop()}
                                   : SampleSource::stop_machine();
}

drivers::IppStop DeviceSet::machine_stop() const {
  return state_->motion != nullptr ? state_->motion->last_stop() : drivers::IppStop{};
}

void DeviceSet::end_machine() {
  if (state_->motion != nullptr) state_->motion->end();
}

std::optional<drivers::IppStop> DeviceSet::finish_machine() {
  if (state_->motion == nullptr) return std::nullopt;
  return state_->motion->finish();
}

bool DeviceSet::moves() const {
  return state_->motion != nullptr;
}

std::optional<std::string> DeviceSet::release_awaited() const {
  return state_->motion != nullptr ? state_->motion->release_awaited() : std::nullopt;
}

Result<void> DeviceSet::release_machine() {
  return state_->motion != nullptr ? state_->motion->release() : SampleSource::release_machine();
}

std::optional<TipPlace> DeviceSet::tip_place() const {
  return state_->motion != nullptr ? state_->motion->tip_place() : std::nullopt;
}

std::size_t DeviceSet::points_left() const {
  return state_->motion != nullptr ? state_->motion->points_left() : 0;
}

Result<std::array<double, 3>> DeviceSet::machine_position() const {
  return state_->motion != nullptr ? state_->motion->position() : SampleSource::machine_position();
}

std::optional<drivers::DeviceStatus> DeviceSet::tracker_status() const {
  if (state_->tracker == nullptr) return std::nullopt;
  return state_->tracker->status();
}

void DeviceSet::order_tracker(drivers::TrackerOrder order) {
  if (state_->tracker != nullptr) state_->tracker->order(std::move(order));
}

std::chrono::nanoseconds DeviceSet::longest_tracker_order() const {
  return state_->tracker != nullptr ? state_->tracker->longest_order() : std::chrono::nanoseconds{};
}

std::vector<drivers::TrackerOrderReport> DeviceSet::tracker_reports() {
  return state_->tracker != nullptr ? state_->tracker->reports()
                                    : std::vector<drivers::TrackerOrderReport>{};
}

}  // namespace abbe::daemon
