#pragma once
/// Collects the names of the devices in a configuration file, which must be unique: each name is
/// also the name of a stream in Health.

#include <set>
#include <string>

#include "classified_section.hpp"

namespace abbe::daemon {

class StreamNames {
 public:
  /// Adds `name` to the names in use. If another device or a part of the daemon has this name
  /// already, adds a fault at the key `name` of `table` instead.
  void take(const std::string& name, ClassifiedSection& table);

 private:
  std::set<std::string> taken_;
};

}  // namespace abbe::daemon
