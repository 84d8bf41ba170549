#include "abbe/daemon/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "abbe/daemon/calibration_request.hpp"
#include "abbe/daemon/calibration_session.hpp"
#include "abbe/daemon/datum.hpp"
#include "abbe/protocol/mcap/writer.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "recording/carried_datum.hpp"
#include "recording/file_front.hpp"
#include "recording/loss_ledger.hpp"
#include "recording/recording_file.hpp"
#include "recording/sample_messages.hpp"
#include "recording/streams.hpp"

namespace abbe::daemon {

namespace mcap = protocol::mcap;
using recording::IoFault;
using recording::RecordingFile;
using recording::Stream;
using recording::TimedAttachment;
using IoResult = tl::expected<void, IoFault>;

namespace {

/// Room that must have come back beyond min_free_bytes before a new file is begun: else a disk that hovers at
/// the limit would fill a directory with stumps.
constexpr std::uint64_t kResumeMarginChunks = 16;

struct Dates {
  protocol::HostTime taken;      ///< log_time
  protocol::HostTime described;  ///< publish_time
};

Dates dates(protocol::HostTime described, Recorder::Taken taken) {
  return {taken.value_or(described), described};
}

}  // namespace

struct Recorder::State {
  State(RecorderOptions o, RecordingInfo i)
      : options(std::move(o)), info(std::move(i)), chunk(options.chunk_bytes) {}

  [[nodiscard]] std::uint64_t utc_ns(protocol::HostTime time) const {
    return static_cast<std::uint64_t>(
        std::max<std::int64_t>(0, info.utc_offset.to_utc(time).time_since_epoch().count()));
  }
  [[nodiscard]] std::filesystem::path path(std::uint32_t part, std::string_view extension) const;
  [[nodiscard]] IoResult begin_file();
  [[nodiscard]] IoResult write_front(RecordingFile& fresh, mcap::SummaryBuilder& fresh_summary) const;
  [[nodiscard]] IoResult end_file();
  [[nodiscard]] bool add(Stream stream, Dates dates, std::span<const std::byte> payload);
  void put(Stream stream, Dates dates, std::span<const std::byte> payload);
  /// Marks `message` with what is missing before it, and adds it.
  template <class Message>
  void add_marked(Stream stream, Dates dates, std::string_view device, Message& message);
  void add_carried_environment(protocol::HostTime begin);
  void keep_environment(const protocol::EnvironmentSample& sample, std::string_view device);
  void account(Stream stream, std::string_view device, std::uint32_t lost_before, bool added);
  void write_chunk();
  void end_turn();
  [[nodiscard]] bool is_full() const;
  void lose_chunk();
  void sync_if_due();
  void enter_fault(const IoFault& fault);
  void say_fault(const IoFault& fault);
  void go_on_in_next_file();
  void retry();
  [[nodiscard]] bool has_room_again() const;

  RecorderOptions options;
  RecordingInfo info;
  std::vector<TimedAttachment> attachments;
  std::optional<RecordingFile> file;
  std::uint32_t part = 0;  ///< of the present file
  std::uint64_t messages_in_file = 0;
  bool end_written = false;
  std::string previous_file;
  bool calibrating = false;  ///< the run that was asked for belongs into one file
  mcap::ChunkBuilder chunk;
  mcap::SummaryBuilder summary;
  std::array<std::uint32_t, recording::kStreamCount> sequences{};
  std::map<std::string, protocol::EnvironmentSample, std::less<>> latest_environment;  ///< by device
  bool environment_carried = true;       ///< the present file begins with it
  std::uint64_t carried_in_chunk = 0;    ///< messages of it: they are in a former file, too
  std::optional<DatumState> axes_known;  ///< as the last axis sample said
  RecorderStatus status;
  recording::LossLedger lost;  ///< not yet said by a later message
  recording::LossLedger
      in_chunk;  ///< with what they say was lost before them: gone if the chunk cannot be written

  WallTime now{};
  WallTime chunk_since{};  ///< no message of the open chunk was recorded before this
  WallTime synced{};
  bool unsynced = false;
  WallTime retry_at{};

