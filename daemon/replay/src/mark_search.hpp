#pragma once
/// Repeats the search for the reference marks from the raw bytes of both cards in a recording, and
/// compares the result with that of the live run. The search starts at the time of the live
/// request; it may get the samples of a cycle one cycle earlier than the live run did. One thread.

#include <optional>
#include <vector>

#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/reference_session.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/replay/replay.hpp"

namespace abbe::daemon {

class MarkSearch {
 public:
  /// Reads the requests for searches from the recording. BadInput if they cannot be read. If
  /// `config` has no reference marks, take() does nothing.
  [[nodiscard]] static Result<MarkSearch> of(const RecordingReader& recording,
                                             const Config& config);

  /// Call it before the zero is applied to the samples, because the search uses them as the
  /// devices delivered them.
  void take(const Batch& batch);

  /// The zeros that the live run found, in the same order, each with the value that the replay
  /// found.
  [[nodiscard]] std::vector<ReplayedZero> compared(const RecordingReader& recording) const;

 private:
  struct Axis {
    bool found = false;
    std::vector<double> readings;  ///< readings at count 0, one for each time the marks were found
  };

  explicit MarkSearch(const Config& config);
  template <class Sample>
  void take(const Sample& sample, protocol::HostTime time);
  void begin();
  void note(std::size_t axis);

  const ReferenceMarks* marks_;
  ReferenceOptions options_;
  std::vector<Axis> axes_;
  std::vector<protocol::HostTime> requests_;
  std::size_t next_ = 0;
  std::optional<ReferenceSession> session_;
};

}  // namespace abbe::daemon
