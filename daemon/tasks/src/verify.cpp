#include "abbe/tasks/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/fit/points_off.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/vector_option.hpp"
#include "verify_points.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;

Result<verify::Options> options_of(const VerifyArguments& arguments) {
  verify::Options options;
  if (!arguments.origin.empty()) {
    const auto origin = parse_mm("--origin-mm", arguments.origin);
    ABBE_TRY(origin);
    options.origin_m = *origin;
  }

  if (!arguments.grid.empty()) {
    const auto step = parse_mm("--grid-mm", arguments.grid);
    ABBE_TRY(step);
    if (!(step->minCoeff() > 0.0))
      return fail(ErrorCode::Usage,
                  fmt::format("--grid-mm \"{}\": must be positive", arguments.grid));
    options.step_m = *step;
  }

  if (arguments.least_distance_mm)
    options.least_distance_m = *arguments.least_distance_mm / kMmPerM;
  return options;
}

/// The shots at places inside the validity volume that alone do not fit the model.
std::vector<std::string> off_with_model(const VerificationFile& file,
                                        const verify::Observations& observed,
                                        const verify::Comparison& compared,
                                        const calib::VolumetricModel& model,
                                        const calib::Vector3& tool_m) {
  std::vector<calib::Vector3> measured_m, corrected_m;
  std::vector<std::size_t> shots;
  for (const std::size_t place : compared.inside)
    shots.insert(shots.end(), observed.shots[place].begin(), observed.shots[place].end());
  std::ranges::sort(shots);
  for (const std::size_t shot : shots) {
    const auto& [reading_m, at_m] = file.points[shot];
    measured_m.push_back(at_m);
    corrected_m.emplace_back(reading_m + model.V_at(reading_m, tool_m));
  }
  // An error of the size of those of the machine is one that the model does not know.
  auto off = calib::fit::points_off(measured_m, corrected_m, compared.before.rms_m);
  for (auto& found : off.points) found.point = shots[found.point];
  return lines_of_points_off(
      file, off, "check or repeat this point; if it is right, the model is wrong there");
}

}  // namespace

Result<VerifyOutcome> verify_model(const VerifyArguments& arguments,
                                   std::optional<Error>& cut_short, const Progress& progress) {
  ABBE_TRY(check_verify(arguments));
  const auto options = options_of(arguments);
  ABBE_TRY(options);
  auto model = compared_model(arguments.models.front(), arguments.store);
  ABBE_TRY(model);
  const auto tool_m = tool_of(arguments.tool, model->document.model);
  ABBE_TRY(tool_m);

  Verification v;

  if (!arguments.planes.empty()) {
    const auto planes = parse_mm("--planes-mm", arguments.planes);
    ABBE_TRY(planes);
    v.planes_m = *planes;
  }

  std::string different;
  auto points = points_of(arguments, {{model->name, model->machine}}, different, progress);
  ABBE_TRY(points);
  cut_short = std::move(points->cut_short);

  VerificationFile& file = points->file;
  auto observed = observed_in(arguments, file);
  ABBE_TRY(observed);
  auto compared = verify::compare(*observed, model->document.model, *tool_m, *options);
  if (!compared) return tl::make_unexpected(error_of(compared.error()));

  auto off = off_with_model(file, *observed, *compared, model->document.model, *tool_m);
  v.observations = std::move(*observed);
  v.comparison = std::move(*compared);
  if (!file.source.name.empty()) v.inputs = {file.source};
  v.lines = std::move(file.lines);
  if (cut_short) v.cut_short = cut_short->text;

  v.cautions = std::move(model->cautions);
  if (!different.empty()) v.cautions.push_back(std::move(different));
  return VerifyOutcome{std::move(model->document), std::move(v), std::move(off),
                       std::move(model->machine)};
}

}  // namespace abbe::daemon
