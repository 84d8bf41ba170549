#include "abbe/devices/device_set.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/config/touch_options.hpp"
#include "abbe/devices/device_options.hpp"
#include "abbe/drivers/can/socket_can_bus.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "abbe/drivers/environment/line.hpp"
#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/drivers/sampling/touch_detector.hpp"
#include "abbe/drivers/usb/libusb_link.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"
#include "machine_hold.hpp"

namespace abbe::daemon {
namespace {

using drivers::DeviceThread;
using protocol::HostTime;

// How much one call takes out of a ring: several bursts.
constexpr std::size_t kMostSamples = 1024;
constexpr std::size_t kMostBlocks = 128;
// wall time: a ready machine says it ten times in it
constexpr auto kPositionIsOld = std::chrono::seconds{1};

// How long a request to stop the machine may wait for its thread: 2 mm at 200 mm/s.
constexpr auto kStopIsHeard = std::chrono::milliseconds{10};

Error error_of(const drivers::Error& error) {
  return {error.code == drivers::ErrorCode::BadConfiguration ? ErrorCode::BadInput : ErrorCode::Io,
          error.text};
}

template <class Ring, class T, std::size_t N>
void drain_ring(Ring& ring, std::array<T, N>& room, std::vector<T>& out) {
  for (std::size_t n = room.size(); n == room.size();) {
    n = ring.pop(room);
    out.insert(out.end(), room.begin(), room.begin() + static_cast<std::ptrdiff_t>(n));
  }
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

std::unique_ptr<drivers::UsbLink> make_link(const CounterCardConfig& config,
                                            const drivers::UsbIdentity& identity,
                                            const drivers::TimeSource& time) {
  if (config.transport == CardTransport::Usb)
    return std::make_unique<drivers::LibusbLink>(identity, time);
  return std::make_unique<drivers::UsbipLink>(
      drivers::UsbipOptions{
          .host = config.host, .port = config.port, .bus_id = config.bus_id, .identity = identity},
      time);
}

drivers::DeviceThreadOptions thread_options(const DaemonConfig& config, std::string name,
                                            int priority, std::optional<int> cpu) {
  const bool enforce = config.realtime == RealTimeMode::Enforce;
  return {.name = std::move(name),
          .mode = enforce ? drivers::RealTimeMode::Enforce : drivers::RealTimeMode::Ignore,
          .lock_memory = enforce,
          .priority = priority,
          .cpu = cpu};
}

/// A device with its thread, and what is needed to say its rate. Destroyed: the thread ends first.
template <class D>
struct Running {
  std::unique_ptr<D> device;
  std::unique_ptr<DeviceThread> thread;
};

template <class D>
// NOLINTNEXTLINE(performance-unnecessary-value-param): moved, which clang-tidy 14 does not see in a template
Result<Running<D>> run(drivers::Result<std::unique_ptr<D>> device,
                       drivers::DeviceThreadOptions options) {
  if (!device) return tl::unexpected(error_of(device.error()));
  auto thread = DeviceThread::start(**device, std::move(options));
  if (!thread) return tl::unexpected(error_of(thread.error()));
  return Running<D>{std::move(*device), std::move(*thread)};
}

/// One of the devices of a line.
struct OnLine {
  drivers::EnvironmentDevice* device;
  const DeviceThread* thread;
};

/// The devices of the configuration, those of one line together.
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

}  // namespace

struct DeviceSet::State {
  // Before the cards that feed them: destroyed after them.
  std::unique_ptr<drivers::TouchDetector> touch_detector;
  drivers::MarkWatcher mark_watcher;
  std::optional<Running<drivers::TrackerDevice>> tracker;
  std::optional<Running<drivers::EncoderDevice>> encoder;
  std::optional<Running<drivers::CounterCardDevice>> counter_card;
  std::optional<Running<drivers::CounterCardDevice>> reference_card;
  std::vector<Running<drivers::EnvironmentLine>> environment_lines;
  std::vector<OnLine> environments;  // in the order of the configuration
  std::optional<Running<drivers::IppDevice>> cmm;
  bool cmm_is_the_axes = false;
  std::optional<protocol::AxisSample> cmm_stands_at;
  std::optional<drivers::CounterCardProgress> card_progress;
  const drivers::TimeSource* time = nullptr;
  std::array<protocol::TrackerPoint, kMostSamples> points;
  std::array<protocol::AxisSample, kMostSamples> axes;
  std::array<protocol::EnvironmentSample, 16> environment;
  std::array<protocol::ProbeTrigger, 16> touches;
  std::array<protocol::TouchScan, 256> touch_scans;
  std::array<drivers::MarkCrossing, 64> marks;
  std::array<protocol::RawBlock, kMostBlocks> blocks;
  std::map<std::string, std::pair<HostTime, std::uint64_t>> counted;  // at the previous health()

