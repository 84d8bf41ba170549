#pragma once
/// Writes acquired data to an MCAP file. A power cut, a kill or a full disk loses at most the open
/// chunk. The file is NAME.mcap.part while it is written and NAME.mcap after a clean close; both
/// are readable.
///
/// Samples are XCDR1 messages of the IDL types (topics abbe/v1/TrackerPoint ..., schema encoding
/// omgidl), dated in UTC = host time + UtcOffset. The raw device bytes are recorded in the same
/// file. publish_time is the instant that a message describes, log_time the time at which the hub
/// took it: messages with the same log_time belong to one cycle of the hub, and a replay delivers
/// them in one cycle. A chunk is closed at chunk_bytes or after chunk_period, written with its
/// indexes by one pwrite and made durable (fdatasync) every sync_period.
///
/// A full or failing disk never stops the caller: record() and tick() cannot fail. The file is cut
/// back to its last whole chunk, and closed if there is space for its end. Messages are counted as
/// lost, and status() gives the reason. When there is space again, recording continues in
/// NAME-2.mcap, NAME-3.mcap ... There lost_before of the first message of every stream and device
/// is the number of missing messages.
///
/// After a disk error (fdatasync, fsync) the file counts as damaged and is renamed to
/// NAME.damaged.mcap: Linux reports a write-back error only once, so a later success proves
/// nothing. The last fault stays in status().last_fault.
///
/// A file that has reached max_file_bytes is closed by the next tick(), flush() or attach(), and
/// recording continues in the next file, but never while a calibration is running: a run is always
/// in one file. No message is lost in between. Requests for calibrations that have ended, and for
/// searches for reference marks, are not repeated in the next file.
///
/// Every further file can be replayed without the earlier ones: its first messages repeat the
/// EnvironmentSamples that its instants need, at least the last one of each device (log_time and
/// publish_time: when the file began, content: when it was measured). Its attachments are the state
/// of the checks of the sensors before these, the valid zeros and the list of axes that are not
/// referenced (ZeroState).
///
/// Used by one thread. Not real-time: it allocates and makes blocking system calls.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/messages/cdr.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/sensor_options.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct RecorderOptions {
  std::filesystem::path directory;
  /// file name without extension; neither NAME.mcap nor NAME.mcap.part may exist
  std::string name;
  /// A chunk is closed at this size or age; a failure loses at most one chunk.
  std::size_t chunk_bytes = std::size_t{1024} * 1024;
  std::chrono::nanoseconds chunk_period = std::chrono::milliseconds{500};
  std::chrono::nanoseconds sync_period = std::chrono::seconds{1};
  std::chrono::nanoseconds retry_period =
      std::chrono::seconds{5};       ///< pause after the disk was full or failed
  std::uint64_t min_free_bytes = 0;  ///< the disk counts as full if less than this is free
  std::uint64_t max_file_bytes = 0;  ///< approximate; 0: no limit
  /// Sensors of the live run: a further file begins with the state of their checks.
  SensorCheckOptions sensors;
  std::string weather_station;  ///< name of the tracker whose weather station sends readings
  /// same value as AssemblerOptions::watermark
  std::chrono::nanoseconds watermark = std::chrono::milliseconds{600};
};

struct RecorderStatus {
  enum class State : std::uint8_t {
    Recording,
    DiskFull,  ///< messages are lost; retried every retry_period
    /// another I/O error; messages are lost; retried every retry_period
    Failed,
    Closed,
  };
  State state = State::Closed;
  std::string fault;  ///< empty while Recording: "write rec.mcap.part: No space left on device"
  /// the last interruption of the recording, kept after recording has resumed; then also names the
  /// file in which it resumed
  std::string last_fault;
  std::uint32_t faults = 0;    ///< number of interruptions of the recording
  std::filesystem::path file;  ///< the present (or last) file
  std::uint32_t files = 0;     ///< number of files begun
  std::uint64_t bytes = 0;     ///< written to the present file in whole chunks
  std::uint64_t chunks = 0;    ///< written to all files
  std::uint64_t messages = 0;  ///< messages in these chunks
  std::uint64_t lost = 0;      ///< messages passed to record() that are in no file
  /// messages not recorded because they exceed the bounds of the IDL (a device name > 32
  /// characters)
  std::uint64_t refused = 0;
};
/// The name of the state: "recording", "disk full" ...
[[nodiscard]] std::string_view name(RecorderStatus::State state) noexcept;

/// The hash of the first `bytes` bytes of a file, as of `head -c BYTES FILE | sha256sum`.
struct RecordingDigest {
  std::string sha256;  ///< hex
  std::uint64_t bytes = 0;
  std::filesystem::path file;
  /// The part of the last requested calibration that is not recorded: "12 messages of the run are
  /// missing". Empty: nothing is missing.
  std::string gap;
};

class Recorder {
 public:
  /// Times of the recorder are wall times, even with simulated devices: the data lost by a power
  /// cut depend on real time, not on simulated time.
  using WallTime = std::chrono::steady_clock::time_point;

  /// Creates the file, and the directory if needed. Error (Io) if a file of that name exists. A
  /// disk that is full, read-only or failing is not an error: recording begins once the disk is
  /// writable.
  [[nodiscard]] static Result<Recorder> open(RecorderOptions options, RecordingInfo info,
                                             WallTime now);
  ~Recorder();  ///< closes cleanly if close() was not called
  Recorder(Recorder&&) noexcept;
  Recorder& operator=(Recorder&&) noexcept;

  /// `taken`: the time at which the hub took the sample; nullopt: the same as the instant that the
  /// sample describes.
  using Taken = std::optional<protocol::HostTime>;
  void record(const protocol::TrackerPoint& point, std::string_view device, Taken taken = {});
  void record(const protocol::AxisSample& sample, std::string_view device, Taken taken = {});
  void record(const protocol::ProbeTrigger& touch, std::string_view device, Taken taken = {});
  void record(const protocol::TouchScan& scan, std::string_view device, Taken taken = {});
  void record(const protocol::EnvironmentSample& sample, std::string_view device, Taken taken = {});
  void record(protocol::RawBytes bytes, Taken taken = {});
  void record(const v1::CalibrationEvent& event, Taken taken = {});

  /// Writes the attachment at once, and again into every later file of this recorder; requests for
  /// calibrations and searches that have ended are not repeated.
  void attach(RecordingAttachment attachment, protocol::HostTime time);

  /// Closes the chunk, syncs the file and retries after a fault, each when it is due. Call it
  /// between two cycles of the hub, at least every 100 ms.
  void tick(WallTime now);

  /// Closes the open chunk now, so that everything recorded so far is in the file and in digest().
  /// Call it between two cycles of the hub.
  void flush();

  /// Reports an internal error or a lack of memory: the open chunk is lost, the file is closed, and
  /// recording continues in the next file after retry_period.
  void fail(const std::string& what);

  /// Time at which the oldest message of the open chunk was recorded; nullopt: no chunk is open,
  /// all messages are written or lost.
  [[nodiscard]] std::optional<WallTime> open_chunk_since() const;

  /// The hash of everything written to the present file so far.
  [[nodiscard]] RecordingDigest digest() const;

  /// Ends the file: chunk, indexes, footer, fsync, rename, fsync of the directory. Returns the
  /// digest of the finished file. Error (Io): the file could not be finished; it remains
  /// NAME.mcap.part, readable up to its last whole chunk. An empty file is removed; its digest is
  /// empty.
  Result<RecordingDigest> close();

  [[nodiscard]] const RecorderStatus& status() const noexcept;

 private:
  struct State;
  explicit Recorder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
