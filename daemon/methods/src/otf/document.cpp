#include "abbe/methods/otf/document.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

namespace abbe::daemon {

namespace {

ResidualFigures document_figures(const calib::otf::ResidualStatistics& s) {
  return {s.mean_abs_m, s.rms_m, s.max_abs_m};
}

/// Statistics that need degrees of freedom are not finite without any; model.json then contains 0.
double or_zero(double value) {
  return std::isfinite(value) ? value : 0.0;
}

ModelStatistics model_statistics(const calib::otf::Solution& solution) {
  const calib::otf::Statistics& s = solution.statistics;
  return {.samples = s.samples,
          .lost_samples = s.lost_samples,
          .observations = s.observations,
          .unknowns = s.unknowns,
          .rank = s.rank,
          .condition = or_zero(s.condition),
          .sigma0 = or_zero(s.sigma0),
          .chi2_per_dof = or_zero(s.chi2_per_dof),
          .variance_factor = s.variance_factor,
          .before = document_figures(s.before),
          .after = document_figures(s.after),
          .iterations = s.iterations,
          .stop_reason = std::string{calib::otf::stop_reason(solution.estimator)}};
}

TrackerDriftFigures drift_figures(const calib::otf::TrackerDrift& drift) {
  return {.largest_m = drift.largest_m(),
          .u_repeatability_m = drift.u_repeatability_m,
          .visits = drift.visits};
}

}  // namespace

ModelDocument otf_document(const calib::otf::Solution& solution, calib::otf::Mode mode,
                           const Config& config, std::vector<InputFile> inputs,
                           protocol::UtcTime created) {
  ModelDocument document{solution.model,
                         "otf",
                         std::string{calib::otf::name(solution.estimator)},
                         config.machine.name,
                         machine_hash(config),
                         created,
                         model_statistics(solution),
                         std::move(inputs)};
  document.mode = calib::otf::name(mode);
  std::copy_if(solution.backlash.begin(), solution.backlash.end(),
               std::back_inserter(document.backlash), [](const auto& b) { return b.determined; });
  if (solution.drift) document.tracker_drift = drift_figures(*solution.drift);
  return document;
}

}  // namespace abbe::daemon