  // Reused, so that recording a sample allocates nothing once they have grown.
  std::vector<std::byte> payload;
  std::array<std::byte, protocol::kMaxRawBytesCdrSize> raw_payload{};
  v1::TrackerPoint tracker_point;
  v1::AxisSample axis_sample;
  v1::EnvironmentSample environment;
  v1::ProbeTrigger touch;
  v1::TouchScan touch_scan;
};

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

// --- files
// ---------------------------------------------------------------------------------------------------------

std::filesystem::path Recorder::State::path(std::uint32_t number, std::string_view extension) const {
  const std::string suffix = number == 1 ? "" : fmt::format("-{}", number);
  return options.directory / fmt::format("{}{}{}", options.name, suffix, extension);
}

IoResult Recorder::State::write_front(RecordingFile& fresh, mcap::SummaryBuilder& fresh_summary) const {
  mcap::Buffer front;
  recording::append_front(info, {part + 1, previous_file}, fresh_summary, front);
  for (const TimedAttachment& kept : attachments) {
    fresh_summary.add(recording::append_attachment(kept.attachment, kept.time_ns, front.size(), front));
  }
  if (auto written = fresh.append(front); !written) return written;
  return fresh.sync();
}

IoResult Recorder::State::begin_file() {
  if (recording::free_bytes_of(options.directory) < options.min_free_bytes) {
    return tl::unexpected(recording::io_fault("begin", path(part + 1, ".mcap.part"), ENOSPC));
  }
  const auto finished = path(part + 1, ".mcap");
  std::error_code error;
  if (std::filesystem::exists(finished, error))
    return tl::unexpected(recording::io_fault("create", finished, EEXIST));
  if (error) return tl::unexpected(recording::io_fault("look for", finished, error.value()));
  if (part > 0 && axes_known) recording::carry_datum_on(attachments, *axes_known, utc_ns(axes_known->at));
  auto fresh = RecordingFile::create(path(part + 1, ".mcap.part"));
  if (!fresh) return tl::unexpected(fresh.error());
  mcap::SummaryBuilder fresh_summary;
  if (auto written = write_front(*fresh, fresh_summary); !written) {
    fresh->discard();
    return written;
  }
  file = std::move(*fresh);
  summary = std::move(fresh_summary);
  sequences = {};
  environment_carried = false;
  messages_in_file = 0;
  end_written = false;
  ++part;
  synced = now;
  unsynced = false;
  status.state = RecorderStatus::State::Recording;
  status.fault.clear();
  status.file = file->path();
  status.bytes = file->size();
  ++status.files;
  return {};
}

IoResult Recorder::State::end_file() {
  if (!end_written) {
    mcap::Buffer end;
    summary.finish(file->size(), end);
    if (auto written = file->append(end); !written) return written;
    end_written = true;
  }
  auto finished = file->finish(path(part, ".mcap"));
  status.file = file->path();
  status.bytes = file->size();
  return finished;
}

// --- messages
// ------------------------------------------------------------------------------------------------------

bool Recorder::State::add(Stream stream, Dates dates, std::span<const std::byte> data) {
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

/// Some devices speak only when something changes. Published again when the file begins; measured when it
/// was.
void Recorder::State::add_carried_environment(protocol::HostTime begin) {
  v1::EnvironmentSample message;
  std::vector<std::byte> bytes;
  for (const auto& [device, sample] : latest_environment) {
    recording::fill(message, sample, device);
    if (!encode(message, bytes)) continue;
    put(Stream::Environment, {begin, begin}, bytes);
    ++carried_in_chunk;
  }
}

template <class Message>
void Recorder::State::add_marked(Stream stream, Dates dates, std::string_view device, Message& message) {
  const std::uint32_t missing = lost.take(stream, device);
  if (missing > 0) recording::mark_gap(message, missing);
  const bool encoded = encode(message, payload).has_value();
  if (!encoded) ++status.refused;
  account(stream, device, missing, encoded && add(stream, dates, payload));
}

void Recorder::State::account(Stream stream, std::string_view device, std::uint32_t lost_before, bool added) {
  (added ? in_chunk : lost).add(stream, device, lost_before + 1);
}

void Recorder::State::lose_chunk() {
  status.lost += chunk.message_count() - std::exchange(carried_in_chunk, 0);
  chunk.clear();
  lost.add(in_chunk);
  in_chunk.clear();
}

void Recorder::State::write_chunk() {
  if (chunk.empty()) return;
  const std::uint64_t messages = chunk.message_count();
  const mcap::ClosedChunk closed = chunk.close();
  const std::uint64_t offset = file->size();
  const auto written = file->append(closed.bytes);
  if (!written) return enter_fault(written.error());
  summary.add(closed, offset);
  chunk.clear();
  carried_in_chunk = 0;
  in_chunk.clear();
  unsynced = true;
  messages_in_file += messages;
  status.messages += messages;
  ++status.chunks;
  status.bytes = file->size();
  if (file->free_bytes() < options.min_free_bytes) {
    enter_fault({ENOSPC, fmt::format("write {}: less than {} bytes would stay free", file->path().string(),
                                     options.min_free_bytes)});
  }
}

bool Recorder::State::is_full() const {
  return status.state == RecorderStatus::State::Recording && messages_in_file > 0 &&
         options.max_file_bytes > 0 && file->size() >= options.max_file_bytes && !calibrating;
}

/// Between two turns of the hub, so that a file begins with a whole one.
void Recorder::State::end_turn() {
  write_chunk();
  if (is_full()) go_on_in_next_file();
}

void Recorder::State::go_on_in_next_file() {
  if (const auto ended = end_file(); !ended) return enter_fault(ended.error());
  previous_file = file->path().filename().string();
  file.reset();
  std::erase_if(attachments, [](const auto& kept) { return is_calibration_request(kept.attachment.name); });
  if (const auto begun = begin_file(); !begun) say_fault(begun.error());
}

// --- time and trouble
// ----------------------------------------------------------------------------------------------

void Recorder::State::sync_if_due() {
  if (!unsynced || now - synced < options.sync_period) return;
  synced = now;
  unsynced = false;
  if (const auto done = file->sync(); !done) enter_fault(done.error());
}

void Recorder::State::say_fault(const IoFault& fault) {
  status.state =
      recording::is_disk_full(fault.error) ? RecorderStatus::State::DiskFull : RecorderStatus::State::Failed;
  status.fault = fault.what;
  retry_at = now + options.retry_period;
}

void Recorder::State::enter_fault(const IoFault& fault) {
  lose_chunk();
  say_fault(fault);
  if (messages_in_file == 0 && part > 1) {
    file->discard();  // a stump: the next attempt takes its name
    --part;
    --status.files;
    file.reset();
    return;
  }
  // The end is small and may still fit. If not, the whole chunks are readable without it, and retry() tries
  // again.
  const bool ended = end_file().has_value();
  previous_file = file->path().filename().string();
  if (ended) file.reset();
}

bool Recorder::State::has_room_again() const {
  return recording::free_bytes_of(options.directory) >=
         options.min_free_bytes + kResumeMarginChunks * options.chunk_bytes;
}

void Recorder::State::retry() {
  if (now < retry_at) return;
  retry_at = now + options.retry_period;
  if (status.state == RecorderStatus::State::DiskFull && !has_room_again()) return;
  if (file && end_file()) file.reset();
  if (const auto begun = begin_file(); !begun) status.fault = begun.error().what;
}

// --- the public face
// -----------------------------------------------------------------------------------------------

Result<Recorder> Recorder::open(RecorderOptions options, RecordingInfo info, WallTime now) {
  auto state = std::make_unique<State>(std::move(options), std::move(info));
  state->now = now;
  if (const auto begun = state->begin_file(); !begun) {
    if (!recording::is_disk_full(begun.error().error)) return fail(ErrorCode::Io, begun.error().what);
    state->status.state = RecorderStatus::State::DiskFull;
    state->status.fault = begun.error().what;
    state->retry_at = now + state->options.retry_period;
  }
  return Recorder{std::move(state)};
}

Recorder::Recorder(std::unique_ptr<State> state) : state_(std::move(state)) {}
Recorder::Recorder(Recorder&&) noexcept = default;
Recorder& Recorder::operator=(Recorder&& other) noexcept {
  std::swap(state_, other.state_);  // what was here is closed with `other`
  return *this;
}
Recorder::~Recorder() {
  if (state_) (void)close();
}

void Recorder::record(const protocol::TrackerPoint& point, std::string_view device, Taken taken) {
  recording::fill(state_->tracker_point, point, device);
  state_->add_marked(Stream::TrackerPoint, dates(point.head.time, taken), device, state_->tracker_point);
}

void Recorder::record(const protocol::AxisSample& sample, std::string_view device, Taken taken) {
  recording::fill(state_->axis_sample, sample, device);
  state_->add_marked(Stream::AxisSample, dates(sample.head.time, taken), device, state_->axis_sample);
  state_->axes_known = DatumState{.at = sample.head.time, .unknown = sample.missing_mask};
}

void Recorder::record(const protocol::ProbeTrigger& touch, std::string_view device, Taken taken) {
  recording::fill(state_->touch, touch, device);
  state_->add_marked(Stream::ProbeTrigger, dates(touch.head.time, taken), device, state_->touch);
}

void Recorder::record(const protocol::TouchScan& scan, std::string_view device, Taken taken) {
  recording::fill(state_->touch_scan, scan, device);
  state_->add_marked(Stream::TouchScan, dates(scan.head.time, taken), device, state_->touch_scan);
}

void Recorder::record(const protocol::EnvironmentSample& sample, std::string_view device, Taken taken) {
  recording::fill(state_->environment, sample, device);
  state_->add_marked(Stream::Environment, dates(sample.head.time, taken), device, state_->environment);
  state_->keep_environment(sample, device);
}

void Recorder::State::keep_environment(const protocol::EnvironmentSample& sample, std::string_view device) {
  auto latest = latest_environment.find(device);
  if (latest == latest_environment.end()) latest = latest_environment.emplace(device, sample).first;
  latest->second = sample;
  latest->second.head.lost_before = 0;  // that is said where it was lost
  latest->second.head.flags &= ~static_cast<protocol::SampleFlags>(protocol::SampleFlag::GapBefore);
}

void Recorder::record(protocol::RawBytes bytes, Taken taken) {
  const std::uint32_t missing = state_->lost.take(Stream::RawBytes, bytes.device);
  bytes.lost_before += missing;
  const auto size = encode_cdr(bytes, state_->raw_payload);
  if (!size) ++state_->status.refused;
  const bool added = size && state_->add(Stream::RawBytes, dates(bytes.time, taken),
                                         std::span{state_->raw_payload}.first(*size));
  state_->account(Stream::RawBytes, bytes.device, missing, added);
}

void Recorder::record(const v1::CalibrationEvent& event, Taken taken) {
  const protocol::HostTime time{std::chrono::nanoseconds{event.host_time_ns()}};
  if (!encode(event, state_->payload)) {
    ++state_->status.refused;
    return;
  }
  (void)state_->add(Stream::CalibrationEvent, dates(time, taken), state_->payload);
  state_->calibrating = event.state() != name(SessionState::Active) &&
                        event.state() != name(SessionState::Refused) &&
                        event.state() != name(SessionState::Idle);
}

void Recorder::attach(RecordingAttachment attachment, protocol::HostTime time) {
  State& s = *state_;
  s.calibrating = s.calibrating || is_calibration_request(attachment.name);
  if (s.status.state == RecorderStatus::State::Recording) s.end_turn();
  s.attachments.push_back({std::move(attachment), s.utc_ns(time)});
  if (s.status.state != RecorderStatus::State::Recording) return;  // the next file begins with it
  mcap::Buffer bytes;
  const TimedAttachment& kept = s.attachments.back();
  const auto index = recording::append_attachment(kept.attachment, kept.time_ns, s.file->size(), bytes);
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
  if (s.is_full() || (!s.chunk.empty() && now - s.chunk_since >= s.options.chunk_period)) s.end_turn();
  if (s.status.state == RecorderStatus::State::Recording) s.sync_if_due();
}

void Recorder::flush() {
  if (state_->status.state == RecorderStatus::State::Recording) state_->end_turn();
}

RecordingDigest Recorder::digest() const {
  if (!state_->file) return {{}, 0, state_->status.file};
  return {state_->file->sha256(), state_->file->size(), state_->file->path()};
}

Result<RecordingDigest> Recorder::close() {
  State& s = *state_;
  if (s.status.state == RecorderStatus::State::Closed)
    return fail(ErrorCode::Usage, "close recording: it is closed");
  flush();
  const bool was_recording = s.status.state == RecorderStatus::State::Recording;
  const std::string fault = s.status.fault;
  s.status.state = RecorderStatus::State::Closed;
  if (!s.file) return fail(ErrorCode::Io, fault);
  if (s.messages_in_file == 0 && (s.part > 1 || s.attachments.empty())) {
    s.file->discard();
    s.file.reset();
    return RecordingDigest{};
  }
  const auto ended = s.end_file();
  const RecordingDigest finished = digest();
  s.file.reset();
  if (!ended) return fail(ErrorCode::Io, ended.error().what);
  if (!was_recording) return fail(ErrorCode::Io, fault);
  return finished;
}

const RecorderStatus& Recorder::status() const noexcept {
  return state_->status;
}

}  // namespace abbe::daemon
