#include "abbe/base/known_errors.hpp"

#include <cstddef>

#include "abbe/base/parsed_table.hpp"
#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

Result<KnownErrorsFile> read_known_errors_csv(const std::filesystem::path& file) {
  auto parsed = parse_table(file, {{{"x_mm"},
                                    {"y_mm"},
                                    {"z_mm"},
                                    {"ex_um"},
                                    {"ey_um"},
                                    {"ez_um"},
                                    {"ux_um", false},
                                    {"uy_um", false},
                                    {"uz_um", false},
                                    {"inside", false}}});
  ABBE_TRY(parsed);
  check_rows(*parsed, 1, "points");
  if (parsed->faults.any()) return tl::make_unexpected(parsed->faults.to_error());
  KnownErrorsFile errors{parsed->source, {}, {}};
  const auto& table = parsed->table;

  for (std::size_t row = 0; row < table.rows(); ++row) {
    errors.points_m.push_back(
        {table.at(row, 0) / kMmPerM, table.at(row, 1) / kMmPerM, table.at(row, 2) / kMmPerM});
    errors.errors_m.push_back(
        {table.at(row, 3) / kUmPerM, table.at(row, 4) / kUmPerM, table.at(row, 5) / kUmPerM});
  }

  return errors;
}

}  // namespace abbe::daemon
