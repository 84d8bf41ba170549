#pragma once
/// Builds the daemon from one configuration: devices, recorder, hub, calibration, publisher and
/// control API. Contains only the connections between them and the order of start and stop.

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/ippdme/session.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::daemon {

/// Circumstances of the start of abbed.
struct AbbedOptions {
  std::string configuration_text;  ///< text of the configuration file; stored in the recording
  std::string dds_program;  ///< path of abbe-dds; started as a child if dds.supervise is Child
  WallClock clock{};        ///< source of all dates
  /// true: systemd runs abbe-dds, unless the configuration states otherwise
  bool dds_unit = false;
};

class Abbed {
 public:
  /// Starts all parts. If an error occurs, all parts that were started are ended again. Io if the
  /// system refuses something (socket, directory, real-time priority).
  [[nodiscard]] static Result<std::unique_ptr<Abbed>> start(Config config, AbbedOptions options);
  Abbed(const Abbed&) = delete;
  Abbed& operator=(const Abbed&) = delete;
  /// Calls end() and closes the recording.
  ~Abbed();

  /// Stops the measuring machine, then ends the other parts. Returns whether the machine is
  /// stopped; nullopt: there is none. No other function may be called afterwards.
  std::optional<drivers::IppStop> end();

  /// Call at least every 50 ms from the thread that called start(). Supervises abbe-dds, removes
  /// old recordings in the background and logs which recordings of a killed daemon were closed.
  void cycle();
  /// True if the hub began a cycle within the last second. If false, the caller must not notify
  /// systemd's watchdog, which then restarts abbed.
  [[nodiscard]] bool alive() const;
  /// Stops a measuring machine that moves; the machine then waits for a release. Takes no lock.
  /// Call it when the hub is not alive, because the hub can then no longer stop the machine when no
  /// client supervises it.
  void stop_machine();
  /// Warnings that occurred during the start, one log line each.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  struct State;
  explicit Abbed(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
