#pragma once
/// Writes what was acquired into an MCAP file, so that a power cut, a kill or a full disk costs at
/// most the chunk that was open. NAME.mcap.part while it grows, NAME.mcap once closed cleanly; both
/// are readable.
///
/// Samples are XCDR1 messages of the IDL types (topics abbe/v1/TrackerPoint ..., schema encoding
/// omgidl), dated in UTC = host time + UtcOffset; raw device bytes lie beside them. publish_time is
/// the instant that a message describes, log_time when the hub took it: messages of one log_time
/// are one turn of the hub, which a replay gives again as one. A chunk is closed at chunk_bytes or
/// after chunk_period, written with its indexes by one pwrite and made durable (fdatasync) every
/// sync_period.
///
/// A full or failing disk never stops the caller: record() and tick() cannot fail. The file is cut
/// back to its last whole chunk and closed if there is room for that, messages are counted as lost,
/// status() says why, and when there is room again recording goes on in NAME-2.mcap, NAME-3.mcap
/// ... There the first message of every stream and device says in lost_before how many are missing.
/// Where the disk reported an error (fdatasync, fsync), the file counts as damaged and is called
/// NAME.damaged.mcap: Linux reports an error of write-back once, so a later success proves nothing.
/// The last fault stays in status().last_fault.
///
/// A file that has reached max_file_bytes is closed by the next tick(), flush() or attach(), and
/// recording goes on in the next, too, but never while a calibration is running: its run lies in
/// one file. Nothing is missing in between; calibrations that are over are not asked for again in
/// the next file, nor searches for reference marks.
///
/// Every further file stands for itself: its first messages repeat the last EnvironmentSample of
/// each device (log_time and publish_time: when the file began, content: when it was measured), and
/// its attachments are the datums still in force and which axes were not known (DatumState).
///
/// One thread uses it, in the ordinary world: it allocates and makes blocking system calls.

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
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct RecorderOptions {
  std::filesystem::path directory;
  std::string name;  ///< without extension; neither NAME.mcap nor NAME.mcap.part may exist
  /// at most this much is lost with a chunk, and
  std::size_t chunk_bytes = std::size_t{1024} * 1024;
  std::chrono::nanoseconds chunk_period = std::chrono::milliseconds{500};  ///< at most this long
  std::chrono::nanoseconds sync_period = std::chrono::seconds{1};
  std::chrono::nanoseconds retry_period =
      std::chrono::seconds{5};       ///< after the disk was full or failed
  std::uint64_t min_free_bytes = 0;  ///< the disk counts as full when less than this is free
  std::uint64_t max_file_bytes = 0;  ///< about; 0: one file, however large
};

struct RecorderStatus {
  enum class State : std::uint8_t {
    Recording,
    DiskFull,  ///< messages are lost; tried again every retry_period
    Failed,    ///< another I/O error; tried again likewise
    Closed,
  };
  State state = State::Closed;
  std::string fault;  ///< empty while Recording: "write rec.mcap.part: No space left on device"
  std::string last_fault;      ///< stays when recording goes on, and says in which file that was
  std::uint32_t faults = 0;    ///< how often recording was interrupted
  std::filesystem::path file;  ///< the present (or last) file
  std::uint32_t files = 0;     ///< how many were begun
  std::uint64_t bytes = 0;     ///< written to the present file in whole chunks
  std::uint64_t chunks = 0;    ///< written to all files
  std::uint64_t messages = 0;  ///< in those chunks
  std::uint64_t lost = 0;      ///< messages that were to be recorded and are in no file
  /// messages outside the bounds of the IDL (a device name > 32 characters)
  std::uint64_t refused = 0;
};
/// "recording", "disk full" ...
[[nodiscard]] std::string_view name(RecorderStatus::State state) noexcept;

/// The first `bytes` bytes of `file` have this hash: `head -c BYTES FILE | sha256sum`.
struct RecordingDigest {
  std::string sha256;  ///< hex
  std::uint64_t bytes = 0;
  std::filesystem::path file;
  /// What the recording lacks of the run asked for last: "12 messages of the run are missing".
  /// Empty: nothing.
  std::string gap;
};

class Recorder {
 public:
  /// Wall time even with simulated devices: what a power cut costs does not run at simulated speed.
  using WallTime = std::chrono::steady_clock::time_point;

  /// Creates the file, and the directory if needed. Error (Io): a file of that name exists. A disk
  /// that is full, read-only or failing is not an error: recording begins when it can be written.
  [[nodiscard]] static Result<Recorder> open(RecorderOptions options, RecordingInfo info,
                                             WallTime now);
  ~Recorder();  ///< closes cleanly if close() was not called
  Recorder(Recorder&&) noexcept;
  Recorder& operator=(Recorder&&) noexcept;

  /// `taken`: when the hub had it; none: the instant it describes.
  using Taken = std::optional<protocol::HostTime>;
  void record(const protocol::TrackerPoint& point, std::string_view device, Taken taken = {});
  void record(const protocol::AxisSample& sample, std::string_view device, Taken taken = {});
  void record(const protocol::ProbeTrigger& touch, std::string_view device, Taken taken = {});
  void record(const protocol::TouchScan& scan, std::string_view device, Taken taken = {});
  void record(const protocol::EnvironmentSample& sample, std::string_view device, Taken taken = {});
  void record(protocol::RawBytes bytes, Taken taken = {});
  void record(const v1::CalibrationEvent& event, Taken taken = {});

  /// Written at once, and again into every later file of this recorder, except what was over by
  /// then.
  void attach(RecordingAttachment attachment, protocol::HostTime time);

  /// Call between two turns of the hub, at least every 100 ms: closes the chunk, syncs and retries
  /// when it is time to.
  void tick(WallTime now);

  /// Between two turns of the hub: ends the open chunk now, so that everything recorded so far is
  /// in the file and in digest().
  void flush();

  /// Something went wrong that only a defect or a lack of memory explains: the open chunk is lost,
  /// the file is closed, and recording goes on in the next one after retry_period.
  void fail(const std::string& what);

  /// The hash of everything written to the present file until now.
  [[nodiscard]] RecordingDigest digest() const;

  /// Ends the file: chunk, indexes, footer, fsync, rename, fsync of the directory. The digest is
  /// that of the finished file. Error (Io): it could not be finished and stays NAME.mcap.part,
  /// readable up to its last whole chunk. A file that holds nothing is removed; its digest is
  /// empty.
  Result<RecordingDigest> close();

  [[nodiscard]] const RecorderStatus& status() const noexcept;

 private:
  struct State;
  explicit Recorder(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
