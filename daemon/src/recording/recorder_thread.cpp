#include "abbe/daemon/recorder_thread.hpp"

#include <fmt/format.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "recording/waiting_blocks.hpp"

namespace abbe::daemon {
namespace {

// How long a sample may wait in memory before it is encoded; a tenth of the shortest chunk.
constexpr std::chrono::milliseconds kTurn{20};

/// With the turn of the hub in which it came.
template <class T>
struct OfTurn {
  protocol::HostTime taken;
  T what;
};

/// Several devices measure the environment.
struct EnvironmentOf {
  std::string_view device;
  protocol::EnvironmentSample sample;
};

template <class T>
std::size_t size_of(const std::vector<OfTurn<T>>& waiting) noexcept {
  return waiting.size() * sizeof(OfTurn<T>);
}
/// What append() will need for these.
template <class As, class T>
std::size_t size_as(const std::vector<T>& samples) noexcept {
  return samples.size() * sizeof(OfTurn<As>);
}
template <class T>
std::size_t size_of(const std::vector<T>& samples) noexcept {
  return size_as<T>(samples);
}

std::size_t bytes_of(const Batch& batch) noexcept {
  std::size_t bytes = size_of(batch.points) + size_of(batch.axes) +
                      size_as<EnvironmentOf>(batch.environment) +
                      size_as<EnvironmentOf>(batch.measured_environment);
  bytes += size_of(batch.touches) + size_of(batch.touch_scans);
  for (const auto* blocks : {&batch.tracker_raw, &batch.encoder_raw, &batch.probe_raw, &batch.reference_raw})
    bytes += WaitingBlocks::bytes_of(*blocks);
  for (const auto& [device, block] : batch.environment_raw) bytes += WaitingBlocks::bytes_of(block);
  return bytes;
}

struct Attachment {
  RecordingAttachment what;
  protocol::HostTime time{};
};

/// What waits for the recorder; of each topic in the order of the hub's turns, which its messages keep.
struct Waiting {
  std::vector<OfTurn<protocol::TrackerPoint>> points;
  std::vector<OfTurn<protocol::AxisSample>> axes;
  std::vector<OfTurn<EnvironmentOf>> environment;
  std::vector<OfTurn<protocol::ProbeTrigger>> touches;
  std::vector<OfTurn<protocol::TouchScan>> touch_scans;
  WaitingBlocks raw;
  std::vector<OfTurn<v1::CalibrationEvent>> events;
  std::vector<Attachment> attachments;
  std::vector<std::promise<RecordingDigest>> digests;
  bool full = false;  ///< what comes until the recorder has taken this is dropped: one hole, not many

  [[nodiscard]] std::size_t bytes() const noexcept {
    return size_of(points) + size_of(axes) + size_of(environment) + size_of(touches) + size_of(touch_scans) +
           raw.bytes();
  }
  /// Keeps the room for an ordinary turn, gives that of a stalled disk back.
  void clear() {
    constexpr std::size_t kOrdinary = 1 << 20;
    if (bytes() > kOrdinary) {
      *this = {};
      return;
    }
    points.clear();
    axes.clear();
    environment.clear();
    touches.clear();
    touch_scans.clear();
    raw.clear();
    events.clear();
    attachments.clear();
    digests.clear();
    full = false;
  }
};

/// Messages of each stream that were dropped since the last one that was not.
struct Dropped {
  struct OfDevice {
    std::uint32_t samples = 0, raw = 0;
  };
  std::uint32_t points = 0, axes = 0, environment = 0, touches = 0, touch_scans = 0;
  std::uint32_t tracker_raw = 0, encoder_raw = 0, probe_raw = 0, reference_raw = 0;
  std::vector<OfDevice> measured;
};

template <class T>
T& place(std::vector<T>& of_devices, std::size_t device) {
  if (device >= of_devices.size()) of_devices.resize(device + 1);
  return of_devices[device];
}

void say_dropped(protocol::SampleHead& head, std::uint32_t& dropped) {
  if (dropped == 0) return;
  head.lost_before += std::exchange(dropped, 0);
  head.flags |= protocol::SampleFlag::GapBefore;
}

template <class T>
void append(std::vector<OfTurn<T>>& to, protocol::HostTime taken, const std::vector<T>& from,
            std::uint32_t& dropped) {
  for (const T& sample : from) {
    to.push_back({taken, sample});
    say_dropped(to.back().what.head, dropped);
  }
}
void append(std::vector<OfTurn<EnvironmentOf>>& to, protocol::HostTime taken, const EnvironmentOf& from,
            std::uint32_t& dropped) {
  to.push_back({taken, from});
  say_dropped(to.back().what.sample.head, dropped);
}

}  // namespace

struct RecorderThread::State {
  RecorderThreadOptions options;
  Recorder recorder;
  mutable std::mutex mutex;
  std::condition_variable stop_asked;
  Waiting waiting;            // under mutex
  RecorderStatus status;      // under mutex, a copy of the recorder's own
  Dropped unsaid;             // under mutex
  std::uint64_t dropped = 0;  // under mutex
  bool stopping = false;      // under mutex
  std::thread thread;

