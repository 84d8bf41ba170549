#include <fmt/format.h>

#include <cerrno>
#include <utility>

#include "abbe/messages/recording_info.hpp"
#include "abbe/result/try.hpp"
#include "recorder_state.hpp"

namespace abbe::daemon {

namespace mcap = protocol::mcap;
using recording::IoFault;
using recording::RecordingFile;
using recording::TimedAttachment;
using IoResult = tl::expected<void, IoFault>;

namespace {

/// Free space, in chunks, that is needed in addition to min_free_bytes before a new file is begun.
/// Without it, a disk near the limit would fill the directory with very short files.
constexpr std::uint64_t kResumeMarginChunks = 16;

}  // namespace

std::filesystem::path Recorder::State::path(std::uint32_t number,
                                            std::string_view extension) const {
  const std::string suffix = number == 1 ? "" : fmt::format("-{}", number);
  return options.directory / fmt::format("{}{}{}", options.name, suffix, extension);
}

IoResult Recorder::State::write_front(RecordingFile& fresh,
                                      mcap::SummaryBuilder& fresh_summary) const {
  mcap::Buffer front;
  recording::append_front(info, {part + 1, previous_file}, fresh_summary, front);
  for (const TimedAttachment& kept : attachments) {
    fresh_summary.add(
        recording::append_attachment(kept.attachment, kept.time_ns, front.size(), front));
  }
  ABBE_TRY(fresh.append(front));
  return fresh.sync();
}

/// Removes the requests of ended calibrations from the attachments that are repeated in the next
/// file. The newest request is kept while its calibration is running.
void Recorder::State::forget_finished_requests() {
  bool keep_newest = calibrating;
  std::vector<TimedAttachment> kept;
  for (auto a = attachments.rbegin(); a != attachments.rend(); ++a)
    if (!is_calibration_request(a->attachment.name) || std::exchange(keep_newest, false))
      kept.push_back(std::move(*a));
  attachments.assign(std::make_move_iterator(kept.rbegin()), std::make_move_iterator(kept.rend()));
}

/// Prepares the state of the sensor checks for a further file, which begins with it so that its
/// replay uses the values of the live run.
void Recorder::State::carry_sensors_on() {
  environment_to_carry.begin_file(cycle);
  if (!environment_to_carry.checks_sensors()) return;
  std::erase_if(attachments, [&](const TimedAttachment& a) {
    if (a.attachment.name == kSensorStateName) return true;
    if (a.attachment.name != kSensorAcceptedName) return false;
    const auto acceptance = sensor_acceptance_from(a.attachment);
    return !acceptance || environment_to_carry.contains(*acceptance);
  });
  attachments.push_back({environment_to_carry.state(), utc_ns(environment_to_carry.state_at())});
}

IoResult Recorder::State::begin_file() {
  // The directory is created here and not in open(), because the disk may have been read-only at
  // that time.
  std::error_code made;
  std::filesystem::create_directories(options.directory, made);
  if (made) return tl::unexpected(recording::io_fault("create", options.directory, made.value()));

  if (recording::free_bytes_of(options.directory) < options.min_free_bytes) {
    return tl::unexpected(recording::io_fault("begin", path(part + 1, ".mcap.part"), ENOSPC));
  }

  const auto finished = path(part + 1, ".mcap");
  std::error_code error;
  if (std::filesystem::exists(finished, error))
    return tl::unexpected(recording::io_fault("create", finished, EEXIST));
  if (error) return tl::unexpected(recording::io_fault("look for", finished, error.value()));

  forget_finished_requests();
  if (part > 0 && axes_known)
    recording::carry_zeros_on(attachments, *axes_known, utc_ns(axes_known->at));
  if (part > 0) carry_sensors_on();
  auto fresh = RecordingFile::create(path(part + 1, ".mcap.part"));
  ABBE_TRY(fresh);
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
  status.file = file->path();
  if (!status.fault.empty())
    status.last_fault =
        fmt::format("{}; over: recording continues in {}", std::exchange(status.fault, {}),
                    status.file.filename().string());
  status.bytes = file->size();
  ++status.files;

  return {};
}

IoResult Recorder::State::end_file() {
  if (!end_written) {
    mcap::Buffer end;
    summary.finish(file->size(), end);
    ABBE_TRY(file->append(end));
    end_written = true;
  }
  auto finished = file->finish();
  status.file = file->path();
  status.bytes = file->size();
  return finished;
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
    enter_fault({ENOSPC, fmt::format("write {}: less than {} bytes would stay free",
                                     file->path().string(), options.min_free_bytes)});
  }
}

bool Recorder::State::is_full() const {
  return status.state == RecorderStatus::State::Recording && messages_in_file > 0 &&
         options.max_file_bytes > 0 && file->size() >= options.max_file_bytes && !calibrating;
}

/// Closes the chunk, and begins the next file if this one is full. Called between two cycles of the
/// hub, so that a file begins with a whole cycle.
void Recorder::State::end_cycle() {
  write_chunk();
  if (is_full()) continue_in_next_file();
}

void Recorder::State::continue_in_next_file() {
  if (const auto ended = end_file(); !ended) return enter_fault(ended.error());
  previous_file = file->path().filename().string();
  file.reset();
  if (const auto begun = begin_file(); !begun) report_fault(begun.error());
}

void Recorder::State::sync_if_due() {
  if (!unsynced || now - synced < options.sync_period) return;
  synced = now;
  unsynced = false;
  if (const auto done = file->sync(); !done) enter_fault(done.error());
}

void Recorder::State::note_fault(const IoFault& fault) {
  status.state = recording::is_disk_full(fault.error) ? RecorderStatus::State::DiskFull
                                                      : RecorderStatus::State::Failed;
  status.fault = status.last_fault = fault.what;
}

void Recorder::State::report_fault(const IoFault& fault) {
  note_fault(fault);
  ++status.faults;
  retry_at = now + options.retry_period;
}

void Recorder::State::enter_fault(const IoFault& fault) {
  lose_chunk();
  report_fault(fault);
  if (!file) return;

  if (messages_in_file == 0 && part > 1) {
    file->discard();  // the file has no messages; the next attempt uses its name again
    --part;
    --status.files;
    file.reset();
    return;
  }

  // The end of the file (indexes and footer) is small and may still fit on a full disk. If it does
  // not, the whole chunks are readable without it, and retry() writes it again.
  const bool ended = end_file().has_value();
  previous_file = file->path().filename().string();
  if (ended || !file->is_open()) file.reset();
}

bool Recorder::State::has_room_again() const {
  return recording::free_bytes_of(options.directory) >=
         options.min_free_bytes + kResumeMarginChunks * options.chunk_bytes;
}

void Recorder::State::retry() {
  if (now < retry_at) return;
  retry_at = now + options.retry_period;
  if (status.state == RecorderStatus::State::DiskFull && !has_room_again()) return;
  if (file && (end_file() || !file->is_open())) file.reset();
  if (const auto begun = begin_file(); !begun) note_fault(begun.error());
}

std::string Recorder::State::gap_of_run() const {
  if (status.state != RecorderStatus::State::Recording)
    return fmt::format("nothing is recorded: {}", status.fault);
  if (!asked) return {};
  if (part != asked->part) return "the recording was interrupted during the run";
  const std::uint64_t missing = status.lost + status.refused - asked->not_recorded;
  return missing == 0 ? std::string{} : fmt::format("{} messages of the run are missing", missing);
}

}  // namespace abbe::daemon
