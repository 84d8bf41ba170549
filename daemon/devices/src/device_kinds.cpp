#include <vector>

#include "kinds.hpp"

namespace abbe::daemon {

std::span<const DeviceKind> device_kinds() {
  static const auto kinds = all_kinds();
  return kinds;
}

DeviceNames device_names(const Config& config) {
  DeviceNames names;
  for (const DeviceKind& kind : device_kinds()) kind.name(config, names);
  return names;
}

std::vector<std::string> RunningDevices::warnings() const {
  std::vector<std::string> out;
  for (const drivers::DeviceThread* const thread : threads()) {
    out.insert(out.end(), thread->warnings().begin(), thread->warnings().end());
  }

  return out;
}

}  // namespace abbe::daemon
