#include "abbe/daemon/recorder_thread.hpp"

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

namespace abbe::daemon {
namespace {

// How long a sample may wait in memory before it is encoded; a tenth of the shortest chunk.
constexpr std::chrono::milliseconds kTurn{20};

struct Attachment {
  RecordingAttachment what;
  protocol::HostTime time{};
};

/// What waits for the recorder.
struct Waiting {
  Batch batch;
  std::vector<v1::CalibrationEvent> events;
  std::vector<Attachment> attachments;
  std::vector<std::promise<RecordingDigest>> digests;

  [[nodiscard]] std::size_t size() const noexcept {
    return batch.points.size() + batch.axes.size() + batch.environment.size() + batch.tracker_raw.size() +
           batch.encoder_raw.size();
  }
  void clear() noexcept {
    batch.clear();
    events.clear();
    attachments.clear();
    digests.clear();
  }
};

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

struct RecorderThread::State {
  RecorderThreadOptions options;
  Recorder recorder;
  mutable std::mutex mutex;
  std::condition_variable stop_asked;
  Waiting waiting;            // under mutex
  RecorderStatus status;      // under mutex, a copy of the recorder's own
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
      write(turn);
      turn.clear();
      const std::lock_guard lock{mutex};
      status = recorder.status();
    }
  }

  void write(Waiting& turn) {
    for (auto& a : turn.attachments) recorder.attach(std::move(a.what), a.time);
    for (const auto& s : turn.batch.axes) recorder.record(s, options.encoder);
    for (const auto& s : turn.batch.points) recorder.record(s, options.tracker);
    for (const auto& s : turn.batch.environment) recorder.record(s, options.tracker);
    for (const auto& b : turn.batch.tracker_raw) recorder.record(b, options.tracker);
    for (const auto& b : turn.batch.encoder_raw) recorder.record(b, options.encoder);
    for (const auto& e : turn.events) recorder.record(e);
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
  (void)state_->recorder.close();  // what could not be finished stays readable as .part
}

void RecorderThread::hand_over(const Batch& batch) {
  const std::lock_guard lock{state_->mutex};
  auto& waiting = state_->waiting.batch;
  const std::size_t coming = batch.points.size() + batch.axes.size() + batch.environment.size();
  if (state_->waiting.size() + coming > state_->options.most_waiting) {
    state_->dropped += coming;
    return;
  }
  append(waiting.points, batch.points);
  append(waiting.axes, batch.axes);
  append(waiting.environment, batch.environment);
  if (!state_->options.raw) return;
  append(waiting.tracker_raw, batch.tracker_raw);
  append(waiting.encoder_raw, batch.encoder_raw);
}

void RecorderThread::hand_over(v1::CalibrationEvent event) {
  const std::lock_guard lock{state_->mutex};
  state_->waiting.events.push_back(std::move(event));
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
