#pragma once
/// The state of a Recorder. recorder.cpp converts samples to messages and collects them in chunks;
/// recorder_files.cpp creates, writes, syncs and ends the files, and begins a new one after a
/// fault.

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/protocol/mcap/writer.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "abbe/recording/recorder.hpp"
#include "carried_environment.hpp"
#include "carried_zero.hpp"
#include "file_front.hpp"
#include "loss_ledger.hpp"
#include "recording_file.hpp"
#include "sample_messages.hpp"
#include "streams.hpp"

namespace abbe::daemon {

struct Recorder::State {
  using IoFault = recording::IoFault;
  using IoResult = tl::expected<void, IoFault>;
  using RecordingFile = recording::RecordingFile;
  using Stream = recording::Stream;
  struct Dates {
    protocol::HostTime taken;      ///< log_time
    protocol::HostTime described;  ///< publish_time
  };
  [[nodiscard]] static Dates dates_of(protocol::HostTime described, Taken taken) {
    return {taken.value_or(described), described};
  }

  State(RecorderOptions o, RecordingInfo i)
      : options(std::move(o)),
        info(std::move(i)),
        chunk(options.chunk_bytes),
        environment_to_carry(options.sensors, options.weather_station, options.watermark) {}

  [[nodiscard]] std::uint64_t utc_ns(protocol::HostTime time) const {
    return static_cast<std::uint64_t>(
        std::max<std::int64_t>(0, info.utc_offset.to_utc(time).time_since_epoch().count()));
  }
  [[nodiscard]] std::filesystem::path path(std::uint32_t part, std::string_view extension) const;
  [[nodiscard]] IoResult begin_file();
  [[nodiscard]] IoResult write_front(RecordingFile& fresh,
                                     protocol::mcap::SummaryBuilder& fresh_summary) const;
  [[nodiscard]] IoResult end_file();
  void forget_finished_requests();
  void carry_sensors_on();
  void follow_sensors(const RecordingAttachment& attachment);
  [[nodiscard]] std::string gap_of_run() const;
  [[nodiscard]] bool add(Stream stream, Dates dates, std::span<const std::byte> payload);
  void put(Stream stream, Dates dates, std::span<const std::byte> payload);
  /// Sets lost_before of `message` to the number of messages that are missing before it, and adds
  /// the message to the chunk.
  template <class Message>
  void add_marked(Stream stream, Dates dates, std::string_view device, Message& message);
  void add_carried_environment(protocol::HostTime begin);
  void account(Stream stream, std::string_view device, std::uint32_t lost_before, bool added);
  void write_chunk();
  void end_cycle();
  [[nodiscard]] bool is_full() const;
  void lose_chunk();
  void sync_if_due();
  void enter_fault(const IoFault& fault);
  void report_fault(const IoFault& fault);
  void note_fault(const IoFault& fault);
  void continue_in_next_file();
  void retry();
  [[nodiscard]] bool has_room_again() const;

  RecorderOptions options;
  RecordingInfo info;
  std::vector<recording::TimedAttachment> attachments;
  std::optional<RecordingFile> file;
  std::uint32_t part = 0;  ///< number of the present file
  std::uint64_t messages_in_file = 0;
  bool end_written = false;
  std::string previous_file;
  /// a calibration is running: no new file is begun, so that its run is in one file
  bool calibrating = false;
  /// Values at the time when the last calibration was requested.
  struct AtRequest {
    std::uint32_t part = 0;
    std::uint64_t not_recorded = 0;
  };
  std::optional<AtRequest> asked;
  protocol::mcap::ChunkBuilder chunk;
  protocol::mcap::SummaryBuilder summary;
  std::array<std::uint32_t, recording::kStreamCount> sequences{};
  /// false: the present file must begin with the samples of environment_to_carry
  bool environment_carried = true;
  /// number of repeated environment messages in the open chunk. They are also in an earlier file,
  /// and do not count as lost with the chunk.
  std::uint64_t carried_in_chunk = 0;
  std::optional<ZeroState> axes_known;  ///< state after the last axis sample
  recording::CarriedEnvironment environment_to_carry;
  protocol::HostTime cycle{};  ///< time of the last message's cycle
  RecorderStatus status;
  recording::LossLedger lost;  ///< messages lost, not yet reported in a later message
  /// messages of the open chunk, plus the losses they report: all are lost if the chunk cannot be
  /// written
  recording::LossLedger in_chunk;

  WallTime now{};
  WallTime chunk_since{};  ///< no message of the open chunk was recorded before this time
  WallTime synced{};
  bool unsynced = false;
  WallTime retry_at{};

  // These buffers are reused and keep their capacity, so that recording allocates only for the
  // first samples.
  std::vector<std::byte> payload;
  std::array<std::byte, protocol::kMaxRawBytesCdrSize> raw_payload{};
  v1::TrackerPoint tracker_point;
  v1::AxisSample axis_sample;
  v1::EnvironmentSample environment;
  v1::ProbeTrigger touch;
  v1::TouchScan touch_scan;
};

}  // namespace abbe::daemon
