#include "abbe/recording/recorder_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "abbe/base/wake_up.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/result/try.hpp"
#include "waiting_blocks.hpp"

namespace abbe::daemon {
namespace {

// Period of the recorder: the longest time that a sample waits in memory before it is encoded.
constexpr std::chrono::milliseconds kCycle{20};
// Pause before the recorder tries again to take samples, if the hub is adding some just then.
constexpr std::chrono::microseconds kHubAdds{50};
// The waiting samples are kept in parts of at most this size. In one vector they would be copied
// whenever it grows, on the hub's thread.
constexpr std::size_t kMostInOnePart = 1 << 20;

/// A sample with the time of the hub cycle in which it was taken.
template <class T>
struct OfCycle {
  protocol::HostTime taken;
  T what;
};

/// An environment sample with its device, because several devices measure the environment.
struct EnvironmentOf {
  std::string_view device;
  protocol::EnvironmentSample sample;
};

template <class T>
std::size_t size_of(const std::vector<OfCycle<T>>& waiting) noexcept {
  return waiting.size() * sizeof(OfCycle<T>);
}
/// The memory that append() will use for these samples.
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

struct DigestRequest {
  std::promise<RecordingDigest> promise;
  /// messages dropped since the last calibration was requested
  std::uint64_t dropped = 0;
};

/// The data that wait for the recorder. Within a topic they are in the order of the hub's cycles,
/// which the recorded messages keep.
struct Waiting {
  std::vector<OfCycle<protocol::TrackerPoint>> points;
  std::vector<OfCycle<protocol::AxisSample>> axes;
  std::vector<OfCycle<EnvironmentOf>> environment;
  std::vector<OfCycle<protocol::ProbeTrigger>> touches;
  std::vector<OfCycle<protocol::TouchScan>> touch_scans;
  WaitingBlocks raw;
  std::vector<OfCycle<v1::CalibrationEvent>> events;
  std::vector<Attachment> attachments;
  std::vector<DigestRequest> digests;
  std::uint64_t number = 0;  ///< number of the last batch, see Unwritten
  /// True after a batch was dropped. Further batches are then dropped until the recorder has taken
  /// this object, so that the recording gets one gap and not many.
  bool full = false;
  std::unique_ptr<Waiting> earlier;  ///< the parts before this one
  std::size_t bytes_earlier = 0;

  [[nodiscard]] std::size_t bytes_here() const noexcept {
    return size_of(points) + size_of(axes) + size_of(environment) + size_of(touches) +
           size_of(touch_scans) + raw.bytes();
  }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_earlier + bytes_here(); }
  /// Empties this object. It keeps the memory that normal cycles need, and frees the larger memory
  /// that was used while the disk stalled.
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
    number = 0;
    full = false;
  }
};

/// Messages of each stream that were dropped since the last one that was not dropped.
struct Dropped {
  std::uint32_t points = 0, axes = 0, environment = 0, touches = 0, touch_scans = 0;
  std::vector<std::uint32_t> measured;  // for each device of the environment
  std::vector<std::uint32_t> raw;       // for each device
};

template <class T>
T& entry_of(std::vector<T>& of_devices, std::size_t device) {
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

/// The times at which batches were handed over that the recorder has not taken yet. One entry
/// represents the batches of 50 ms: if the disk stalls for an hour, there are 72,000 entries.
class Unwritten {
 public:
  using WallTime = Recorder::WallTime;

  /// Adds a batch that is handed over at `now`; returns its number.
  std::uint64_t add(WallTime now) {
    ++number_;
    if (entries_.empty() || now - entries_.back().since >= kSpacing)
      entries_.push_back({number_, now});
    else
      entries_.back().last = number_;
    return number_;
  }
  /// Removes the batches up to the number `passed`, which the recorder has taken.
  void forget(std::uint64_t passed) {
    while (!entries_.empty() && entries_.front().last <= passed) entries_.pop_front();
  }
  [[nodiscard]] std::optional<WallTime> oldest() const {
    return entries_.empty() ? std::nullopt : std::optional{entries_.front().since};
  }

 private:
  static constexpr std::chrono::milliseconds kSpacing{50};
  struct Entry {
    std::uint64_t last = 0;
    WallTime since{};
  };
  std::deque<Entry> entries_;
  std::uint64_t number_ = 0;
};

}  // namespace

