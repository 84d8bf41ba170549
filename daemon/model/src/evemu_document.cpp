#include <cmath>

#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

namespace {

ResidualFigures figures(const calib::evemu::ResidualFigures& f) {
  return {f.mean_abs_m, f.rms_m, f.max_abs_m};
}

ModelStatistics statistics(const calib::evemu::Statistics& s) {
  return {.samples = s.balls,
          .observations = s.observations,
          .unknowns = s.unknowns,
          .rank = s.rank,
          .condition = s.condition,
          .sigma0 = std::sqrt(s.chi2_per_dof),
          .chi2_per_dof = s.chi2_per_dof,
          .before = figures(s.before),
          .after = figures(s.after),
          .iterations = s.iterations,
          .stop_reason = "converged"};
}

}  // namespace

ModelDocument evemu_document(const calib::evemu::Solution& solution, const Config& config,
                             std::vector<InputFile> inputs, protocol::UtcTime created) {
  return {solution.model,
          "evemu",
          std::string{calib::evemu::name(solution.estimator)},
          config.machine.name,
          machine_hash(config),
          created,
          statistics(solution.statistics),
          std::move(inputs),
          solution.artefact ? solution.artefact->expansion : std::nullopt};
}

}  // namespace abbe::daemon
