#pragma once
/// The files of a ball-array calibration, read into SI: touches, errors that were computed elsewhere, and the
/// calibrator. Faults as in input_files.hpp: all at once, with file, line and column, and nothing of a file
/// that has one. Functions, safe from any thread.

#include <filesystem>
#include <vector>

#include "abbe/calib/evemu/observe.hpp"
#include "abbe/daemon/config.hpp"
#include "abbe/daemon/error.hpp"
#include "abbe/daemon/input_files.hpp"

namespace abbe::daemon {

/// touches.csv: `position,kind,index,x_mm,y_mm,z_mm`, kind `ball` or `block`; tip centres.
struct TouchesFile {
  InputFile source;
  std::vector<calib::evemu::Touch> touches;
};
[[nodiscard]] Result<TouchesFile> read_touches_csv(const std::filesystem::path& file);

/// errors.csv: `position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um`: ball centres as read, V there.
struct BallErrorsFile {
  InputFile source;
  std::vector<calib::evemu::BallError> errors;
};
[[nodiscard]] Result<BallErrorsFile> read_errors_csv(const std::filesystem::path& file);

/// calibrator.toml: `[calibrator] name, tip_radius_mm`; `[[ball]] number, x_mm, y_mm, z_mm, radius_mm, u_um`;
/// `[[block]] number, normal, u_urad`.
struct CalibratorFile {
  InputFile source;
  calib::evemu::Calibrator calibrator;
};
[[nodiscard]] Result<CalibratorFile> read_calibrator_toml(const std::filesystem::path& file);

/// The chain and target offset (here: the tip) of a configuration.
[[nodiscard]] Result<calib::evemu::Machine> evemu_machine(const MachineConfig& machine);

}  // namespace abbe::daemon
