#include "abbe/recording/recorder_thread.hpp"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/base/wake_up.hpp"
#include "abbe/messages/recording_info.hpp"
#include "waiting_blocks.hpp"

namespace abbe::daemon {
namespace {

// How long a sample may wait in memory before it is encoded; a tenth of the shortest chunk.
constexpr std::chrono::milliseconds kCycle{20};
// How long the recorder waits when the hub is just adding to what waits.
constexpr std::chrono::microseconds kHubAdds{50};
// What waits is kept in parts: a vector that grows is copied, and the hub does that.
constexpr std::size_t kMostInOnePart = 1 << 20;

/// With the turn of the hub in which it came.
template <class T>
struct OfCycle {
  protocol::HostTime taken;
  T what;
};

/// Several devices measure the environment.
struct EnvironmentOf {
  std::string_view device;
  protocol::EnvironmentSample sample;
};

template <class T>
std::size_t size_of(const std::vector<OfCycle<T>>& waiting) noexcept {
  return waiting.size() * sizeof(OfCycle<T>);
}
/// What append() will need for these.
template <class As, class T>
std::size_t size_as(const std::vector<T>& samples) noexcept {
  return samples.size() * sizeof(OfCycle<As>);
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
  for (const auto& [device, block] : batch.raw) bytes += WaitingBlocks::bytes_of(block);
  return bytes;
}

struct Attachment {
  RecordingAttachment what;
  protocol::HostTime time{};
};

struct WantedDigest {
  std::promise<RecordingDigest> promise;
  /// messages that never came this far since a calibration was asked for
  std::uint64_t dropped = 0;
};

/// What waits for the recorder; of each topic in the order of the hub's turns, which its messages
/// keep.
struct Waiting {
  std::vector<OfCycle<protocol::TrackerPoint>> points;
  std::vector<OfCycle<protocol::AxisSample>> axes;
  std::vector<OfCycle<EnvironmentOf>> environment;
  std::vector<OfCycle<protocol::ProbeTrigger>> touches;
  std::vector<OfCycle<protocol::TouchScan>> touch_scans;
  WaitingBlocks raw;
  std::vector<OfCycle<v1::CalibrationEvent>> events;
  std::vector<Attachment> attachments;
  std::vector<WantedDigest> digests;
  /// what comes until the recorder has taken this is dropped: one hole, not many
  bool full = false;
  std::unique_ptr<Waiting> earlier;  ///< the parts before this one
  std::size_t bytes_earlier = 0;

  [[nodiscard]] std::size_t bytes_here() const noexcept {
    return size_of(points) + size_of(axes) + size_of(environment) + size_of(touches) +
           size_of(touch_scans) + raw.bytes();
  }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_earlier + bytes_here(); }
  /// Keeps the room for an ordinary turn, gives that of a stalled disk back.
  void clear() {
    if (bytes() > kMostInOnePart) {
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
  std::uint32_t points = 0, axes = 0, environment = 0, touches = 0, touch_scans = 0;
  std::vector<std::uint32_t> measured;  // of each device of the environment
  std::vector<std::uint32_t> raw;       // of each device
};

template <class T>
T& place(std::vector<T>& of_devices, std::size_t device) {
  if (device >= of_devices.size()) of_devices.resize(device + 1);
  return of_devices[device];
}

void report_dropped(protocol::SampleHead& head, std::uint32_t& dropped) {
  if (dropped == 0) return;
  head.lost_before += std::exchange(dropped, 0);
  head.flags |= protocol::SampleFlag::GapBefore;
}

template <class T>
void append(std::vector<OfCycle<T>>& to, protocol::HostTime taken, const std::vector<T>& from,
            std::uint32_t& dropped) {
  for (const T& sample : from) {
    to.push_back({taken, sample});
    report_dropped(to.back().what.head, dropped);
  }
}
void append(std::vector<OfCycle<EnvironmentOf>>& to, protocol::HostTime taken,
            const EnvironmentOf& from, std::uint32_t& dropped) {
  to.push_back({taken, from});
  report_dropped(to.back().what.sample.head, dropped);
}

}  // namespace

/// The hub and the recorder share one pointer: to the Waiting that is being filled, null while the
/// hub adds to it. The hub always finds it there, because the recorder leaves an empty one for the
/// one it takes; the recorder tries again when the hub is adding.
struct RecorderThread::State {
  RecorderThreadOptions options;
  Recorder recorder;
  std::atomic<Waiting*> waiting{new Waiting};
  std::atomic<RecorderStatus*> news{nullptr};  // put here by the recorder, taken by status()
  RecorderStatus known;                        // the thread's that asks for status()
  Dropped unsaid;                              // the hub's
  std::uint64_t dropped_before_run = 0;        // the hub's
  std::string defect;                          // the recorder's: not yet handed to the recorder
  std::atomic<std::uint64_t> dropped{0};
  std::atomic<bool> stopping{false};
  WakeUp wake_up;
  std::thread thread;

