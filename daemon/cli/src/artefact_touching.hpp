#pragma once
/// The part of `abbe calibrate artefact` that moves the machine: requests the touches of a plan
/// from the running daemon and follows their progress. The machine must not move unsupervised.
/// Therefore this program cancels the touching after a signal or when the daemon does not answer.
/// The daemon itself cancels the touching if no client requests the progress for 2 s.

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/evemu/artefact_touches.hpp"

namespace abbe::daemon {

/// The touches that were made; `reason` is empty if the whole plan was executed.
struct Touched {
  std::vector<calib::evemu::Touch> touches;
  double u_position_m = 0.0;
  std::string reason;
};

/// The position of the machine's tip, m. Refused: no machine, or the machine is not ready.
[[nodiscard]] Result<calib::Vector3> machine_position(const std::filesystem::path& socket);

/// Returns when the plan is complete, or a touch was refused, or the touching was cancelled
/// (SIGINT, SIGTERM, SIGHUP, SIGQUIT), or the daemon did not answer for 5 s. An error: the touching
/// was not started.
[[nodiscard]] Result<Touched> touch_artefact(const std::filesystem::path& socket,
                                             const calib::evemu::ArtefactPlan& plan);

}  // namespace abbe::daemon
