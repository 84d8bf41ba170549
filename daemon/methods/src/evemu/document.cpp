#include "abbe/methods/evemu/document.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "evemu/figures.hpp"

namespace abbe::daemon {

namespace {

ResidualFigures document_figures(const calib::evemu::ResidualFigures& f) {
  return {f.mean_abs_m, f.rms_m, f.max_abs_m};
}

ModelStatistics model_statistics(const calib::evemu::Statistics& s) {
  return {.samples = s.balls,
          .observations = s.observations,
          .unknowns = s.unknowns,
          .rank = s.rank,
          .condition = s.condition,
          .sigma0 = std::sqrt(s.chi2_per_dof),
          .chi2_per_dof = s.chi2_per_dof,
          .before = document_figures(s.before),
          .after = document_figures(s.after),
          .iterations = s.iterations,
          .stop_reason = "converged",
          .degrees_of_freedom = s.degrees_of_freedom};
}

}  // namespace

ModelDocument evemu_document(const calib::evemu::Solution& solution, const Config& config,
                             std::vector<InputFile> inputs, protocol::UtcTime created) {
  ModelDocument document{solution.model,
                         "evemu",
                         std::string{calib::evemu::name(solution.estimator)},
                         config.machine.name,
                         machine_hash(config),
                         created,
                         model_statistics(solution.statistics),
                         std::move(inputs),
                         solution.artefact ? solution.artefact->expansion : std::nullopt};
  document.configuration = config.meaning;
  return document;
}

ModelDocument evemu_document(const EvemuCandidate& candidate, const Config& config,
                             std::vector<InputFile> inputs, protocol::UtcTime created) {
  ModelDocument document = evemu_document(candidate.solution, config, std::move(inputs), created);
  document.run = evemu_figures(candidate);
  return document;
}

}  // namespace abbe::daemon
