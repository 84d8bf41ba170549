#pragma once
/// Reads the files of a ball-array calibration and converts to SI: touches, errors that another
/// program computed, and the calibrator. Faults as in input_files.hpp: all at once, with file, line
/// and column; a file with a fault is not used at all. The functions may be called from any thread.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/config/config.hpp"
#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// touches.csv: `position,kind,index,x_mm,y_mm,z_mm`, kind `ball` or `block`; x, y, z: centre of
/// the probe tip.
struct TouchesFile {
  InputFile source;
  std::vector<calib::evemu::Touch> touches;
  std::vector<std::size_t> lines;  ///< line in the file, one per touch
};
[[nodiscard]] Result<TouchesFile> read_touches_csv(const std::filesystem::path& file);

/// errors.csv: `position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um`: ball centre in scale readings, and
/// the error V there.
struct BallErrorsFile {
  InputFile source;
  std::vector<calib::evemu::BallError> errors;
  std::vector<std::size_t> lines;  ///< line in the file, one per error
};
[[nodiscard]] Result<BallErrorsFile> read_errors_csv(const std::filesystem::path& file);
/// Same as read_errors_csv() for the content of a file; `file` is its name in messages.
[[nodiscard]] Result<BallErrorsFile> parse_errors_csv(std::string_view text,
                                                      const std::filesystem::path& file);

/// The square face of a gauge block that is touched, with this centre.
struct BlockFace {
  calib::Vector3 centre_m = calib::Vector3::Zero();
  double half_size_m = 5e-3;
};

/// calibrator.toml, values at 20 C:
///
///   [calibrator]  name, tip_radius_mm, alpha_um_per_m_K and u_alpha_um_per_m_K (both or neither)
///   [[ball]]      number, x_mm, y_mm, z_mm, radius_mm, u_um
///   [[block]]     number, normal, u_urad; face to touch: x_mm, y_mm, z_mm, half_size_mm
///
/// u: standard uncertainties, default 0.
struct CalibratorFile {
  InputFile source;
  calib::evemu::Calibrator calibrator;
  std::array<std::optional<BlockFace>, 2> faces;  ///< the faces of blocks 1 and 2
};
[[nodiscard]] Result<CalibratorFile> read_calibrator_toml(const std::filesystem::path& file);
/// Same as read_calibrator_toml() for the content of a file; `file` is its name in messages.
[[nodiscard]] Result<CalibratorFile> parse_calibrator_toml(std::string_view text,
                                                           const std::filesystem::path& file);
/// The text of a calibrator.toml. It begins with `comment`; each line of `comment` must begin with
/// #.
[[nodiscard]] std::string calibrator_toml(const calib::evemu::Calibrator& calibrator,
                                          const std::array<std::optional<BlockFace>, 2>& faces,
                                          std::string_view comment);

/// The kinematic chain and the target offset of a configuration as input of calib. For a ball array
/// the target is the probe tip.
[[nodiscard]] Result<calib::evemu::Machine> evemu_machine(const MachineConfig& machine);

}  // namespace abbe::daemon
