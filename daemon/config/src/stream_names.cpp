#include "stream_names.hpp"

#include <fmt/format.h>

namespace abbe::daemon {

void StreamNames::take(const std::string& name, ClassifiedSection& table) {
  static const std::set<std::string> kOwn{"recorder", "models", "dds", "dds_security", "identity"};
  if (name.empty()) return;
  if (kOwn.contains(name))
    table.fault("name", fmt::format("\"{}\" is reserved for a part of the daemon", name));
  else if (!taken_.insert(name).second)
    table.fault("name", fmt::format("two devices are called \"{}\"", name));
}

}  // namespace abbe::daemon
