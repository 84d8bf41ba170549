#pragma once
/// measured.csv: error motions that a device measured directly, with the columns
/// `name,position_mm,value,unit,run,direction[,x_mm,y_mm,z_mm]`. Faults as in input_files.hpp.

#include <cstddef>
#include <filesystem>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/direct/runs.hpp"

namespace abbe::daemon {

/// The errors, in the order of their first row in the file. A row is a fault if
/// - its unit is not that of the error: um for translations, urad for rotations and squareness,
/// - an error motion has no position or no direction (squareness needs neither),
/// - it repeats the run, direction and position of an earlier row of the same error,
/// - x, y, z are given in part, or differ from those of other rows of the same error; the column of
///   the moving axis has no effect and may be empty; a squareness needs all three or none.
struct MeasuredFile {
  InputFile source;
  std::vector<calib::direct::MeasuredError> errors;
  std::vector<std::vector<std::size_t>> lines;  ///< lines in the file of the readings of each error
};
[[nodiscard]] Result<MeasuredFile> read_measured_csv(const std::filesystem::path& file);

}  // namespace abbe::daemon
