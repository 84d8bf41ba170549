#include "otf_input_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/camonitor_log.hpp"
#include "abbe/tables/length_unit.hpp"
#include "abbe/tables/point_export.hpp"
#include "argument_checks.hpp"
#include "file_of_program.hpp"

namespace abbe::daemon {
namespace {

std::vector<std::string> missing_for_tracker(const IdentifyOtfArguments& arguments,
                                             const PointExportHeader& header, std::size_t index) {
  std::vector<std::string> missing;
  if (arguments.tracker_unit.empty() && header.unit.empty())
    missing.emplace_back("--tracker-unit mm, m or inch: the unit of the coordinates");
  if (!arguments.tracker_centre_m(index))
    missing.push_back(fmt::format(
        "{}: where the tracker stands in the frame of the points{}, in mm; 0,0,0 in its own frame",
        arguments.centre_option,
        header.frame.empty() ? "" : fmt::format(" ({})", printable_line(header.frame))));
  return missing;
}

Result<TrackerFile> read_exported_tracker(const IdentifyOtfArguments& arguments,
                                          const std::string& file, std::size_t index) {
  const auto text = read_text(file);
  ABBE_TRY(text);
  const auto header = point_export_header(*text);
  if (auto missing = missing_for_tracker(arguments, header, index); !missing.empty())
    return tl::make_unexpected(needs_options(file, "an export of points", std::move(missing)));
  ABBE_TRY(require_word("--tracker-unit", arguments.tracker_unit, {"mm", "m", "inch"}));

  const auto& unit = arguments.tracker_unit.empty() ? header.unit : arguments.tracker_unit;
  const auto points = parse_point_export(*text, file, unit);
  ABBE_TRY(points);
  return tracker_of_export(*points, file, arguments.tracker_points_per_s);
}

/// The names of the PVs of the three axes, from texts such as "X=m1.RBV".
Result<std::array<std::string, 3>> parse_pvs(const std::vector<std::string>& texts) {
  std::array<std::string, 3> pvs;
  for (const std::string& text : texts) {
    const auto axis = std::string_view("XYZ").find(text.empty() ? ' ' : text[0]);
    if (axis == std::string_view::npos || text.size() < 3 || text[1] != '=' || !pvs[axis].empty())
      return fail(
          ErrorCode::Usage,
          fmt::format("--encoder-pv {}: must be X=NAME, Y=NAME or Z=NAME, each once", text));
    pvs[axis] = text.substr(2);
  }
  return pvs;
}

std::vector<std::string> missing_for_log(const IdentifyOtfArguments& arguments,
                                         const std::array<std::string, 3>& pvs,
                                         std::string_view text) {
  constexpr std::size_t kShown = 10;
  std::vector<std::string> missing;
  for (std::size_t a = 0; a < pvs.size(); ++a)
    if (pvs[a].empty())
      missing.push_back(
          fmt::format("--encoder-pv {}=NAME: the process variable of its scale reading", "XYZ"[a]));
  if (!missing.empty())
    missing.push_back(
        "(process variables of this log: " +
        printable_line(fmt::format("{})", fmt::join(pvs_of_log(text, kShown), ", "))));
  if (arguments.encoder_unit.empty())
    missing.emplace_back("--encoder-unit mm, um, m or inch: the unit of the values");
  return missing;
}

Result<EncoderFile> read_log(const IdentifyOtfArguments& arguments) {
  const auto pvs = parse_pvs(arguments.encoder_pvs);
  ABBE_TRY(pvs);
  const auto text = read_text(arguments.encoder);
  ABBE_TRY(text);
  if (auto missing = missing_for_log(arguments, *pvs, *text); !missing.empty())
    return tl::make_unexpected(
        needs_options(arguments.encoder, "a log of camonitor", std::move(missing)));
  ABBE_TRY(require_word("--encoder-unit", arguments.encoder_unit, {"um", "mm", "m", "inch"}));
  return parse_camonitor_log(
      *text, arguments.encoder,
      {.pvs = *pvs, .metres_per_value = metres_per(arguments.encoder_unit).value_or(0.0)});
}

}  // namespace

Result<TrackerFile> read_tracker_points(const IdentifyOtfArguments& arguments,
                                        const std::string& file, std::size_t index,
                                        const ReadProgress& progress) {
  const std::string head = head_of(file);
  const bool stated = !arguments.tracker_unit.empty() || arguments.tracker_points_per_s;
  if (stated && is_own_csv(head))
    return tl::make_unexpected(
        options_without_use(file, "--tracker-unit and --tracker-points-per-s"));
  if (stated || is_point_export(head)) return read_exported_tracker(arguments, file, index);
  return read_tracker_csv(file, progress);
}

Result<EncoderFile> read_scale_readings(const IdentifyOtfArguments& arguments,
                                        const ReadProgress& progress) {
  const std::string head = head_of(arguments.encoder);
  const bool stated = !arguments.encoder_pvs.empty() || !arguments.encoder_unit.empty();
  if (stated && is_own_csv(head))
    return tl::make_unexpected(
        options_without_use(arguments.encoder, "--encoder-pv and --encoder-unit"));
  if (stated || is_camonitor_log(head)) return read_log(arguments);
  return read_encoder_csv(arguments.encoder, progress);
}

}  // namespace abbe::daemon
