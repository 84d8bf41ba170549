#pragma once
/// Touches by the measuring machine of the running daemon: requests them and follows their
/// progress. The machine must not move unsupervised. Therefore this program cancels the touching
/// after a signal or when the daemon does not answer. The daemon itself cancels the touching if no
/// client requests the progress for 2 s.

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/geometry/machine_touches.hpp"

namespace abbe::daemon {

/// The touches that were made; `reason` is empty if all of them were.
struct TouchesMade {
  std::vector<calib::Vector3> places_m;  ///< as the machine reports them, in their order
  double u_position_m = 0.0;
  std::string reason;
  /// Of `reason`: DataInsufficient, or that the machine is not confirmed to be stopped.
  ErrorCode code = ErrorCode::DataInsufficient;
};

/// The position of the machine's tip, m. Refused: no machine, or the machine is not ready.
[[nodiscard]] Result<calib::Vector3> machine_position(const std::filesystem::path& socket);

/// Returns when all touches are made, or a touch was refused, or the touching was cancelled
/// (SIGINT, SIGTERM, SIGHUP, SIGQUIT), or the daemon did not answer for 5 s. An error: the touching
/// was not started.
[[nodiscard]] Result<TouchesMade> make_touches(const std::filesystem::path& socket,
                                               const calib::MachineTouches& touches);

}  // namespace abbe::daemon
