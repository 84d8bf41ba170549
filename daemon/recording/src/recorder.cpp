#include "abbe/recording/recorder.hpp"

#include <algorithm>
#include <utility>

#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "recorder_state.hpp"

namespace abbe::daemon {

namespace mcap = protocol::mcap;
using recording::Stream;
using recording::TimedAttachment;

std::string_view name(RecorderStatus::State state) noexcept {
  switch (state) {
    case RecorderStatus::State::Recording:
      return "recording";
    case RecorderStatus::State::DiskFull:
      return "disk full";
    case RecorderStatus::State::Failed:
      return "failed";
    case RecorderStatus::State::Closed:
      return "closed";
  }
  return "?";
}

// --- messages

bool Recorder::State::add(Stream stream, Dates dates, std::span<const std::byte> data) {
  cycle = std::max(cycle, dates.taken);
  if (status.state != RecorderStatus::State::Recording) {
    ++status.lost;
    return false;
  }

  constexpr std::size_t kMessageHead = mcap::kRecordHeadSize + 2 + 4 + 8 + 8;
  if (!chunk.empty() && chunk.records_size() + kMessageHead + data.size() > options.chunk_bytes) {
    write_chunk();
    if (status.state != RecorderStatus::State::Recording) {
      ++status.lost;
      return false;
    }
  }

  if (chunk.empty()) chunk_since = now;
  if (!std::exchange(environment_carried, true)) add_carried_environment(dates.taken);
  put(stream, dates, data);

  return true;
}

void Recorder::State::put(Stream stream, Dates dates, std::span<const std::byte> data) {
  chunk.add(mcap::Message{recording::channel_id(stream), sequences[recording::index(stream)]++,
                          utc_ns(dates.taken), utc_ns(dates.described), data});
}

/// Repeats environment samples in a new file: samples that the instants in this file need, and the
/// last sample of each device, because some devices send only changes. The messages are dated at
/// the beginning of the file; their content keeps the time of measurement.
void Recorder::State::add_carried_environment(protocol::HostTime begin) {
  v1::EnvironmentSample message;
  std::vector<std::byte> bytes;
  environment_to_carry.for_each([&](std::string_view device, const auto& sample) {
    recording::fill(message, sample, device);
    if (!encode(message, bytes)) return;
    put(Stream::Environment, {begin, begin}, bytes);
    ++carried_in_chunk;
  });
}

template <class Message>
void Recorder::State::add_marked(Stream stream, Dates dates, std::string_view device,
                                 Message& message) {
  const std::uint32_t missing = lost.take(stream, device);
  if (missing > 0) recording::mark_gap(message, missing);
  const bool encoded = encode(message, payload).has_value();
  if (!encoded) ++status.refused;
  account(stream, device, recording::lost_before(message, missing),
          encoded && add(stream, dates, payload));
}

void Recorder::State::account(Stream stream, std::string_view device, std::uint32_t lost_before,
                              bool added) {
  (added ? in_chunk : lost).add(stream, device, lost_before + 1);
}

// --- public functions

Result<Recorder> Recorder::open(RecorderOptions options, RecordingInfo info, WallTime now) {
  auto state = std::make_unique<State>(std::move(options), std::move(info));
  state->now = now;
  if (const auto begun = state->begin_file(); !begun) {
    if (begun.error().error == EEXIST) return daemon::fail(ErrorCode::Io, begun.error().what);
    state->report_fault(begun.error());
  }
  return Recorder{std::move(state)};
}

Recorder::Recorder(std::unique_ptr<State> state) : state_(std::move(state)) {}
Recorder::Recorder(Recorder&&) noexcept = default;
Recorder& Recorder::operator=(Recorder&& other) noexcept {
  std::swap(state_, other.state_);  // the destructor of `other` closes the former recording
  return *this;
}
Recorder::~Recorder() {
  if (state_) (void)close();
}

void Recorder::record(const protocol::TrackerPoint& point, std::string_view device, Taken taken) {
  recording::fill(state_->tracker_point, point, device);
  state_->add_marked(Stream::TrackerPoint, State::dates_of(point.head.time, taken), device,
                     state_->tracker_point);
}

void Recorder::record(const protocol::AxisSample& sample, std::string_view device, Taken taken) {
  recording::fill(state_->axis_sample, sample, device);
  state_->add_marked(Stream::AxisSample, State::dates_of(sample.head.time, taken), device,
                     state_->axis_sample);
  state_->axes_known = ZeroState{.at = sample.head.time, .unknown = sample.missing_mask};
}

void Recorder::record(const protocol::ProbeTrigger& touch, std::string_view device, Taken taken) {
  recording::fill(state_->touch, touch, device);
  state_->add_marked(Stream::ProbeTrigger, State::dates_of(touch.head.time, taken), device,
                     state_->touch);
}

void Recorder::record(const protocol::TouchScan& scan, std::string_view device, Taken taken) {
  recording::fill(state_->touch_scan, scan, device);
  state_->add_marked(Stream::TouchScan, State::dates_of(scan.head.time, taken), device,
                     state_->touch_scan);
}

void Recorder::record(const protocol::EnvironmentSample& sample, std::string_view device,
                      Taken taken) {
  recording::fill(state_->environment, sample, device);
  state_->add_marked(Stream::Environment, State::dates_of(sample.head.time, taken), device,
                     state_->environment);
  state_->environment_to_carry.take(sample, device, taken.value_or(sample.head.time));
}

void Recorder::record(protocol::RawBytes bytes, Taken taken) {
  bytes.lost_before += state_->lost.take(Stream::RawBytes, bytes.device);
  const auto size = encode_cdr(bytes, state_->raw_payload);
  if (!size) ++state_->status.refused;
  const bool added = size && state_->add(Stream::RawBytes, State::dates_of(bytes.time, taken),
                                         std::span{state_->raw_payload}.first(*size));
  state_->account(Stream::RawBytes, bytes.device, bytes.lost_before, added);
}

void Recorder::record(const v1::CalibrationEvent& event, Taken taken) {
  const protocol::HostTime time{std::chrono::nanoseconds{event.host_time_ns()}};
  if (!encode(event, state_->payload)) {
    ++state_->status.refused;
    return;
  }
  (void)state_->add(Stream::CalibrationEvent, State::dates_of(time, taken), state_->payload);
  state_->calibrating = event.state() != name(SessionState::Active) &&
                        event.state() != name(SessionState::Refused) &&
                        event.state() != name(SessionState::Idle);
}

/// Takes the state with which the live run began, or the acceptance of a sensor. An attachment that
/// cannot be read is recorded but not used.
void Recorder::State::follow_sensors(const RecordingAttachment& attachment) {
  if (attachment.name == kSensorStateName) (void)environment_to_carry.go_on(attachment);
  if (attachment.name != kSensorAcceptedName) return;
  if (auto acceptance = sensor_acceptance_from(attachment))
    environment_to_carry.accept(std::move(*acceptance));
}

void Recorder::attach(RecordingAttachment attachment, protocol::HostTime time) {
  State& s = *state_;
  if (is_calibration_request(attachment.name)) {
    s.calibrating = true;
    s.asked = State::AtRequest{s.part, s.status.lost + s.status.refused};
  }

  s.follow_sensors(attachment);

  if (s.status.state == RecorderStatus::State::Recording) s.end_cycle();
  s.attachments.push_back({std::move(attachment), s.utc_ns(time)});

  // If no file is open, the attachment is written at the beginning of the next file.
  if (s.status.state != RecorderStatus::State::Recording) return;
  mcap::Buffer bytes;
  const TimedAttachment& kept = s.attachments.back();
  const auto index =
      recording::append_attachment(kept.attachment, kept.time_ns, s.file->size(), bytes);
  if (const auto written = s.file->append(bytes); !written) return s.enter_fault(written.error());
  s.summary.add(index);
  s.unsynced = true;
  s.status.bytes = s.file->size();
}

void Recorder::tick(WallTime now) {
  State& s = *state_;
  s.now = now;
  if (s.status.state == RecorderStatus::State::Closed) return;
  if (s.status.state != RecorderStatus::State::Recording) return s.retry();
  if (s.is_full() || (!s.chunk.empty() && now - s.chunk_since >= s.options.chunk_period))
    s.end_cycle();
  if (s.status.state == RecorderStatus::State::Recording) s.sync_if_due();
}

void Recorder::flush() {
  if (state_->status.state == RecorderStatus::State::Recording) state_->end_cycle();
}

void Recorder::fail(const std::string& what) {
  if (state_->status.state == RecorderStatus::State::Recording)
    return state_->enter_fault({0, what});
  if (state_->status.state != RecorderStatus::State::Closed) state_->note_fault({0, what});
}

std::optional<Recorder::WallTime> Recorder::open_chunk_since() const {
  return state_->chunk.empty() ? std::nullopt : std::optional{state_->chunk_since};
}

RecordingDigest Recorder::digest() const {
  if (!state_->file) return {{}, 0, state_->status.file, state_->gap_of_run()};
  return {state_->file->sha256(), state_->file->size(), state_->file->path(), state_->gap_of_run()};
}

Result<RecordingDigest> Recorder::close() {
  State& s = *state_;
  if (s.status.state == RecorderStatus::State::Closed)
    return daemon::fail(ErrorCode::Usage, "close recording: it is already closed");

  flush();
  const bool was_recording = s.status.state == RecorderStatus::State::Recording;
  const std::string fault = s.status.fault, gap = s.gap_of_run();
  s.status.state = RecorderStatus::State::Closed;
  if (!s.file) return daemon::fail(ErrorCode::Io, fault);

  if (s.messages_in_file == 0 && (s.part > 1 || s.attachments.empty())) {
    s.file->discard();
    s.file.reset();
    return RecordingDigest{};
  }

  const auto ended = s.end_file();
  const RecordingDigest finished{s.file->sha256(), s.file->size(), s.file->path(), gap};
  s.file.reset();
  if (!ended) return daemon::fail(ErrorCode::Io, ended.error().what);
  if (!was_recording) return daemon::fail(ErrorCode::Io, fault);

  return finished;
}

const RecorderStatus& Recorder::status() const noexcept {
  return state_->status;
}

}  // namespace abbe::daemon
