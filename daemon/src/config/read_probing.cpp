#include "config/message_bounds.hpp"
#include "config/readers.hpp"

namespace abbe::daemon {

void read_cmm(Section& root, Config& out) {
  Section cmm = root.child("cmm");
  if (!cmm.present()) return;
  CmmConfig config;
  get_bounded(cmm, "name", config.name, bound_of<v1::ProbeTrigger>("device"));
  cmm.get("host", config.host, Need::Required);
  cmm.get_integer("port", config.port, 1, 65535);
  cmm.get("tool", config.tool);
  cmm.get("home", config.home);
  cmm.get_integer("probe", config.probe, 0, 1'000'000'000);
  cmm.get("u_position_um", config.u_position_m, kMicro, kPositive);
  cmm.get("axes_compensated", config.axes_compensated);
  cmm.get("command_timeout_s", config.command_timeout, kPlain, kPositive);
  cmm.get("motion_timeout_s", config.motion_timeout, kPlain, kPositive);
  cmm.close();
  out.cmm = std::move(config);
}

}  // namespace abbe::daemon
