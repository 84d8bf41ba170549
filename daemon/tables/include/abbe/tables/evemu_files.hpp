#pragma once
/// The files of a ball-array calibration, read into SI: touches, errors that were computed
/// elsewhere, and the calibrator. Faults as in input_files.hpp: all at once, with file, line and
/// column, and nothing of a file that has one. Functions, safe from any thread.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/evemu/observe.hpp"
#include "abbe/config/config.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// touches.csv: `position,kind,index,x_mm,y_mm,z_mm`, kind `ball` or `block`; tip centres.
struct TouchesFile {
  InputFile source;
  std::vector<calib::evemu::Touch> touches;
  std::vector<std::size_t> lines;  ///< of the touches in the file
};
[[nodiscard]] Result<TouchesFile> read_touches_csv(const std::filesystem::path& file);

/// errors.csv: `position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um`: ball centres as read, V there.
struct BallErrorsFile {
  InputFile source;
  std::vector<calib::evemu::BallError> errors;
  std::vector<std::size_t> lines;  ///< of the errors in the file
};
[[nodiscard]] Result<BallErrorsFile> read_errors_csv(const std::filesystem::path& file);

/// Where the face of a block is that is to be touched: a square around its centre.
struct BlockFace {
  calib::Vector3 centre_m = calib::Vector3::Zero();
  double half_size_m = 5e-3;
};

/// calibrator.toml, at 20 C: `[calibrator] name, tip_radius_mm, alpha_um_per_m_K,
/// u_alpha_um_per_m_K` (both or none); `[[ball]] number, x_mm, y_mm, z_mm, radius_mm,
/// u_um`; `[[block]] number, normal, u_urad`, and where somebody is to touch it x_mm, y_mm, z_mm,
/// half_size_mm. u: standard uncertainties, 0 if left out.
struct CalibratorFile {
  InputFile source;
  calib::evemu::Calibrator calibrator;
  std::array<std::optional<BlockFace>, 2> faces;  ///< of blocks 1 and 2
};
[[nodiscard]] Result<CalibratorFile> read_calibrator_toml(const std::filesystem::path& file);
/// The same file again; `comment` lines stand at its head, each with its #.
[[nodiscard]] std::string calibrator_toml(const calib::evemu::Calibrator& calibrator,
                                          const std::array<std::optional<BlockFace>, 2>& faces,
                                          std::string_view comment);

/// The chain and target offset (here: the tip) of a configuration.
[[nodiscard]] Result<calib::evemu::Machine> evemu_machine(const MachineConfig& machine);

}  // namespace abbe::daemon
