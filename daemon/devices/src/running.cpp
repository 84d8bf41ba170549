#include "running.hpp"

namespace abbe::daemon {

Error error_of(const drivers::Error& error) {
  return {error.code == drivers::ErrorCode::BadConfiguration ? ErrorCode::BadInput : ErrorCode::Io,
          error.text};
}

drivers::DeviceThreadOptions thread_options(const DaemonConfig& config, std::string name,
                                            int priority, std::optional<int> cpu) {
  const bool enforce = config.realtime == RealTimeMode::Enforce;
  return {.name = std::move(name),
          .mode = enforce ? drivers::RealTimeMode::Enforce : drivers::RealTimeMode::Ignore,
          .lock_memory = enforce,
          .priority = priority,
          .cpu = cpu};
}

}  // namespace abbe::daemon
