#pragma once
/// The part of `abbe calibrate artefact` that moves the machine: asks the running daemon for the
/// touches of a plan and looks on. A machine that nobody watches any more must not go on moving:
/// whatever ends the looking on (a signal, a daemon that does not answer) ends the touching, and
/// the daemon ends it by itself when nobody asks for 2 s.

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/evemu/artefact_touches.hpp"

namespace abbe::daemon {

/// What the machine made of the plan; `reason` is empty when it made all of it.
struct Touched {
  std::vector<calib::evemu::Touch> touches;
  double u_position_m = 0.0;
  std::string reason;
};

/// Where the machine stands. Refused: no [cmm], or a machine that is not ready.
[[nodiscard]] Result<calib::Vector3> machine_position(const std::filesystem::path& socket);

/// Returns when it is over: all touched, refused, cancelled (SIGINT, SIGTERM, SIGHUP, SIGQUIT), or
/// the daemon did not answer for 5 s. An error: nothing was begun.
[[nodiscard]] Result<Touched> touch_artefact(const std::filesystem::path& socket,
                                             const calib::evemu::ArtefactPlan& plan);

}  // namespace abbe::daemon
