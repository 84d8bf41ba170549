#pragma once
/// The axis samples of a recording that lacks kAxisSamplesRule. In those versions a second answer
/// of an encoder was recorded as a second sample of the same instant, with that axis missing. The
/// pipeline expects one sample for each instant: both are combined in the cycle of the first one.

#include <cstddef>
#include <map>
#include <optional>

#include "abbe/pipeline/batch.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon {

class SecondSamples {
 public:
  /// `recording` must outlive it.
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