/// The hub and the recorder share one pointer, `waiting`: to the Waiting that is being filled, or
/// null while the hub adds to it. For the hub the pointer is never null, because the recorder
/// replaces the Waiting that it takes by an empty one. If the recorder finds null, it tries again.
struct RecorderThread::State {
  RecorderThreadOptions options;
  Recorder recorder;
  std::atomic<Waiting*> waiting{new Waiting};
  std::atomic<RecorderStatus*> new_status{nullptr};  // set by the recorder, taken by status()
  RecorderStatus known;                              // used by the thread that calls status()
  Dropped unreported;                                // used by the hub
  mutable Unwritten unwritten;                       // used by the hub
  std::atomic<std::uint64_t> passed{0};  // number of the last batch that was passed to the recorder
  std::atomic<std::int64_t> chunk_since_ns{0};  // see Recorder::open_chunk_since(); 0: none
  std::uint64_t dropped_before_run = 0;         // used by the hub
  // error of the recorder thread that was not passed to Recorder::fail() yet
  std::string internal_error;
  std::atomic<std::uint64_t> dropped{0};
  std::atomic<bool> stopping{false};
  WakeUp wake_up;
  std::thread thread;

  State(RecorderThreadOptions o, Recorder r) : options(std::move(o)), recorder(std::move(r)) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() {
    delete waiting.load(std::memory_order_relaxed);
    delete new_status.load(std::memory_order_relaxed);
  }

  /// While an Adding exists, the hub adds data and the recorder finds `waiting` to be null.
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
    auto taken = std::make_unique<Waiting>();
    for (bool last = false; !last;) {
      (void)wake_up.wait_for(kCycle);
      // acquire: pairs with the release in ~RecorderThread()
      last = stopping.load(std::memory_order_acquire);
      taken = take_waiting(std::move(taken));
      const std::uint64_t number = taken->number;
      write_all(*taken);
      note_written(number);
      taken->clear();  // this also breaks the promises of digests that were not made
      report();
    }
  }

  /// Records that the batches up to `number` are in the file, in the open chunk, or lost.
  void note_written(std::uint64_t number) {
    const auto since = recorder.open_chunk_since();
    chunk_since_ns.store(since ? since->time_since_epoch().count() : 0, std::memory_order_relaxed);
    // release: pairs with the acquire in behind(), which then sees the open chunk
    if (number > passed.load(std::memory_order_relaxed))
      passed.store(number, std::memory_order_release);
  }

  void report() {
    auto status = std::make_unique<RecorderStatus>(recorder.status());
    // release: pairs with the acquire in status(); a report that was not taken is deleted
    delete new_status.exchange(status.release(), std::memory_order_acq_rel);
  }

  /// Passes the data to the recorder. An exception means an internal error or a lack of memory: the
  /// recorder then begins a new file, as after a disk fault.
  void write_all(Waiting& data) {
    try {
      if (!internal_error.empty()) recorder.fail(std::exchange(internal_error, {}));
      write(data);
      return;
    } catch (const std::exception& e) {
      internal_error = std::string{"recorder: "} + e.what();
    }
    try {
      recorder.fail(internal_error);
      internal_error.clear();
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): retried in the next cycle
    }
  }

  void drop(const Batch& batch) {
    for (const auto& point : batch.points) lose(unreported.points, point.head.lost_before);
    for (const auto& sample : batch.axes) lose(unreported.axes, sample.head.lost_before);
    for (const auto& e : batch.environment) lose(unreported.environment, e.head.lost_before);

    for (const auto& e : batch.measured_environment)
      lose(entry_of(unreported.measured, e.device), e.sample.head.lost_before);

    for (const auto& touch : batch.touches) lose(unreported.touches, touch.head.lost_before);
    for (const auto& scan : batch.touch_scans) lose(unreported.touch_scans, scan.head.lost_before);

    if (!options.raw) return;
    for (const auto& raw : batch.raw)
      lose(entry_of(unreported.raw, raw.device), raw.block.lost_before);
  }

  /// Counts a message that is dropped, and the messages whose loss before it the message reports.
  void lose(std::uint32_t& unreported_of, std::uint32_t lost_before) {
    unreported_of += 1 + lost_before;
    // relaxed: only a counter, no ordering is needed
    dropped.fetch_add(1, std::memory_order_relaxed);
  }

  void write(Waiting& data) {
    std::vector<std::unique_ptr<Waiting>> earlier;  // the latest part first
    for (auto part = std::move(data.earlier); part != nullptr;) {
      auto before = std::move(part->earlier);
      earlier.push_back(std::move(part));
      part = std::move(before);
    }
    for (; !earlier.empty(); earlier.pop_back()) write_part(*earlier.back());
    write_part(data);
    recorder.tick(Recorder::WallTime::clock::now());
  }

  void write_part(Waiting& data) {
    for (auto& a : data.attachments) recorder.attach(std::move(a.what), a.time);
    // Environment samples are recorded first: a further file begins with the repeated environment
    // samples, which must precede the new ones.
    for (const auto& [taken, e] : data.environment) recorder.record(e.sample, e.device, taken);
    for (const auto& [taken, s] : data.axes) recorder.record(s, options.devices.axes, taken);
    for (const auto& [taken, s] : data.points) recorder.record(s, options.devices.tracker, taken);
    for (const auto& [taken, t] : data.touches) recorder.record(t, options.devices.touches, taken);
    for (const auto& [taken, s] : data.touch_scans)
      recorder.record(s, options.devices.touches, taken);

    data.raw.for_each([this](const protocol::RawBytes& bytes, protocol::HostTime taken) {
      recorder.record(bytes, taken);
    });

    for (const auto& [taken, e] : data.events) recorder.record(e, taken);
    if (!data.digests.empty()) recorder.flush();
    for (auto& request : data.digests) {
      RecordingDigest digest = recorder.digest();
      if (digest.gap.empty() && request.dropped > 0)
        digest.gap = fmt::format("{} messages of the run are missing", request.dropped);
      request.promise.set_value(std::move(digest));
    }
  }

  /// Begins a further part when this one is so large that growing its vectors would take long.
  static void make_room(Adding& waiting) {
    if (waiting->bytes_here() < kMostInOnePart) return;
    auto next = std::make_unique<Waiting>();
    next->bytes_earlier = waiting->bytes();
    next->number = waiting->number;
    next->full = waiting->full;
    next->earlier.reset(waiting.to);
    waiting.to = next.release();
  }
};

