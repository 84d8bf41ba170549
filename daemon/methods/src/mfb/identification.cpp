#include "abbe/methods/mfb/identification.hpp"

#include <string_view>
#include <utility>

#include "abbe/calib/mfb/observe/reading_mistakes.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/methods/mfb/inputs.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

Result<MfbCandidate> identify_with_bar(const MfbTask& task, const Config& config,
                                       const calib::VolumetricModel* active,
                                       const MfbProgress& progress) {
  const auto show = [&progress](std::string_view step, double share) {
    if (progress) progress(step, share);
  };
  const auto machine = mfb_machine(config.machine);
  ABBE_TRY(machine);

  show("identifying", 0.0);
  auto found = mfb::identify(task.bar, task.plan, task.passes, *machine, task.options);
  if (!found)
    return fail(ErrorCode::DataInsufficient,
                found.error().text + mfb::corrections_to_plan(task.bar, task.plan, task.passes));

  show("judging", 0.0);
  auto verdict = mfb::judge(
      *found, active,
      {.limits = gate_limits(config.gate),
       .solve = task.options.solve,
       .accept_bar_temperature = config.gate.accepts(mfb::kBarTemperature),
       .accept_bar_temperature_change = config.gate.accepts(mfb::kBarTemperatureChange)});
  if (!verdict) return tl::unexpected(error_of(verdict.error()));
  for (std::string& note : notes_on_inputs(task.bar, task.plan, config.machine))
    verdict->notes.push_back(std::move(note));

  MfbCandidate candidate{*std::move(found), *std::move(verdict), {}};
  if (!task.monte_carlo) return candidate;

  mfb::MonteCarloOptions options = *task.monte_carlo;
  options.progress = [&show](double share) { show("Monte Carlo", share); };
  auto trials = mfb::monte_carlo(candidate.found.observations, candidate.found.solution,
                                 task.options.solve, options);
  if (!trials) return tl::unexpected(error_of(trials.error()));
  candidate.monte_carlo = *std::move(trials);
  return candidate;
}

}  // namespace abbe::daemon
