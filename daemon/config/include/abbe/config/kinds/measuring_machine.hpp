#pragma once
/// [cmm]: a measuring machine with an I++ DME server. The daemon uses the touches of the machine,
/// and its positions as axis readings if no other device reads the axes. Pure data.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "abbe/config/motion_box.hpp"

namespace abbe::daemon {

struct Config;
struct ConfigKind;

struct CmmConfig {
  static const ConfigKind kKind;
  std::string name = "cmm";
  std::string host;
  std::uint16_t port = 1294;
  std::string tool;            ///< selected before measuring; empty: the current one
  bool home = false;           ///< abbe may home the machine if it is not homed
  std::uint32_t probe = 1;     ///< probe number in the recorded touches
  double u_position_m = 1e-6;  ///< standard uncertainty of a reported position
  /// True (default): the measuring machine corrects the positions that it reports.
  bool axes_compensated = true;
  std::chrono::nanoseconds command_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds motion_timeout{std::chrono::seconds{120}};
  /// The volume in which the tip may move; nullopt: the travel of X, Y and Z.
  std::optional<MotionBox> volume;
};

/// True if the axis readings are the positions of the measuring machine, because no other device
/// reads the axes.
[[nodiscard]] bool cmm_reads_axes(const Config& config);

}  // namespace abbe::daemon
