#pragma once
/// Names of the configured devices, and which device delivers which samples of a Batch. Pure data.

#include <string>
#include <vector>

namespace abbe::daemon {

struct DeviceNames {
  std::vector<std::string> all;  ///< RawFromDevice::device is an index into this list
  std::string tracker = "tracker", axes = "encoder", touches = "probe";
  std::vector<std::string> environment;  ///< FromEnvironment::device is an index into it
};

}  // namespace abbe::daemon
