#pragma once
/// The hub's thread: soft real time, with a priority above ordinary programs and below the device
/// threads.

#include <future>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

class HubThread {
 public:
  HubThread() = default;
  HubThread(const HubThread&) = delete;
  HubThread& operator=(const HubThread&) = delete;
  ~HubThread() { end(); }

  /// Starts the thread, which waits for run(). Io if the system refuses its priority or its
  /// processor; the thread then runs without this setting.
  [[nodiscard]] Result<void> start(const DaemonConfig& config);
  /// Runs the hub on the thread. `hub` must exist until end().
  void run(Hub& hub) { hub_.set_value(&hub); }
  /// Waits for the end of the thread, after Hub::stop(). Does nothing if it was not started.
  void end();

 private:
  std::promise<Hub*> hub_;  // the promise is broken if the start of abbed failed
  std::thread thread_;
};

}  // namespace abbe::daemon
