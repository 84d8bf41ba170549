// Applies the options of `abbe identify otf` to the configuration, and checks the path.
#include <fmt/format.h>

#include "abbe/base/units.hpp"
#include "abbe/calib/model/backlash.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/travel_faults.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "otf_run.hpp"
#include "target_offset.hpp"

namespace abbe::daemon {

namespace otf = calib::otf;

namespace {

constexpr double kPpmPer1 = 1e6;

}  // namespace

double u_scale_of(const IdentifyOtfArguments& arguments, const Config& config) {
  if (arguments.u_scale_ppm) return *arguments.u_scale_ppm / kPpmPer1;
  const auto tracker = tracker_source(config);
  return tracker ? tracker->u_scale : 0.0;
}

void apply(const IdentifyOtfArguments& arguments, Config& config) {
  OtfConfig& otf = config.otf;
  const auto set = [](auto& value, const auto& named) {
    if (named) value = config_of(*named);
  };
  if (arguments.estimator) set(otf.estimator, otf::estimator(*arguments.estimator));
  set(otf.mode, otf::mode_named(arguments.mode));
  set(otf.backlash, calib::backlash_named(arguments.backlash));
  set(config.machine.interpolation, calib::table_interpolation(arguments.tables));
  if (const auto& t = arguments.target_offset_m) set_target(config, *t);
  if (const auto& p = arguments.tracker_position_m)
    config.machine.tracker_position_m = {p->x(), p->y(), p->z()};
}

Result<void> apply_smoothness(const std::string& text, Config& config) {
  auto& smoothness_m = config.otf.smoothness_m;
  if (text.empty()) return {};
  smoothness_m.reset();
  if (text == "none") return {};

  const bool is_one = text.find(',') == std::string::npos;
  const auto size_mm =
      parse_mm("--smoothness-um", is_one ? fmt::format("{0},{0},{0}", text) : text);
  const calib::Vector3 bend_m =
      size_mm ? calib::Vector3(*size_mm * kMmPerM / kUmPerM) : calib::Vector3::Zero();
  bool valid = bend_m.maxCoeff() > 0.0;
  for (const double value_m : bend_m)
    valid = valid && (value_m == 0.0 || otf::is_bend_size(value_m));
  if (!valid)
    return fail(ErrorCode::Usage,
                fmt::format("--smoothness-um \"{}\": must be none, or the standard deviation in um "
                            "of the second difference over three nodes 50 mm apart, 0.01 to 1000. "
                            "One number for all axes, or X,Y,Z; 0: no prior for that axis",
                            text));
  smoothness_m = {bend_m[0], bend_m[1], bend_m[2]};
  return {};
}

Result<void> check_path(const std::string& file, const PathFile& path, const Config& config) {
  ABBE_TRY(check_travel(file, otf_path(path.vertices_m).vertices_m, path.lines, config.machine));
  auto valid = check_otf_path(path.vertices_m, config.machine, calib_of(config.otf.mode),
                              calib_of(config.otf.backlash));
  if (!valid) valid.error().text = fmt::format("{}: {}", file, valid.error().text);
  return valid;
}

}  // namespace abbe::daemon
