#pragma once
/// Errors known at points, to compare a received model with. A function, safe from any thread.

#include <array>
#include <filesystem>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"

namespace abbe::daemon {

/// errors.csv: `x_mm,y_mm,z_mm,ex_um,ey_um,ez_um[,ux_um,uy_um,uz_um][,inside]` as `abbe model eval`
/// writes it, V = true - reading at scale readings, at least one; u and inside are not used.
struct KnownErrorsFile {
  InputFile source;
  std::vector<AxisPosition> points_m;
  std::vector<std::array<double, 3>> errors_m;  ///< as long as points_m
};
[[nodiscard]] Result<KnownErrorsFile> read_known_errors_csv(const std::filesystem::path& file);

}  // namespace abbe::daemon
