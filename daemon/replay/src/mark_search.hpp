#pragma once
/// The search for the reference marks once more, from the raw bytes of both cards in a recording:
/// it begins when the live run was asked to (of a turn's bytes at once, which the live run may have
/// had a turn later), and what it finds stands beside what the live run found. One thread.

#include <optional>
#include <vector>

#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/reference_session.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/replay/replay.hpp"

namespace abbe::daemon {

class MarkSearch {
 public:
  /// BadInput: the recording's own requests cannot be read. Without [reference] it finds nothing.
  [[nodiscard]] static Result<MarkSearch> of(const RecordingReader& recording,
                                             const Config& config);

  /// Before anybody gives the samples their datum.
  void take(const Batch& batch);

  /// Beside what the live run found, in its order.
  [[nodiscard]] std::vector<ReplayedDatum> compared(const RecordingReader& recording) const;

 private:
  struct Axis {
    bool found = false;
    std::vector<double> readings;  ///< at count 0, one each time the marks were found
  };

  explicit MarkSearch(const Config& config);
  template <class Sample>
  void take(const Sample& sample, protocol::HostTime time);
  void begin();
  void note(std::size_t axis);

  const Config* config_;
  ReferenceOptions options_;
  std::vector<Axis> axes_;
  std::vector<protocol::HostTime> requests_;
  std::size_t next_ = 0;
  std::optional<ReferenceSession> session_;
};

}  // namespace abbe::daemon
