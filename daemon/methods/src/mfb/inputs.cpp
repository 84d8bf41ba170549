#include "abbe/methods/mfb/inputs.hpp"

#include "abbe/config/calibration_machine.hpp"

namespace abbe::daemon {

Result<calib::mfb::MfbMachine> mfb_machine(const MachineConfig& machine) {
  using calib::estimation::Interpolation;
  auto described = otf_machine(machine);
  if (!described) return tl::unexpected(described.error());
  const bool linear = machine.interpolation == Interpolation::Linear;
  return calib::mfb::MfbMachine{described->chain, std::move(described->nodes),
                                linear ? Interpolation::Linear : Interpolation::NotAKnotCubic};
}

}  // namespace abbe::daemon
