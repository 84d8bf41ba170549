#pragma once
/// Opens a recording, complete or broken, and gives its messages in the order in which the hub took
/// them, those of a topic in the order in which they were recorded: what `abbe replay` stands on.
/// Whatever is damaged is passed over and said in losses(); whole chunks are always given, of a
/// chunk cut off by the end of the file every whole message.
///
/// The file is mapped: views stay valid as long as the reader, and the file must not be shortened
/// meanwhile (a Recorder shortens its own file only after a failed write). Checksums are checked
/// when the file is opened. Const functions may be used by several threads, each with its own
/// cursor.

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

/// What a checksum says of the recorded configuration.
enum class MetadataCheck : std::uint8_t {
  Right,
  Unchecked,  ///< recorded before configurations had a checksum
  Damaged,
};

/// One damage: "cut off at byte 4711, inside a chunk: 12 of its messages could be read".
struct RecordingLoss {
  std::uint64_t offset = 0;  ///< where in the file it begins
  std::uint64_t bytes = 0;   ///< how many bytes of the file are affected
  std::string what;
  /// Something inside is missing or wrong. Not so where only the end is missing, as after a kill or
  /// a power cut, or only an index: what stands there is whole.
  bool inside = true;
};

/// One message as it lies in the file.
struct RecordedMessage {
  std::string_view topic;  ///< "abbe/v1/TrackerPoint"
  // Host times: the file's UTC dates less the recorded offset.
  protocol::HostTime taken;  ///< when the hub took it; the same for all messages of a turn
  /// The instant described; of what a former file handed on: when this one began.
  protocol::HostTime published;
  std::span<const std::byte> payload;  ///< CDR with its encapsulation header
};

/// Who wants what of a recording. What is left empty is not even decoded.
struct RecordingSink {
  std::function<void(const protocol::TrackerPoint&, std::string_view device)> tracker_point;
  std::function<void(const protocol::AxisSample&, std::string_view device)> axis_sample;
  std::function<void(const protocol::EnvironmentSample&, std::string_view device)> environment;
  std::function<void(const protocol::ProbeTrigger&, std::string_view device)> probe_trigger;
  std::function<void(const protocol::TouchScan&, std::string_view device)> touch_scan;
  std::function<void(const protocol::RawBlock&, std::string_view device)> raw_block;
  std::function<void(const v1::CalibrationEvent&)> calibration_event;
};

/// Decodes one message for whoever wants it. False: it is of a wanted topic, but cannot be decoded.
[[nodiscard]] bool deliver(const RecordedMessage& message, const RecordingSink& sink);

class RecordingReader {
 public:
  class Cursor;

  /// Error (Io): cannot be read. Error (BadInput): not a recording of this program (no MCAP magic,
  /// or cut before the end of its metadata).
  [[nodiscard]] static Result<RecordingReader> open(const std::filesystem::path& file);
  ~RecordingReader();
  RecordingReader(RecordingReader&&) noexcept;
  RecordingReader& operator=(RecordingReader&&) noexcept;

  [[nodiscard]] const RecordingInfo& info() const noexcept;
  [[nodiscard]] const std::vector<RecordingAttachment>& attachments() const noexcept;
  /// All metadata records by name, for people.
  [[nodiscard]] const std::map<std::string, std::map<std::string, std::string>>& metadata()
      const noexcept;

  /// Closed by its recorder (whatever happened to it afterwards).
  [[nodiscard]] bool closed_cleanly() const noexcept;
  /// What is missing or was passed over; empty for a whole recording, also for one still open at a
  /// chunk's end.
  [[nodiscard]] std::span<const RecordingLoss> losses() const noexcept;
  /// In one sentence what is damaged inside: "the recording is damaged: chunk 3 ... (and 2 more
  /// places)". A model identified from it may be off by more than its uncertainty. Empty: nothing.
  [[nodiscard]] std::string damage() const;
  [[nodiscard]] MetadataCheck configuration_check() const noexcept;

  [[nodiscard]] std::uint64_t message_count() const noexcept;
  [[nodiscard]] std::uint64_t size_bytes() const noexcept;
  /// When the first and the last message were taken; nothing if there are none.
  [[nodiscard]] std::optional<std::pair<protocol::HostTime, protocol::HostTime>> time_range()
      const noexcept;
  /// SHA-256 of the whole file in hex; reads all of it.
  [[nodiscard]] std::string sha256() const;

  /// All messages by `taken`, those of equal time as they were recorded. None comes before the one
  /// recorded before it in its topic, even if its log_time says so: once that was the instant
  /// described.
  [[nodiscard]] Cursor messages() const;
  /// All messages to the sink. Returns how many wanted ones could not be decoded.
  std::uint64_t read(const RecordingSink& sink) const;

 private:
  struct State;
  explicit RecordingReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Walks the messages once. Must not outlive its reader. Holds the message heads of the chunks
/// around the present time.
class RecordingReader::Cursor {
 public:
  [[nodiscard]] std::optional<RecordedMessage> next();
  /// Share of the messages already given, 0 to 1.
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
