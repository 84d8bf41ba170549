#pragma once
/// Names of the devices in a configuration file. Each is also the name of a stream in Health.

#include <set>
#include <string>

#include "abbe/config/section.hpp"

namespace abbe::daemon {

class StreamNames {
 public:
  /// Adds a fault at the key `name` of the device's table if another device, or a part of the
  /// daemon, has this name.
  void take(const std::string& name, Section& table);

 private:
  std::set<std::string> taken_;
};

}  // namespace abbe::daemon
