#pragma once
/// The writer of each format, and functions that they share.

#include "abbe/exports/write_export.hpp"

namespace abbe::daemon {

using ExportFiles = std::vector<ExportFile>;

[[nodiscard]] ExportFiles write_isg_csv(const calib::HeldTables&, const WriteOptions&);
[[nodiscard]] ExportFiles write_etalon(const calib::HeldTables&, const WriteOptions&);
[[nodiscard]] ExportFiles write_linuxcnc(const calib::HeldTables&);
[[nodiscard]] ExportFiles write_siemens_cec(const calib::HeldTables&, const WriteOptions&);
[[nodiscard]] ExportFiles write_siemens_lec(const calib::HeldTables&, const WriteOptions&);
[[nodiscard]] ExportFiles write_heidenhain(const calib::HeldTables&, const WriteOptions&);
[[nodiscard]] ExportFiles write_csv_grid(const calib::HeldGrid&, const WriteOptions&);

/// A length in mm, rounded to 1e-9 mm, without "-0".
[[nodiscard]] std::string fixed_mm(double value_m);
/// The correction at node i of a table in the unit of the file: mm, or rad to 1e-12 rad.
/// `direction`: +1, -1, or 0 for the mean.
[[nodiscard]] std::string file_value(const calib::HeldTable&, std::size_t i, int positive_moves,
                                     int direction = 0);
/// The origin as comment lines, each after `mark`.
[[nodiscard]] std::string origin_comment(const ExportOrigin&, std::string_view mark,
                                         std::string_view sign);
/// The origin in one line, without a mark.
[[nodiscard]] std::string origin_in_one_line(const ExportOrigin&, std::string_view sign);
/// The sign of the file as a sentence.
[[nodiscard]] std::string sign_text(int positive_moves);

}  // namespace abbe::daemon
