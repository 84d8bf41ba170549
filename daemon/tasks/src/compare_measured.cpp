#include "abbe/tasks/compare_measured.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/direct/readings_off.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "measured_input.hpp"

namespace abbe::daemon {
namespace {

namespace direct = calib::direct;

direct::CompareOptions compare_options(const MeasuredOptions& options) {
  return {.line = options.straightness == "least-squares" ? direct::StraightnessLine::LeastSquares
                                                          : direct::StraightnessLine::EndPoints,
          .device = {.u_m = options.u_um / kUmPerM,
                     .u_rad = options.u_urad / kUradPerRad,
                     .u_scale = options.u_ppm / kUmPerM}};
}

/// One line for each single value that does not fit the other values of its error.
std::vector<std::string> lines_of_rows_off(const std::string& name, const MeasuredFile& file) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < file.errors.size(); ++i) {
    const auto& error = file.errors[i];
    const auto motion = calib::error_motion(error.name);
    const bool is_angle = !motion || calib::is_rotation(motion->motion);
    for (const auto& [reading, distance] : direct::readings_off(error))
      lines.push_back(fmt::format(
          "{}:{}: {} alone does not fit: {:.4g} {} off the line through its neighbours, compared "
          "with the other runs: correct or delete it",
          name, file.lines[i][reading], error.name, kUmPerM * distance, is_angle ? "urad" : "um"));
  }
  return lines;
}

}  // namespace

Result<MeasuredComparison> compare_measured(const calib::VolumetricModel& model,
                                            const MeasuredOptions& options) {
  auto file = read_measured(options);
  ABBE_TRY(file);
  const auto wanted = compare_options(options);
  auto tables = direct::compare(file->errors, model, wanted);
  if (!tables) {
    auto error = error_of(tables.error());
    return tl::make_unexpected(Error{error.code, fmt::format("{}: {}", options.file, error.text),
                                     lines_of_rows_off(options.file, *file)});
  }
  auto volume = direct::compare_in_volume(file->errors, model, wanted.device);
  auto off = lines_of_rows_off(options.file, *file);
  return MeasuredComparison{std::move(*file), std::move(*tables), std::move(volume),
                            model.tool_offsets_m().front(), std::move(off)};
}

}  // namespace abbe::daemon