Result<std::unique_ptr<RecorderThread>> RecorderThread::start(RecorderThreadOptions options,
                                                              RecordingInfo info) {
  auto recorder =
      Recorder::open(options.recorder, std::move(info), Recorder::WallTime::clock::now());
  ABBE_TRY(recorder);
  auto state = std::make_unique<State>(std::move(options), std::move(*recorder));
  state->known = state->recorder.status();
  return std::unique_ptr<RecorderThread>{new RecorderThread{std::move(state)}};
}

RecorderThread::RecorderThread(std::unique_ptr<State> state) : state_(std::move(state)) {
  state_->thread = std::thread([s = state_.get()] { s->serve(); });
}

RecorderThread::~RecorderThread() {
  // release: pairs with the acquire in serve()
  state_->stopping.store(true, std::memory_order_release);
  state_->wake_up.signal();
  state_->thread.join();
  try {
    (void)state_->recorder.close();  // a file that cannot be finished stays readable as .part
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): no memory: stays .part
  }
}

void RecorderThread::on_samples(const Batch& batch) {
  if (!batch.empty()) hand_over(batch);
}

void RecorderThread::hand_over(const Batch& batch) {
  State::Adding adding{*state_};
  Dropped& unreported = state_->unreported;
  adding->full =
      adding->full || adding->bytes() + bytes_of(batch) > state_->options.most_waiting_bytes;

  if (adding->full) return state_->drop(batch);
  State::make_room(adding);
  Waiting& waiting = *adding.to;
  // acquire: pairs with the release in note_written()
  state_->unwritten.forget(state_->passed.load(std::memory_order_acquire));
  waiting.number = state_->unwritten.add(Recorder::WallTime::clock::now());
  const DeviceNames& names = state_->options.devices;
  const auto taken = batch.taken;

  append(waiting.points, taken, batch.points, unreported.points);
  append(waiting.axes, taken, batch.axes, unreported.axes);
  for (const auto& sample : batch.environment)
    append(waiting.environment, taken, {names.tracker, sample}, unreported.environment);
  for (const auto& [device, sample] : batch.measured_environment)
    append(waiting.environment, taken, {names.environment.at(device), sample},
           entry_of(unreported.measured, device));
  append(waiting.touches, taken, batch.touches, unreported.touches);
  append(waiting.touch_scans, taken, batch.touch_scans, unreported.touch_scans);
  if (!state_->options.raw) return;
  for (const auto& [device, block] : batch.raw) {
    if (device >= names.all.size()) {  // no name: no stream to record it in
      state_->dropped.fetch_add(1, std::memory_order_relaxed);
    } else {
      waiting.raw.append(taken, names.all[device], block, entry_of(unreported.raw, device));
    }
  }
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
  const std::unique_ptr<RecorderStatus> latest{
      state_->new_status.exchange(nullptr, std::memory_order_acq_rel)};
  if (latest) state_->known = std::move(*latest);
  return state_->known;
}

std::chrono::nanoseconds RecorderThread::behind(Recorder::WallTime now) const {
  // acquire: pairs with the release in note_written()
  state_->unwritten.forget(state_->passed.load(std::memory_order_acquire));
  const auto chunk_ns = state_->chunk_since_ns.load(std::memory_order_relaxed);
  auto oldest = state_->unwritten.oldest().value_or(now);
  if (chunk_ns != 0)
    oldest = std::min(oldest, Recorder::WallTime{std::chrono::nanoseconds{chunk_ns}});
  return std::max(now - oldest, Recorder::WallTime::duration{0});
}

std::uint64_t RecorderThread::dropped() const noexcept {
  return state_->dropped.load(std::memory_order_relaxed);
}

}  // namespace abbe::daemon
