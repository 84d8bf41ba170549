#include "running.hpp"

namespace abbe::daemon {

Error error_of(const drivers::Error& error) {
  return {error.code == drivers::ErrorCode::BadConfiguration ? ErrorCode::BadInput : ErrorCode::Io,
          error.text};
}

drivers::DeviceThreadOptions thread_options(const DaemonConfig& config, std::string name,
                                            int priority, std::optional<int> cpu) {
  return {.name = std::move(name),
          .mode = config.realtime,
          .lock_memory = config.realtime == RealTimeMode::Enforce,
          .priority = priority,
          .cpu = cpu};
}

}  // namespace abbe::daemon
