#include "verification_input.hpp"

#include <fmt/format.h>

#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/point_export.hpp"
#include "argument_checks.hpp"
#include "file_of_program.hpp"

namespace abbe::daemon {
namespace {

std::vector<std::string> missing_for_points(const VerifyArguments& arguments,
                                            const PointExportHeader& header) {
  std::vector<std::string> missing;
  if (arguments.readings.empty())
    missing.emplace_back(
        "--readings FILE: name,x_mm,y_mm,z_mm, the scale readings at which each point was "
        "measured");
  if (arguments.points_unit.empty() && header.unit.empty())
    missing.emplace_back("--points-unit mm, m or inch: the unit of the coordinates");
  if (!arguments.frame_stated)
    missing.push_back(fmt::format(
        "--frame fit, if the axes of the frame{} have any direction; --frame machine, if they are "
        "those of the machine",
        header.frame.empty() ? "" : fmt::format(" ({})", printable_line(header.frame))));
  return missing;
}

Result<VerificationFile> read_exported(const VerifyArguments& arguments) {
  const auto text = read_text(arguments.points);
  ABBE_TRY(text);
  const auto header = point_export_header(*text);
  if (auto missing = missing_for_points(arguments, header); !missing.empty())
    return tl::make_unexpected(
        needs_options(arguments.points, "an export of points", std::move(missing)));
  ABBE_TRY(require_word("--points-unit", arguments.points_unit, {"mm", "m", "inch"}));

  const auto& unit = arguments.points_unit.empty() ? header.unit : arguments.points_unit;
  const auto points = parse_point_export(*text, arguments.points, unit);
  ABBE_TRY(points);
  return verification_of_export(*points, arguments.points, arguments.readings);
}

}  // namespace

Result<VerificationFile> read_verification(const VerifyArguments& arguments) {
  const std::string head = head_of(arguments.points);
  const bool stated = !arguments.readings.empty() || !arguments.points_unit.empty();
  if (stated && is_own_csv(head))
    return tl::make_unexpected(
        options_without_use(arguments.points, "--readings and --points-unit"));
  if (stated || is_point_export(head)) return read_exported(arguments);
  return read_verification_csv(arguments.points);
}

}  // namespace abbe::daemon
