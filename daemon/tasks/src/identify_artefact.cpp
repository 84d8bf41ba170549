#include "abbe/tasks/identify_artefact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe/tasks/vector_option.hpp"

namespace abbe::daemon {
namespace {

/// BadInput if the balls have a size that no ball of an artefact has, but would have a usual size
/// if the touches were in another unit.
Result<void> check_size_of_balls(const std::string& file, const calib::evemu::Calibrator& found) {
  constexpr double kSmallest_m = 1e-3, kLargest_m = 0.1;
  const auto all_usual = [&](double factor) {
    return std::ranges::all_of(found.balls, [&](const auto& ball) {
      const double radius_m = factor * (ball.radius_m + found.tip_radius_m);
      return radius_m >= kSmallest_m && radius_m <= kLargest_m;
    });
  };
  if (all_usual(1.0)) return {};
  for (const calib::UnitMistake& unit : calib::unit_mistakes())
    if (all_usual(unit.factor))
      return fail(
          ErrorCode::BadInput,
          fmt::format("{}: ball 1 has radius {:.4g} mm (without the tip), usual are {:g} to "
                      "{:g} mm; they fit with {}",
                      file, kMmPerM * found.balls.front().radius_m, kMmPerM * kSmallest_m,
                      kMmPerM * kLargest_m, unit.text));
  return {};
}

Result<IdentifiedArtefact> precalibrated_artefact(const IdentifyArtefactArguments& arguments) {
  const auto outward_1 = parse_mm("--outward-1", arguments.outward_1),
             outward_2 = parse_mm("--outward-2", arguments.outward_2);
  if (!outward_1 || !outward_2)
    return tl::make_unexpected((outward_1 ? outward_2 : outward_1).error());
  const auto touches = read_touches_csv(arguments.touches);
  ABBE_TRY(touches);
  for (const auto& touch : touches->touches)
    if (touch.position != touches->touches.front().position)
      return fail(
          ErrorCode::BadInput,
          fmt::format("{}: positions {} and {}: an artefact is calibrated in one position",
                      arguments.touches, touches->touches.front().position, touch.position));

  std::optional<double> u_touch_m;
  if (arguments.u_touch_um) u_touch_m = *arguments.u_touch_um / kUmPerM;
  auto calibrator = calib::evemu::precalibrated(arguments.name, touches->touches,
                                                arguments.tip_radius_mm / kMmPerM,
                                                {*outward_1, *outward_2}, u_touch_m);
  if (!calibrator) return tl::make_unexpected(error_of(calibrator.error()));
  ABBE_TRY(check_size_of_balls(arguments.touches, *calibrator));
  if (arguments.machine_tip_radius_mm >= 0.0)
    calibrator->tip_radius_m = arguments.machine_tip_radius_mm / kMmPerM;

  return IdentifiedArtefact{std::move(*calibrator), touches->source, touches->touches.size()};
}

/// The comment at the head of the file: the origin of the data, and what the uncertainties do not
/// include.
std::string head_of_calibrator(const IdentifiedArtefact& found) {
  return fmt::format(
      "# from {} touches of one position: {}, SHA-256 {}\n"
      "# u: standard uncertainty (k = 1) of the fits; it does not include the machine's errors\n",
      found.touches, found.source.name, found.source.sha256);
}

}  // namespace

Result<IdentifiedArtefact> identify_artefact(const IdentifyArtefactArguments& arguments) {
  auto found = precalibrated_artefact(arguments);
  if (!found) return found;
  ABBE_TRY(replace_file(arguments.out,
                        calibrator_toml(found->calibrator, {}, head_of_calibrator(*found))));
  return found;
}

}  // namespace abbe::daemon
