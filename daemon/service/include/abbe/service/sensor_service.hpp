#pragma once
/// Takes the statement of a person that a sensor is correct, records it, and passes it to the next
/// cycle of the hub. Used by the hub's thread.

#include <string>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/pipeline/live_view.hpp"
#include "abbe/pipeline/sensor_acceptance.hpp"
#include "abbe/recording/recorder_thread.hpp"

namespace abbe::daemon {

class SensorService {
 public:
  explicit SensorService(RecorderThread* recorder) : recorder_(recorder) {}

  /// `acquiring`: a calibration takes readings. The sensor must not be accepted meanwhile, because
  /// its values would change. Usage or Refused with the reason.
  [[nodiscard]] Result<void> accept(const LiveView& live, SensorAcceptance acceptance,
                                    bool acquiring);
  /// The statements since the last call.
  [[nodiscard]] std::vector<SensorAcceptance> take() { return std::exchange(accepted_, {}); }

 private:
  RecorderThread* recorder_;
  std::vector<SensorAcceptance> accepted_;
};

}  // namespace abbe::daemon
