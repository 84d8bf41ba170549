#pragma once
/// Reads known errors at given points, with which a received model is compared. Callable from any
/// thread.

#include <array>
#include <filesystem>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"

namespace abbe::daemon {

/// errors.csv, as `abbe model eval` writes it:
///   x_mm,y_mm,z_mm,ex_um,ey_um,ez_um[,ux_um,uy_um,uz_um][,inside]
/// (ex, ey, ez): true position - scale reading, at the scale readings (x, y, z). At least one row.
/// The columns u (standard uncertainty) and inside are not used.
struct KnownErrorsFile {
  InputFile source;
  std::vector<AxisPosition> points_m;
  std::vector<std::array<double, 3>> errors_m;  ///< one per entry of points_m
};
[[nodiscard]] Result<KnownErrorsFile> read_known_errors_csv(const std::filesystem::path& file);

}  // namespace abbe::daemon
