#include "joint_bar.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "abbe/calib/mfb/observe/reading_mistakes.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/methods/mfb/identification.hpp"
#include "abbe/methods/mfb/inputs.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe/tasks/scales_corrected.hpp"

namespace abbe::daemon {
namespace {

namespace mfb = calib::mfb;

std::string name_of(const std::string& file) {
  return std::filesystem::path(file).filename().string();
}

struct TouchedBar {
  MfbTask task;
  std::vector<InputFile> sources;
};

Result<TouchedBar> read_touched_bar(const IdentifyJointArguments& arguments, const BarFiles& files,
                                    const Config& config) {
  ABBE_TRY(check_scales("identify joint", "points", config, arguments.scales_corrected));
  const auto machine = mfb_machine(config.machine);
  ABBE_TRY(machine);
  auto bar = read_bar_toml(files.bar);
  ABBE_TRY(bar);
  auto plan = read_bar_plan_toml(files.plan, bar->bar);
  ABBE_TRY(plan);
  auto points = read_bar_points_csv(files.points, bar->bar, *plan, machine->nodes);
  ABBE_TRY(points);
  if (!points->against_pass.empty())
    return tl::make_unexpected(Error{
        ErrorCode::BadInput,
        fmt::format("{}: the drift of the passes would be wrong: correct the order of the rows, or "
                    "`pass` in {}",
                    files.points, files.plan),
        points->against_pass});
  return TouchedBar{{.bar = std::move(bar->bar),
                     .plan = std::move(plan->plan),
                     .passes = std::move(points->passes),
                     .options = {}},
                    {bar->source, plan->source, points->source}};
}

void set_aside(std::vector<mfb::PassTouches>& passes,
               const std::vector<mfb::SetAsideTouch>& touches) {
  for (const mfb::SetAsideTouch& wrong : touches)
    for (mfb::Touch& touch : passes[wrong.measurement])
      touch.set_aside = touch.set_aside || touch.target == wrong.target;
}

/// The verdict on the bar alone, as in `identify mfb`; touches that it finds wrong are excluded. If
/// the bar alone does not determine a model, the verdict has a note instead of reasons.
calib::Verdict verdict_of_bar(MfbTask& task, const Config& config) {
  const auto found = identify_with_bar(task, config, nullptr);
  if (!found) return {.notes = {"not judged by itself: " + found.error().text}};
  set_aside(task.passes, found->found.set_aside);
  return found->verdict;
}

}  // namespace

Result<void> add_bar(const IdentifyJointArguments& arguments, const BarFiles& files,
                     JointInput& input) {
  auto touched = read_touched_bar(arguments, files, input.config);
  ABBE_TRY(touched);
  MfbTask& task = touched->task;
  auto verdict = verdict_of_bar(task, input.config);

  const auto observations =
      mfb::observe(task.bar, task.plan, task.passes, calib::joint::bar_machine(*input.common));
  if (!observations) {
    Error error = error_of(observations.error());
    error.text = fmt::format("{}: {}{}", files.points, error.text,
                             mfb::corrections_to_plan(task.bar, task.plan, task.passes));
    return tl::make_unexpected(std::move(error));
  }
  auto part = calib::joint::part_of_bar(files.name, *observations, *input.common,
                                        {.bar = name_of(files.bar)});
  if (!part) return tl::make_unexpected(error_of(part.error()));

  input.facts.push_back(
      {files.name, "mfb",
       fmt::format("{}, {}, {}", name_of(files.bar), name_of(files.plan), name_of(files.points)),
       3 * task.bar.O_m.size() * observations->passes.size(), std::nullopt, std::move(verdict)});
  input.parts.push_back(std::move(*part));
  for (const InputFile& file : touched->sources)
    if (std::ranges::find(input.sources, file) == input.sources.end())
      input.sources.push_back(file);
  return {};
}

}  // namespace abbe::daemon