  State(RecorderThreadOptions o, Recorder r) : options(std::move(o)), recorder(std::move(r)) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    delete waiting.load(std::memory_order_relaxed);
    delete news.load(std::memory_order_relaxed);
  }

  /// While the hub adds: the recorder finds nothing to take.
  struct Adding {
    explicit Adding(State& s)
        : state(s), to(s.waiting.exchange(nullptr, std::memory_order_acquire)) {}
    Adding(const Adding&) = delete;
    Adding& operator=(const Adding&) = delete;
    // release: pairs with the acquire in take_waiting()
    ~Adding() { state.waiting.store(to, std::memory_order_release); }
    Waiting* operator->() const noexcept { return to; }

    State& state;
    Waiting* to;  // acquired: pairs with the release in take_waiting()
  };

  [[nodiscard]] std::unique_ptr<Waiting> take_waiting(std::unique_ptr<Waiting> empty) {
    for (;;) {
      Waiting* full = waiting.load(std::memory_order_relaxed);
      if (full != nullptr &&
          waiting.compare_exchange_strong(full, empty.get(), std::memory_order_acq_rel)) {
        (void)empty.release();
        return std::unique_ptr<Waiting>{full};
      }
      std::this_thread::sleep_for(kHubAdds);
    }
  }

  void serve() {
    auto turn = std::make_unique<Waiting>();
    for (bool last = false; !last;) {
      (void)wake_up.wait_for(kCycle);
      // pairs with the release in ~RecorderThread()
      last = stopping.load(std::memory_order_acquire);
      turn = take_waiting(std::move(turn));
      write_all(*turn);
      turn->clear();  // whoever waits for a digest that was not made learns of it
      report();
    }
  }

  void report() {
    auto status = std::make_unique<RecorderStatus>(recorder.status());
    // release: pairs with the acquire in status(); the one nobody has asked for is replaced
    delete news.exchange(status.release(), std::memory_order_acq_rel);
  }

  /// Only a defect or a lack of memory throws: the recorder begins a new file then, as after a disk
  /// fault.
  void write_all(Waiting& turn) {
    try {
      if (!defect.empty()) recorder.fail(std::exchange(defect, {}));
      write(turn);
      return;
    } catch (const std::exception& e) {
      defect = std::string{"recorder: "} + e.what();
    }
    try {
      recorder.fail(defect);
      defect.clear();
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): tried again in the next turn
    }
  }

  void drop(const Batch& batch) {
    const auto lose = [this](std::uint32_t& unsaid_of, std::size_t messages) {
      unsaid_of += static_cast<std::uint32_t>(messages);
      dropped.fetch_add(messages, std::memory_order_relaxed);  // a count orders nothing
    };

    lose(unsaid.points, batch.points.size());
    lose(unsaid.axes, batch.axes.size());
    lose(unsaid.environment, batch.environment.size());

    for (const auto& sample : batch.measured_environment)
      lose(place(unsaid.measured, sample.device), 1);
    lose(unsaid.touches, batch.touches.size());
    lose(unsaid.touch_scans, batch.touch_scans.size());
    if (!options.raw) return;
    for (const auto& raw : batch.raw) lose(place(unsaid.raw, raw.device), 1);
  }

  void write(Waiting& turn) {
    std::vector<std::unique_ptr<Waiting>> earlier;  // the latest first
    for (auto part = std::move(turn.earlier); part != nullptr;) {
      auto before = std::move(part->earlier);
      earlier.push_back(std::move(part));
      part = std::move(before);
    }
    for (; !earlier.empty(); earlier.pop_back()) write_part(*earlier.back());
    write_part(turn);
    recorder.tick(Recorder::WallTime::clock::now());
  }

  void write_part(Waiting& turn) {
    for (auto& a : turn.attachments) recorder.attach(std::move(a.what), a.time);
    // First: a further file begins with the environment of before, which must not come after that
    // of now.
    for (const auto& [taken, e] : turn.environment) recorder.record(e.sample, e.device, taken);
    for (const auto& [taken, s] : turn.axes) recorder.record(s, options.encoder, taken);
    for (const auto& [taken, s] : turn.points) recorder.record(s, options.tracker, taken);
    for (const auto& [taken, t] : turn.touches) recorder.record(t, options.probe, taken);
    for (const auto& [taken, s] : turn.touch_scans) recorder.record(s, options.probe, taken);

    turn.raw.for_each([this](const protocol::RawBytes& bytes, protocol::HostTime taken) {
      recorder.record(bytes, taken);
    });

    for (const auto& [taken, e] : turn.events) recorder.record(e, taken);
    if (!turn.digests.empty()) recorder.flush();
    for (auto& wanted : turn.digests) {
      RecordingDigest digest = recorder.digest();
      if (digest.gap.empty() && wanted.dropped > 0)
        digest.gap = fmt::format("{} messages of the run are missing", wanted.dropped);
      wanted.promise.set_value(std::move(digest));
    }
  }

