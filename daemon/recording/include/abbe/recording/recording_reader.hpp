#pragma once
/// Opens a recording, complete or damaged, and delivers its messages in the order in which the hub
/// took them; messages of one topic keep the order in which they were recorded. Used by `abbe
/// replay`. Damaged parts are skipped and listed in losses(). All messages of undamaged chunks are
/// delivered, and all whole messages of a chunk that is truncated by the end of the file.
///
/// Reads every file that MCAP allows, except files with compressed chunks. Files rewritten by
/// another program can be read as well: with or without indexes, summary, repeated channels,
/// chunks.
///
/// The file is read piece by piece. If it becomes shorter meanwhile, cursors end early and intact()
/// is an Error. Checksums are checked when the file is opened. Const functions may be used by
/// several threads, each with its own cursor.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/messages/cdr.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Result of the checksum test of the recorded configuration.
enum class MetadataCheck : std::uint8_t {
  Right,
  Unchecked,  ///< the recording has no checksum, because an older version of abbe made it
  Damaged,
};

/// A damaged part: "cut off at byte 4711, inside a chunk: 12 of its messages could be read".
struct RecordingLoss {
  std::uint64_t offset = 0;  ///< position of the damaged part in the file
  std::uint64_t bytes = 0;   ///< length of the damaged part
  std::string what;
  /// True if data within the recording are missing or wrong. False if only the end is missing, as
  /// after a kill or a power cut, or only an index is damaged; all other data are then undamaged.
  bool inside = true;
};

/// One message of the file.
struct RecordedMessage {
  std::string_view topic;  ///< "abbe/v1/TrackerPoint"
  // Host times of the message, computed as the UTC dates in the file minus the recorded offset.
  /// time at which the hub took it; the same for all messages of a cycle
  protocol::HostTime taken;
  /// The instant that the message describes; for a message repeated from the previous file, the
  /// beginning of this file.
  protocol::HostTime published;
  std::span<const std::byte> payload;  ///< CDR with its encapsulation header, see Cursor::next()
};

/// Callbacks for the messages of a recording, by type. Messages without a callback are not decoded.
struct RecordingSink {
  std::function<void(const protocol::TrackerPoint&, std::string_view device)> tracker_point;
  std::function<void(const protocol::AxisSample&, std::string_view device)> axis_sample;
  std::function<void(const protocol::EnvironmentSample&, std::string_view device)> environment;
  std::function<void(const protocol::ProbeTrigger&, std::string_view device)> probe_trigger;
  std::function<void(const protocol::TouchScan&, std::string_view device)> touch_scan;
  std::function<void(const protocol::RawBlock&, std::string_view device)> raw_block;
  std::function<void(const v1::CalibrationEvent&)> calibration_event;
};

/// Decodes a message and calls the callback for its type. False if there is such a callback, but
/// the message cannot be decoded.
[[nodiscard]] bool deliver(const RecordedMessage& message, const RecordingSink& sink);

class RecordingReader {
 public:
  class Cursor;

  /// Opens the file. Error (Io) if it cannot be read; Error (BadInput) if it is not a recording of
  /// abbe (no MCAP magic, or truncated before the end of its metadata). The whole file is read.
  /// Meanwhile `stopped`, which may be empty, is called on this thread. If it returns true, open()
  /// soon returns DataInsufficient; from then on `stopped` must always return true.
  [[nodiscard]] static Result<RecordingReader> open(const std::filesystem::path& file,
                                                    const std::function<bool()>& stopped = {});
  ~RecordingReader();
  RecordingReader(RecordingReader&&) noexcept;
  RecordingReader& operator=(RecordingReader&&) noexcept;

  [[nodiscard]] const RecordingInfo& info() const noexcept;
  [[nodiscard]] const std::vector<RecordingAttachment>& attachments() const noexcept;
  /// All metadata records by name, for display.
  [[nodiscard]] const std::map<std::string, std::map<std::string, std::string>>& metadata()
      const noexcept;

  /// True if the recorder closed the file, even if the file was damaged afterwards.
  [[nodiscard]] bool closed_cleanly() const noexcept;
  /// The parts that are missing or were skipped. Empty for a complete recording, and for a
  /// recording that is still being written and ends with a whole chunk.
  [[nodiscard]] std::span<const RecordingLoss> losses() const noexcept;
  /// The damage within the recording in one sentence: "the recording is damaged: chunk 3 ... (and 2
  /// more places)". A model identified from such a recording may be wrong by more than its
  /// uncertainty. Empty: there is no damage within the recording.
  [[nodiscard]] std::string damage() const;
  [[nodiscard]] MetadataCheck configuration_check() const noexcept;

  [[nodiscard]] std::uint64_t message_count() const noexcept;
  /// Times at which the hub took the first and the last message; nullopt if there are no messages.
  [[nodiscard]] std::optional<std::pair<protocol::HostTime, protocol::HostTime>> time_range()
      const noexcept;
  /// Error (Io) if the file became shorter, changed, or could not be read since it was opened. The
  /// messages read before are then incomplete. Call it after the last message.
  [[nodiscard]] Result<void> intact() const;
  /// SHA-256 of the whole file in hex; reads all of it.
  [[nodiscard]] std::string sha256() const;

  /// All messages in the order of `taken`; messages with equal `taken` in the order in which they
  /// were recorded. Messages of one topic always keep the order of recording: in older recordings
  /// log_time is the described instant and need not ascend.
  [[nodiscard]] Cursor messages() const;
  /// Delivers all messages to the sink. Returns the number of messages that have a callback and
  /// could not be decoded.
  std::uint64_t read(const RecordingSink& sink) const;

 private:
  struct State;
  explicit RecordingReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Iterates over the messages once. Must not outlive its reader. Keeps the message heads of the
/// chunks near the current time.
class RecordingReader::Cursor {
 public:
  /// nullopt after the last message, or if the file cannot be read any more: see intact(). The
  /// payload is valid until the next call.
  [[nodiscard]] std::optional<RecordedMessage> next();
  /// Fraction of the messages already delivered, 0 to 1.
  [[nodiscard]] double progress() const noexcept;
  ~Cursor();
  Cursor(Cursor&&) noexcept;
  Cursor& operator=(Cursor&&) noexcept;

 private:
  friend class RecordingReader;
  struct State;
  explicit Cursor(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
