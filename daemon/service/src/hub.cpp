#include "abbe/service/hub.hpp"

#include <fmt/format.h>
#include <sys/prctl.h>

#include <ctime>
#include <utility>

#include "abbe/base/wake_up.hpp"
#include "abbe/devices/device_kind.hpp"
#include "abbe/service/recorder_lag.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;

constexpr auto kHealthPeriod = 1s;

void sleep_until(std::chrono::steady_clock::time_point t) {
  const auto ns = t.time_since_epoch().count();  // steady_clock is CLOCK_MONOTONIC
  const timespec at{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
  (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

StreamHealth health_of(const RecorderThread& recorder, std::chrono::nanoseconds chunk_period,
                       std::chrono::steady_clock::time_point wall) {
  const RecorderStatus& r = recorder.status();
  StreamHealth h;
  const auto behind = recorder.behind(wall);
  h.behind_s = std::chrono::duration<double>(behind).count();
  h.status.condition = text_of_lag(behind, chunk_period);
  h.status.name = "recorder";
  h.status.state = name(r.state);
  h.status.connected = r.state == RecorderStatus::State::Recording;
  h.status.samples = r.messages;
  h.status.dropped = r.lost + r.refused + recorder.dropped();
  h.status.faults = r.faults;
  h.status.last_fault = r.last_fault;

  if (r.last_fault.empty() && r.refused > 0) {
    h.status.last_fault =
        fmt::format("{} messages outside the bounds of the IDL are not recorded", r.refused);
  }

  return h;
}

/// Health of the model store: whether it can be read and written.
StreamHealth health_of(const ModelAuthority& authority, const CalibrationSession& session) {
  const std::string& unstored = session.not_stored();
  StreamHealth h;
  h.status.name = "models";
  h.status.connected = authority.fault().empty() && unstored.empty();
  h.status.state = !unstored.empty()    ? "not stored"
                   : h.status.connected ? "followed"
                                        : "unreadable";
  h.status.last_fault = unstored.empty() ? authority.fault() : unstored;
  return h;
}

/// Adds the faults of its sensors to the health of each device.
void add_findings(const std::vector<SensorFinding>& findings, std::vector<StreamHealth>& health) {
  for (const SensorFinding& finding : findings) {
    // The first reading after a start is not used until a second one agrees with it; this is not a
    // fault.
    if (finding.doubt == calib::SensorDoubt::Unconfirmed) continue;
    for (StreamHealth& stream : health) {
      if (stream.status.name != finding.device) continue;
      std::string& text = stream.status.condition;
      text += fmt::format("{}{}", text.empty() ? "" : "; ", finding.text);
    }
  }
}

/// Counts readings that were not used as faults of their device. A doubt that lasts for a single
/// reading is over when health is collected; its text is then shown as the last fault.
void add_doubts(const std::vector<SensorDoubts>& doubts, std::vector<StreamHealth>& health) {
  for (const SensorDoubts& sensor : doubts) {
    for (StreamHealth& stream : health) {
      if (stream.status.name != sensor.device) continue;
      stream.status.faults += sensor.count;
      if (sensor.latest < stream.status.last_fault_at) continue;
      stream.status.last_fault = sensor.latest_text;
      stream.status.last_fault_at = sensor.latest;
    }
  }
}

/// Text about the restarts and the last end of abbe-dds; empty if abbe-dds has not ended yet.
std::string report_of(const DdsProcess& process) {
  const auto end = process.last_end();
  if (!end) return {};
  return fmt::format("abbe-dds was restarted {} times; last end: {}", process.restarts(),
                     end->text());
}

StreamHealth health_of(const Publisher& publisher) {
  const DdsLink& link = publisher.link();
  StreamHealth h;
  h.status.name = "dds";
  h.status.state = link.state();
  h.status.connected = link.answers();
  h.status.samples = link.counters().sent;
  h.status.dropped = link.counters().dropped_live;
  h.status.faults = link.counters().refused;
  h.status.last_fault = publisher.refusal();
  if (h.status.last_fault.empty() && link.process() != nullptr)
    h.status.last_fault = report_of(*link.process());
  return h;
}

/// Health of DDS Security: whether unauthorised participants are excluded from the domain.
StreamHealth health_of_security(const Publisher& publisher) {
  StreamHealth h;
  h.status.name = "dds_security";
  h.status.last_fault = publisher.security_warning();
  h.status.connected = h.status.last_fault.empty();
  h.status.state = h.status.connected ? "on" : "off";
  return h;
}

}  // namespace

struct Hub::Call {
  std::function<void()> task;
  std::exception_ptr thrown;
  std::atomic<bool> claimed{
      false};  // set by the hub, which runs the task, or by the caller after its time-out
  WakeUp done;
};

Hub::Hub(HubParts parts)
    : parts_(parts),
      pipeline_(assembler_options(parts.config),
                parts.reference != nullptr ? &parts.reference->zeros() : nullptr),
      live_(assembler_options(parts.config), parts.time),
      touches_by_(device_names(parts.config).touches) {
  if (parts_.sensor_state) {
    (void)pipeline_.go_on(*parts_.sensor_state);
    (void)live_.go_on(*parts_.sensor_state);
  }
  if (parts_.reference != nullptr) pipeline_.add(*parts_.reference);
  pipeline_.add(*this);  // before the recorder, because subscribers wait for the live view
  if (parts_.recorder != nullptr) pipeline_.add(*parts_.recorder);
}

Hub::~Hub() {
  run_calls();
  for (Call* const call : given_up_.take()) delete call;
}

Hub::WallTime Hub::last_cycle() const noexcept {
  return WallTime{std::chrono::nanoseconds{last_cycle_ns_.load(std::memory_order_relaxed)}};
}

ActiveModelState Hub::model_state() const {
  const auto patience = parts_.time.host(kAxesTimeout);
  auto state = parts_.authority.model_state(parts_.time.now(), live_.axes_known_at(), patience,
                                            missing_scales_);
  if (parts_.identity != nullptr) parts_.identity->restrict(state);
  return state;
}

void Hub::cycle(WallTime wall) {
  last_cycle_ns_.store(wall.time_since_epoch().count(), std::memory_order_relaxed);
  cycle_began_ = wall;

  batch_.clear();
  const std::size_t points_left = parts_.devices.points_left();
  parts_.devices.drain(batch_);
  const HostTime now = parts_.time.now();
  batch_.taken = now;
  touch(points_left, wall);
  if (parts_.tracker != nullptr) parts_.tracker->cycle(now);

  accept_sensors();
  pipeline_.cycle(batch_);
  if (parts_.reference != nullptr) parts_.reference->take(parts_.devices.card_progress());
  run_calls();
}

void Hub::accept_sensors() {
  if (parts_.sensors == nullptr) return;
  for (SensorAcceptance& acceptance : parts_.sensors->take()) {
    live_.accept(acceptance);
    pipeline_.accept(std::move(acceptance));
  }
}

void Hub::on_samples(const Batch& batch) {
  publish(live_.take(batch), batch.taken);
  if (parts_.publisher != nullptr) parts_.publisher->beat(cycle_began_);
}

void Hub::on_snapshots(std::span<const protocol::Snapshot> snapshots, HostTime taken) {
  for (const auto& event : parts_.calibration.cycle(snapshots, taken)) {
    if (parts_.publisher != nullptr) parts_.publisher->event(event);
  }

  if (parts_.verification != nullptr) parts_.verification->cycle(snapshots);
}

/// Passes the batch to the running touch job, together with the last fault of the machine. The
/// fault is looked up only if the job may have ended, and not while it waits for the outcome of a
/// stop, because collecting health takes too long for every cycle.
void Hub::touch(std::size_t points_left, WallTime wall) {
  if (parts_.touching == nullptr || !parts_.touching->status().running) return;
  std::string seen;
  if (points_left == 0 && batch_.touches.empty() && !parts_.touching->awaits_stop()) {
    collect_health(parts_.time.now());
    for (const auto& h : health_)
      if (h.status.name == touches_by_) seen = h.status.last_fault;
  }
  parts_.touching->cycle(batch_, points_left, seen, wall);
}

void Hub::publish(bool fresh, HostTime now) {
  Publisher* const publisher = parts_.publisher;
  const WallTime wall = cycle_began_;
  if (fresh && publisher != nullptr) {
    publisher->snapshot(live_.view(), now, wall);
    publisher->compensation(live_.view(), model_state(), now, wall);
  }
  if (wall >= next_health_) {
    next_health_ = wall + kHealthPeriod;
    (void)parts_.authority.follow_store(now);
    follow_identity(wall);
    collect_health(now);
    if (publisher != nullptr) publisher->health(health_, now);
  }
  if (publisher != nullptr) publisher->model(model_state(), now, wall);
}

void Hub::follow_identity(WallTime wall) {
  if (parts_.identity == nullptr) return;
  parts_.identity->follow(wall);
  if (parts_.publisher == nullptr) return;
  auto identity = parts_.publisher->identity();
  identity.machine_id = parts_.identity->known().machine_id;
  parts_.publisher->set_identity(std::move(identity));
}

void Hub::collect_health(HostTime now) {
  health_ = parts_.devices.health(now);
  add_findings(live_.sensor_findings(), health_);
  add_doubts(live_.sensor_doubts(), health_);
  missing_scales_ = live_.why_scales_alone_are_missing();
  health_.push_back(health_of(parts_.authority, parts_.calibration.session()));
  if (parts_.recorder != nullptr)
    health_.push_back(
        health_of(*parts_.recorder, parts_.config.recording.chunk_period, cycle_began_));
  if (parts_.identity != nullptr)
    health_.push_back(parts_.identity->health(
        parts_.publisher != nullptr ? parts_.publisher->link().twin() : std::string{}));
  if (parts_.publisher == nullptr) return;
  health_.push_back(health_of(*parts_.publisher));
  health_.push_back(health_of_security(*parts_.publisher));
}

void Hub::run() {
  // Without SCHED_FIFO the kernel may wake a thread up to 50 us late (timer slack, to save wake-ups
  // of the processor). That would be a fifth of the usual hub_period in every cycle.
  ::prctl(PR_SET_TIMERSLACK, 1UL);
  const auto period = parts_.config.daemon.hub_period;
  auto next = std::chrono::steady_clock::now();
  while (!stopping_.load(std::memory_order_relaxed)) {
    cycle(std::chrono::steady_clock::now());
    next += period;
    if (const auto now = std::chrono::steady_clock::now(); next < now)
      next = now;  // the hub is late: the missed cycles are skipped
    sleep_until(next);
  }
}

bool Hub::run_in_cycle(std::function<void()> task, std::chrono::milliseconds time_out) {
  for (Call* const old : given_up_.take()) delete old;
  auto call = std::make_unique<Call>();
  call->task = std::move(task);
  calls_.put(call.get());

  if (!call->done.wait_for(time_out)) {
    // The first one to set `claimed` decides. Here the hub has not started the task: calls_ still
    // holds the call, and the hub will move it to given_up_.
    if (!call->claimed.exchange(true)) {
      (void)call.release();
      return false;
    }
    call->done.wait();  // the task has begun and is short
  }

  if (call->thrown) std::rethrow_exception(call->thrown);
  return true;
}

void Hub::run_calls() {
  for (Call* const call : calls_.take()) {
    if (call->claimed.exchange(true)) {
      given_up_.put(call);
      continue;
    }
    try {
      call->task();
    } catch (...) {  // rethrown on the caller's thread; for example, a member of the request has
                     // the wrong type
      call->thrown = std::current_exception();
    }
    call->done.signal();  // the caller frees it now
  }
}

}  // namespace abbe::daemon
