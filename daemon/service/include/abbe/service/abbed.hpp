#pragma once
/// The daemon put together: devices, recorder, hub, calibration, publisher and control API, from
/// one configuration. Nothing here but the wiring and the order of starting and stopping.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::daemon {

/// How abbed was started.
struct AbbedOptions {
  std::string configuration_text;  ///< the file as it was read; goes into the recording
  std::string dds_program;         ///< abbe-dds, started as a child if the configuration says so
};

class Abbed {
 public:
  /// Takes up everything or nothing. Io for what the system refuses (socket, directory, real-time
  /// priority).
  [[nodiscard]] static Result<std::unique_ptr<Abbed>> start(Config config, AbbedOptions options);
  Abbed(const Abbed&) = delete;
  Abbed& operator=(const Abbed&) = delete;
  /// Stops in the reverse order; the recording is closed cleanly.
  ~Abbed();

  /// Call at least every 50 ms from the thread that started it: supervises abbe-dds.
  void cycle();
  /// The hub has turned within the last second: what the watchdog may be told.
  [[nodiscard]] bool alive() const;
  /// What is worth a line in the log at start.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  struct State;
  explicit Abbed(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