  State(RecorderThreadOptions o, Recorder r) : options(std::move(o)), recorder(std::move(r)) {}

  void serve() {
    Waiting turn;
    for (bool last = false; !last;) {
      {
        std::unique_lock lock{mutex};
        stop_asked.wait_for(lock, kTurn, [this] { return stopping || !waiting.digests.empty(); });
        last = stopping;
        std::swap(turn, waiting);
      }
      const std::string defect = write_all(turn);
      turn.clear();  // whoever waits for a digest that was not made learns of it
      const std::lock_guard lock{mutex};
      status = recorder.status();
      if (defect.empty()) continue;
      status.state = RecorderStatus::State::Failed;
      status.fault = defect;
    }
  }

  /// What went wrong, if something did that only a defect or a lack of memory explains.
  std::string write_all(Waiting& turn) {
    try {
      write(turn);
      return {};
    } catch (const std::exception& defect) {
      return fmt::format("recorder: {}", defect.what());
    }
  }

  void drop(const Batch& batch) {
    const auto lose = [this](std::uint32_t& unsaid_of, std::size_t messages) {
      unsaid_of += static_cast<std::uint32_t>(messages);
      dropped += messages;
    };
    lose(unsaid.points, batch.points.size());
    lose(unsaid.axes, batch.axes.size());
    lose(unsaid.environment, batch.environment.size());
    for (const auto& sample : batch.measured_environment)
      lose(place(unsaid.measured, sample.device).samples, 1);
    lose(unsaid.touches, batch.touches.size());
    lose(unsaid.touch_scans, batch.touch_scans.size());
    if (!options.raw) return;
    lose(unsaid.tracker_raw, batch.tracker_raw.size());
    lose(unsaid.encoder_raw, batch.encoder_raw.size());
    lose(unsaid.probe_raw, batch.probe_raw.size());
    lose(unsaid.reference_raw, batch.reference_raw.size());
    for (const auto& raw : batch.environment_raw) lose(place(unsaid.measured, raw.device).raw, 1);
  }

