#pragma once
/// Touches by the measuring machine of the running daemon: requests them and follows their
/// progress. The machine must not move unsupervised. Therefore this program cancels the touching
/// after a signal, or if the daemon does not answer. The daemon itself cancels the touching if no
/// client requests the progress for 2 s.

#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/geometry/machine_touches.hpp"

namespace abbe::daemon {

/// The touches that were made; `reason` is empty if all requested touches were made.
struct TouchesMade {
  /// positions as the machine reports them, in the order of the touches
  std::vector<calib::Vector3> places_m;
  double u_position_m = 0.0;
  std::string reason;
  /// Error code that belongs to `reason`: DataInsufficient, or that the stop of the machine is not
  /// confirmed.
  ErrorCode code = ErrorCode::DataInsufficient;
};

/// The position of the machine's tip, m. Refused: no machine, or the machine is not ready.
[[nodiscard]] Result<calib::Vector3> machine_position(const std::filesystem::path& socket);

/// Returns when all touches are made, or a touch was refused, or the touching was cancelled
/// (SIGINT, SIGTERM, SIGHUP, SIGQUIT), or the daemon did not answer for 5 s. Returns an Error if
/// the touching was not started.
[[nodiscard]] Result<TouchesMade> make_touches(const std::filesystem::path& socket,
                                               const calib::MachineTouches& touches);

}  // namespace abbe::daemon
