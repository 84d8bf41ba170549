#pragma once
/// Where the hub's samples come from: the devices, or what a test puts in their place. The hub's thread only.

#include <vector>

#include "abbe/daemon/batch.hpp"
#include "abbe/daemon/publisher.hpp"

namespace abbe::daemon {

class SampleSource {
 public:
  SampleSource() = default;
  virtual ~SampleSource() = default;

  /// Appends everything that came since the last call to `batch`.
  virtual void drain(Batch& batch) = 0;
  /// Rates are those since the previous call.
  [[nodiscard]] virtual std::vector<StreamHealth> health(protocol::HostTime now) = 0;

 protected:
  SampleSource(const SampleSource&) = default;
  SampleSource& operator=(const SampleSource&) = default;
  SampleSource(SampleSource&&) = default;
  SampleSource& operator=(SampleSource&&) = default;
};

}  // namespace abbe::daemon