  void write(Waiting& turn) {
    for (auto& a : turn.attachments) recorder.attach(std::move(a.what), a.time);
    // First: a further file begins with the environment of before, which must not come after that of now.
    for (const auto& [taken, e] : turn.environment) recorder.record(e.sample, e.device, taken);
    for (const auto& [taken, s] : turn.axes) recorder.record(s, options.encoder, taken);
    for (const auto& [taken, s] : turn.points) recorder.record(s, options.tracker, taken);
    for (const auto& [taken, t] : turn.touches) recorder.record(t, options.probe, taken);
    for (const auto& [taken, s] : turn.touch_scans) recorder.record(s, options.probe, taken);
    turn.raw.for_each(
        [this](const protocol::RawBytes& bytes, protocol::HostTime taken) { recorder.record(bytes, taken); });
    for (const auto& [taken, e] : turn.events) recorder.record(e, taken);
    if (!turn.digests.empty()) recorder.flush();
    for (auto& d : turn.digests) d.set_value(recorder.digest());
    recorder.tick(Recorder::WallTime::clock::now());
  }
};

Result<std::unique_ptr<RecorderThread>> RecorderThread::start(RecorderThreadOptions options,
                                                              RecordingInfo info) {
  auto recorder = Recorder::open(options.recorder, std::move(info), Recorder::WallTime::clock::now());
  if (!recorder) return tl::unexpected(recorder.error());
  auto state = std::make_unique<State>(std::move(options), std::move(*recorder));
  state->status = state->recorder.status();
  return std::unique_ptr<RecorderThread>{new RecorderThread{std::move(state)}};
}

RecorderThread::RecorderThread(std::unique_ptr<State> state) : state_(std::move(state)) {
  state_->thread = std::thread([s = state_.get()] { s->serve(); });
}

RecorderThread::~RecorderThread() {
  {
    const std::lock_guard lock{state_->mutex};
    state_->stopping = true;
  }
  state_->stop_asked.notify_one();
  state_->thread.join();
  try {
    (void)state_->recorder.close();  // what could not be finished stays readable as .part
  } catch (
      const std::exception&) {  // NOLINT(bugprone-empty-catch): so does what a lack of memory left behind
  }
}

void RecorderThread::hand_over(const Batch& batch) {
  const std::lock_guard lock{state_->mutex};
  Waiting& waiting = state_->waiting;
  Dropped& unsaid = state_->unsaid;
  waiting.full = waiting.full || waiting.bytes() + bytes_of(batch) > state_->options.most_waiting_bytes;
  if (waiting.full) return state_->drop(batch);
  const auto& names = state_->options;
  const auto taken = batch.taken;
  append(waiting.points, taken, batch.points, unsaid.points);
  append(waiting.axes, taken, batch.axes, unsaid.axes);
  for (const auto& sample : batch.environment)
    append(waiting.environment, taken, {names.tracker, sample}, unsaid.environment);
  for (const auto& [device, sample] : batch.measured_environment)
    append(waiting.environment, taken, {names.environment.at(device), sample},
           place(unsaid.measured, device).samples);
  append(waiting.touches, taken, batch.touches, unsaid.touches);
  append(waiting.touch_scans, taken, batch.touch_scans, unsaid.touch_scans);
  if (!names.raw) return;
  waiting.raw.append(taken, names.tracker, batch.tracker_raw, unsaid.tracker_raw);
  waiting.raw.append(taken, names.encoder, batch.encoder_raw, unsaid.encoder_raw);
  waiting.raw.append(taken, names.probe, batch.probe_raw, unsaid.probe_raw);
  waiting.raw.append(taken, names.reference, batch.reference_raw, unsaid.reference_raw);
  for (const auto& [device, block] : batch.environment_raw)
    waiting.raw.append(taken, names.environment.at(device), block, place(unsaid.measured, device).raw);
}

void RecorderThread::hand_over(v1::CalibrationEvent event, protocol::HostTime taken) {
  const std::lock_guard lock{state_->mutex};
  state_->waiting.events.push_back({taken, std::move(event)});
}

void RecorderThread::attach(RecordingAttachment attachment, protocol::HostTime time) {
  const std::lock_guard lock{state_->mutex};
  state_->waiting.attachments.push_back({std::move(attachment), time});
}

std::future<RecordingDigest> RecorderThread::digest() {
  std::promise<RecordingDigest> promise;
  auto future = promise.get_future();
  {
    const std::lock_guard lock{state_->mutex};
    state_->waiting.digests.push_back(std::move(promise));
  }
  state_->stop_asked.notify_one();
  return future;
}

RecorderStatus RecorderThread::status() const {
  const std::lock_guard lock{state_->mutex};
  return state_->status;
}

std::uint64_t RecorderThread::dropped() const noexcept {
  const std::lock_guard lock{state_->mutex};
  return state_->dropped;
}

}  // namespace abbe::daemon
