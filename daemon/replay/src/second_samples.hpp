#pragma once
/// Combines axis samples of the same instant in recordings without kAxisSamplesRule. In those
/// versions of abbe, a second answer of an encoder to one SYNC was recorded as a second sample of
/// the same instant that marks the axis as missing. The pipeline expects one sample for each
/// instant, so the two are combined and delivered in the cycle of the first.

#include <cstddef>
#include <map>
#include <optional>

#include "abbe/pipeline/batch.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon {

class SecondSamples {
 public:
  /// `recording` must outlive this object.
  explicit SecondSamples(const RecordingReader& recording);
  SecondSamples(const SecondSamples&) = delete;
  SecondSamples& operator=(const SecondSamples&) = delete;

  /// Call once for every cycle, in order.
  void combine(Batch& batch);

 private:
  struct Combined {
    protocol::AxisSample sample;
    std::size_t left = 0;  ///< samples of this instant that were not replayed yet
    bool replayed = false;
  };

  void take(const protocol::AxisSample& sample);

  RecordingReader::Cursor ahead_;
  std::optional<RecordedMessage> next_;
  RecordingSink sink_;
  std::optional<protocol::AxisSample> latest_;
  std::map<protocol::HostTime, Combined> combined_;  ///< instants with more than one sample
};

}  // namespace abbe::daemon
