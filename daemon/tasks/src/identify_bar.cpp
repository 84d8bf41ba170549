#include "abbe/tasks/identify_bar.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/calib/mfb/observe/reading_mistakes.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/gauge_file.hpp"
#include "abbe/tables/mfb_files.hpp"

namespace abbe::daemon {
namespace {

Result<IdentifiedBar> calibrated_bar(const IdentifyBarArguments& arguments) {
  const auto bar = read_bar_toml(arguments.bar);
  ABBE_TRY(bar);
  const auto plan = read_bar_plan_toml(arguments.plan, bar->bar);
  ABBE_TRY(plan);
  const auto points =
      read_bar_points_csv(arguments.points, bar->bar, *plan, nodes_of_measuring_machine());
  ABBE_TRY(points);
  const auto gauge = read_gauge_toml(arguments.gauge);
  ABBE_TRY(gauge);

  auto found = calib::mfb::calibrate_bar(bar->bar, plan->plan, points->passes, gauge->gauge);
  if (!found) {
    Error error = error_of(found.error());
    error.text += calib::mfb::corrections_to_plan(bar->bar, plan->plan, points->passes);
    return tl::make_unexpected(std::move(error));
  }
  return IdentifiedBar{std::move(*found),
                       {bar->source, plan->source, points->source, gauge->source},
                       plan->plan.measurements.size() / 2};
}

/// The comment at the head of the file: origin of the data, meaning of the uncertainty.
std::string head_of_bar(const IdentifiedBar& found) {
  const auto& c = found.calibration;
  std::string text = fmt::format(
      "# Calibrated by reversal: {} normal and {} reversed passes. Covariance: k = 1, with the "
      "mean "
      "of the\n# repeats ({} degrees of freedom) widened by Student's t, {:.3f} / 1.96.\n",
      found.repeats, found.repeats, c.degrees_of_freedom, c.student_t95);
  for (const InputFile& source : found.sources)
    text += fmt::format("# from {}, SHA-256 {}\n", source.name, source.sha256);
  for (const std::string& note : c.notes) text += fmt::format("# {}\n", note);
  return text;
}

}  // namespace

calib::MachineNodes nodes_of_measuring_machine() {
  constexpr double kFar_m = 50.0;
  calib::MachineNodes nodes;
  for (auto& axis : nodes) axis.nodes_m = {-kFar_m, kFar_m};
  return nodes;
}

Result<IdentifiedBar> identify_bar(const IdentifyBarArguments& arguments) {
  auto found = calibrated_bar(arguments);
  if (!found) return found;
  ABBE_TRY(replace_file(arguments.out, bar_toml(found->calibration.bar, head_of_bar(*found))));
  return found;
}

}  // namespace abbe::daemon