  /// Begins a further part when this one is so large that to let it grow would take long.
  static void make_room(Adding& waiting) {
    if (waiting->bytes_here() < kMostInOnePart) return;
    auto next = std::make_unique<Waiting>();
    next->bytes_earlier = waiting->bytes();
    next->full = waiting->full;
    next->earlier.reset(waiting.to);
    waiting.to = next.release();
  }
};

Result<std::unique_ptr<RecorderThread>> RecorderThread::start(RecorderThreadOptions options,
                                                              RecordingInfo info) {
  auto recorder =
      Recorder::open(options.recorder, std::move(info), Recorder::WallTime::clock::now());
  if (!recorder) return tl::unexpected(recorder.error());
  auto state = std::make_unique<State>(std::move(options), std::move(*recorder));
  state->known = state->recorder.status();
  return std::unique_ptr<RecorderThread>{new RecorderThread{std::move(state)}};
}

RecorderThread::RecorderThread(std::unique_ptr<State> state) : state_(std::move(state)) {
  state_->thread = std::thread([s = state_.get()] { s->serve(); });
}

RecorderThread::~RecorderThread() {
  state_->stopping.store(true,
                         std::memory_order_release);  // release: pairs with the acquire in serve()
  state_->wake_up.signal();
  state_->thread.join();
  try {
    (void)state_->recorder.close();  // what could not be finished stays readable as .part
  } catch (
      const std::
          exception&) {  // NOLINT(bugprone-empty-catch): so does what a lack of memory left behind
  }
}

void RecorderThread::on_samples(const Batch& batch) {
  if (!batch.empty()) hand_over(batch);
}

void RecorderThread::hand_over(const Batch& batch) {
  State::Adding adding{*state_};
  Dropped& unsaid = state_->unsaid;
  adding->full =
      adding->full || adding->bytes() + bytes_of(batch) > state_->options.most_waiting_bytes;

  if (adding->full) return state_->drop(batch);
  State::make_room(adding);
  Waiting& waiting = *adding.to;
  const auto& names = state_->options;
  const auto taken = batch.taken;
  append(waiting.points, taken, batch.points, unsaid.points);
  append(waiting.axes, taken, batch.axes, unsaid.axes);
  for (const auto& sample : batch.environment)
    append(waiting.environment, taken, {names.tracker, sample}, unsaid.environment);
  for (const auto& [device, sample] : batch.measured_environment)
    append(waiting.environment, taken, {names.environment.at(device), sample},
           place(unsaid.measured, device));
  append(waiting.touches, taken, batch.touches, unsaid.touches);
  append(waiting.touch_scans, taken, batch.touch_scans, unsaid.touch_scans);
  if (!names.raw) return;
  for (const auto& [device, block] : batch.raw)
    waiting.raw.append(taken, names.devices.at(device), block, place(unsaid.raw, device));
}

void RecorderThread::hand_over(v1::CalibrationEvent event, protocol::HostTime taken) {
  State::Adding waiting{*state_};
  waiting->events.push_back({taken, std::move(event)});
}

void RecorderThread::attach(RecordingAttachment attachment, protocol::HostTime time) {
  if (is_calibration_request(attachment.name)) state_->dropped_before_run = dropped();
  State::Adding waiting{*state_};
  waiting->attachments.push_back({std::move(attachment), time});
}

std::future<RecordingDigest> RecorderThread::digest() {
  std::promise<RecordingDigest> promise;
  auto future = promise.get_future();
  {
    State::Adding waiting{*state_};
    waiting->digests.push_back({std::move(promise), dropped() - state_->dropped_before_run});
  }
  state_->wake_up.signal();
  return future;
}

const RecorderStatus& RecorderThread::status() const {
  // acquire: pairs with the release in report()
  const std::unique_ptr<RecorderStatus> news{
      state_->news.exchange(nullptr, std::memory_order_acq_rel)};
  if (news) state_->known = std::move(*news);
  return state_->known;
}

std::uint64_t RecorderThread::dropped() const noexcept {
  return state_->dropped.load(std::memory_order_relaxed);
}

}  // namespace abbe::daemon