  void drain_environment(std::size_t i, Batch& batch) {
    auto& device = *environments[i].device;
    for (protocol::EnvironmentSample sample; device.samples().pop({&sample, 1}) != 0;)
      batch.measured_environment.push_back({i, sample});
    while (const std::size_t n = device.raw().pop(blocks)) {
      for (std::size_t b = 0; b < n; ++b) batch.environment_raw.push_back({i, blocks[b]});
    }
  }

  StreamHealth health_of(const DeviceThread& thread, HostTime now) {
    StreamHealth h{.status = thread.status()};
    const auto latency = thread.latency().read();
    h.latency_p50_s = std::chrono::duration<double>(latency.quantile(0.50)).count();
    h.latency_p99_s = std::chrono::duration<double>(latency.quantile(0.99)).count();
    auto& [at, samples] = counted[h.status.name];
    const std::chrono::duration<double> passed = now - at;
    if (at != HostTime{} && passed.count() > 0.0) {
      h.rate_hz = static_cast<double>(h.status.samples - samples) / passed.count();
    }
    at = now;
    samples = h.status.samples;
    return h;
  }
};

Result<DeviceSet> DeviceSet::start(const Config& config, const drivers::TimeSource& time,
                                   const std::optional<drivers::CounterCardProgress>& left) {
  auto state = std::make_unique<State>();
  state->time = &time;
  if (config.encoder) {
    auto running = run(
        drivers::EncoderDevice::create(device_options(*config.encoder, config.daemon.speed),
                                       make_bus(*config.encoder, config.daemon.speed, time), time),
        thread_options(config.daemon, "abbe-encoder", config.daemon.encoder_priority,
                       config.daemon.encoder_cpu));
    if (!running) return tl::unexpected(running.error());
    state->encoder.emplace(std::move(*running));
  }

  if (config.counter_card) {
    auto options = device_options(*config.counter_card, config.daemon.speed);
    if (left) {
      options.receiver.goes_on_from = left;
      options.session.set_up_serial = std::string{left->serial_number()};
    }
    auto link = make_link(*config.counter_card, drivers::identity_of(options), time);
    if (config.probe) {
      state->touch_detector = std::make_unique<drivers::TouchDetector>(
          touch_options(*config.probe, *config.counter_card, config.machine));
    }
    auto running = run(drivers::CounterCardDevice::create(options, std::move(link), time,
                                                          state->touch_detector.get()),
                       thread_options(config.daemon, "abbe-counters",
                                      config.daemon.encoder_priority, config.daemon.encoder_cpu));
    if (!running) return tl::unexpected(running.error());
    state->counter_card.emplace(std::move(*running));
  }

  if (config.reference) {
    const CounterCardConfig& card = config.reference->card;
    const auto options = device_options(card, config.daemon.speed);
    auto running = run(drivers::CounterCardDevice::create(
                           options, make_link(card, drivers::identity_of(options), time), time,
                           &state->mark_watcher),
                       thread_options(config.daemon, "abbe-marks", config.daemon.encoder_priority,
                                      config.daemon.encoder_cpu));
    if (!running) return tl::unexpected(running.error());
    state->reference_card.emplace(std::move(*running));
  }

  if (config.tracker) {
    auto running = run(
        drivers::TrackerDevice::create(device_options(*config.tracker, config.daemon.speed), time),
        thread_options(config.daemon, "abbe-tracker", config.daemon.tracker_priority,
                       config.daemon.tracker_cpu));
    if (!running) return tl::unexpected(running.error());
    state->tracker.emplace(std::move(*running));
  }

  state->environments.resize(config.environment.size());
  for (const auto& devices : devices_of_lines(config.environment)) {
    std::vector<drivers::EnvironmentDeviceOptions> options;
    for (const std::size_t i : devices)
      options.push_back(device_options(config.environment[i], config.daemon.speed));
    // Once a second and never in a hurry: an ordinary thread.
    auto running = run(drivers::EnvironmentLine::create(options, time),
                       thread_options(config.daemon, "abbe-environ", 0, std::nullopt));
    if (!running) return tl::unexpected(running.error());
    for (std::size_t k = 0; k < devices.size(); ++k)
      state->environments[devices[k]] = {&running->device->device(k), running->thread.get()};
    state->environment_lines.push_back(std::move(*running));
  }

  if (config.cmm) {
    auto options = device_options(*config.cmm, config.daemon.speed);
    keep_hold(config.daemon.data_dir, options);
    auto thread = thread_options(config.daemon, "abbe-cmm", 0, std::nullopt);
    thread.wait_at_most = kStopIsHeard;
    auto running = run(drivers::IppDevice::create(options, time), std::move(thread));
    if (!running) return tl::unexpected(running.error());
    state->cmm.emplace(std::move(*running));
    state->cmm_is_the_axes = config.cmm_reads_axes();
  }

  return DeviceSet{std::move(state)};
}

DeviceSet::DeviceSet(std::unique_ptr<State> state) : state_(std::move(state)) {}
DeviceSet::~DeviceSet() = default;
DeviceSet::DeviceSet(DeviceSet&&) noexcept = default;
DeviceSet& DeviceSet::operator=(DeviceSet&&) noexcept = default;

/// Of each device the samples before the bytes: a driver hands them over the other way round, so
/// bytes are never taken in a later turn than what was made of them. A replay stands on that.
void DeviceSet::drain(Batch& batch) {
  State& s = *state_;
  if (s.encoder) {
    drain_ring(s.encoder->device->samples(), s.axes, batch.axes);
    drain_ring(s.encoder->device->raw(), s.blocks, batch.encoder_raw);
  }

  if (s.counter_card) {  // the configuration allows one source of axes
    drain_ring(s.counter_card->device->samples(), s.axes, batch.axes);
    for (drivers::CounterCardProgress p; s.counter_card->device->progress().pop({&p, 1}) != 0;)
      s.card_progress = p;
    if (s.touch_detector) {
      drain_ring(s.touch_detector->touches(), s.touches, batch.touches);
      drain_ring(s.touch_detector->windows(), s.touch_scans, batch.touch_scans);
    }
    drain_ring(s.counter_card->device->raw(), s.blocks, batch.encoder_raw);
  }

  if (s.reference_card) {
    while (const std::size_t n = s.mark_watcher.crossings().pop(s.marks))
      batch.marks.insert(batch.marks.end(), s.marks.begin(),
                         s.marks.begin() + static_cast<std::ptrdiff_t>(n));
    drain_ring(s.reference_card->device->raw(), s.blocks, batch.reference_raw);
  }

  if (s.tracker) {
    drain_ring(s.tracker->device->points(), s.points, batch.points);
    drain_ring(s.tracker->device->environment(), s.environment, batch.environment);
    drain_ring(s.tracker->device->raw(), s.blocks, batch.tracker_raw);
  }

  for (std::size_t i = 0; i < s.environments.size(); ++i) s.drain_environment(i, batch);
  if (s.cmm) drain_cmm(batch);
}

std::optional<drivers::CounterCardProgress> DeviceSet::card_progress() {
  return std::exchange(state_->card_progress, std::nullopt);
}

void DeviceSet::drain_cmm(Batch& batch) {
  State& s = *state_;
  auto& device = *s.cmm->device;
  drain_ring(device.touches(), s.touches, batch.touches);
  while (const std::size_t n = device.positions().pop(s.axes)) {
    s.cmm_stands_at = s.axes[n - 1];
    if (s.cmm_is_the_axes)
      batch.axes.insert(batch.axes.end(), s.axes.begin(),
                        s.axes.begin() + static_cast<std::ptrdiff_t>(n));
  }
  drain_ring(device.raw(), s.blocks, batch.probe_raw);
}

void DeviceSet::measure(std::span<const drivers::ProbePoint> points) {
  if (!state_->cmm) return;
  state_->cmm->device->measure(points);
}

void DeviceSet::stop_machine() {
  if (state_->cmm) state_->cmm->device->abort();
}

void DeviceSet::end_machine() {
  if (state_->cmm) state_->cmm->device->end();
}

std::optional<std::string> DeviceSet::release_awaited() const {
  if (!state_->cmm) return std::nullopt;
  if (!state_->cmm->device->held()) return std::nullopt;
  return state_->cmm->device->status().last_fault;
}

Result<void> DeviceSet::release_machine() {
  if (!state_->cmm) return SampleSource::release_machine();
  auto& device = *state_->cmm->device;
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

std::optional<TipPlace> DeviceSet::tip_place() const {
  const auto& at = state_->cmm_stands_at;
  if (!at || at->missing_mask != 0) return std::nullopt;
  return TipPlace{{at->position[0], at->position[1], at->position[2]},
                  state_->time->now() - at->head.time};
}

std::size_t DeviceSet::points_left() const {
  return state_->cmm ? state_->cmm->device->points_left() : 0;
}

Result<std::array<double, 3>> DeviceSet::machine_position() const {
  if (!state_->cmm) return SampleSource::machine_position();
  const auto status = state_->cmm->thread->status();
  const auto refused = [&](std::string_view why) {
    return fail(
        ErrorCode::Refused,
        fmt::format("measuring machine {} {}{}{}", status.name, why,
                    status.last_fault.empty() ? "" : "; its last fault: ", status.last_fault));
  };

  if (release_awaited()) return refused("awaits a release by a person (`abbe machine release`)");
  if (status.state != drivers::name_of(drivers::IppState::Ready))
    return refused(fmt::format("is not ready: {}", status.state));
  const auto& at = state_->cmm_stands_at;
  if (!at || state_->time->now() - at->head.time > state_->time->host(kPositionIsOld))
    return refused("does not say where it stands");
  const std::array<double, 3> place{at->position[0], at->position[1], at->position[2]};
  if (!std::ranges::all_of(place, [](double p) { return std::isfinite(p); }))
    return refused("does not say where it stands");

  return place;
}

std::optional<drivers::DeviceStatus> DeviceSet::tracker_status() const {
  if (!state_->tracker) return std::nullopt;
  return state_->tracker->thread->status();
}

void DeviceSet::order_tracker(drivers::TrackerOrder order) {
  if (state_->tracker) state_->tracker->device->order(std::move(order));
}

std::vector<drivers::TrackerOrderReport> DeviceSet::tracker_reports() {
  return state_->tracker ? state_->tracker->device->reports()
                         : std::vector<drivers::TrackerOrderReport>{};
}

std::vector<StreamHealth> DeviceSet::health(HostTime now) {
  std::vector<StreamHealth> out;
  if (state_->tracker) out.push_back(state_->health_of(*state_->tracker->thread, now));
  if (state_->encoder) out.push_back(state_->health_of(*state_->encoder->thread, now));
  if (state_->counter_card) out.push_back(state_->health_of(*state_->counter_card->thread, now));
  if (state_->reference_card)
    out.push_back(state_->health_of(*state_->reference_card->thread, now));
  for (const auto& running : state_->environments)
    out.push_back(state_->health_of(*running.thread, now));
  if (state_->cmm) out.push_back(state_->health_of(*state_->cmm->thread, now));
  return out;
}

std::vector<std::string> DeviceSet::warnings() const {
  std::vector<std::string> out;
  const auto add = [&out](const auto& running) {
    out.insert(out.end(), running.thread->warnings().begin(), running.thread->warnings().end());
  };

  if (state_->tracker) add(*state_->tracker);
  if (state_->encoder) add(*state_->encoder);
  for (const auto* card : {&state_->counter_card, &state_->reference_card}) {
    if (!*card) continue;
    add(**card);
    if (auto assumed = (*card)->device->assumption(); !assumed.empty())
      out.push_back(std::move(assumed));
  }

  for (const auto& running : state_->environment_lines) add(running);
  if (state_->cmm) add(*state_->cmm);
  return out;
}

}  // namespace abbe::daemon
