#include "mfb_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "abbe/base/units.hpp"
#include "identified_model.hpp"

namespace abbe::daemon {
namespace {

namespace mfb = calib::mfb;

nlohmann::json um_json(const calib::Vector3& v_m) {
  return {v_m.x() * kUmPerM, v_m.y() * kUmPerM, v_m.z() * kUmPerM};
}

nlohmann::json measurements_json(const BarFigures& bar) {
  nlohmann::json all = nlohmann::json::array();
  for (const auto& pass : bar.passes)
    all.push_back({{"name", pass.measurement}, {"chi2_per_dof", pass.chi2_per_dof}});
  return all;
}

nlohmann::json drift_json(const BarFigures& bar) {
  nlohmann::json all = nlohmann::json::array();
  for (const auto& pair : bar.drift)
    all.push_back({{"forward", pair.forward},
                   {"backward", pair.backward},
                   {"value", um_json(pair.rate_m)},
                   {"u", um_json(pair.u_rate_m)}});
  return all;
}

nlohmann::json set_aside_json(const BarFigures& bar) {
  nlohmann::json all = nlohmann::json::array();
  for (const auto& touch : bar.set_aside)
    all.push_back({{"measurement", touch.measurement},
                   {"feature", touch.feature},
                   {"index", touch.index},
                   {"side", touch.side},
                   {"k", touch.k},
                   {"residual_um", touch.residual_m * kUmPerM}});
  return all;
}

nlohmann::json budget_json(const std::vector<mfb::Budget>& budget) {
  nlohmann::json all = nlohmann::json::array();
  for (const auto& b : budget)
    all.push_back({{"name", b.name},
                   {"u", b.u * kUmPerM},
                   {"probe", b.probe * kUmPerM},
                   {"machine", b.machine * kUmPerM},
                   {"bar", b.bar * kUmPerM},
                   {"expansion", b.expansion * kUmPerM},
                   {"temperature", b.temperature * kUmPerM},
                   {"roll", b.roll * kUmPerM},
                   {"drift", b.drift * kUmPerM}});
  return all;
}

/// Largest standard uncertainty of the model's lengths and of its angles.
struct LargestUncertainty {
  double length_m = 0.0, angle_rad = 0.0;

  explicit LargestUncertainty(const calib::VolumetricModel& model) {
    for (const calib::Parameter& p : model.parameters()) {
      double& largest = p.is_angle() ? angle_rad : length_m;
      largest = std::max(largest, p.u);
    }
  }
};

}  // namespace

nlohmann::json mfb_json(const ModelDocument& document, const MfbCandidate& candidate,
                        const std::filesystem::path& folder) {
  const auto& s = document.statistics;
  const auto& found = candidate.found;
  const auto& held_out = candidate.verdict.held_out;
  const LargestUncertainty u(document.model);
  nlohmann::json object{
      {"model", (folder / "model.json").string()},
      {"id", model_id(document)},
      {"hash", model_hash(document)},
      {"estimator", document.estimator},
      {"positions", found.observations.positions.size()},
      {"touches", s.samples},
      {"observations", s.observations},
      {"unknowns", s.unknowns},
      {"rank", s.rank},
      {"condition", s.condition},
      {"chi2", found.solution.statistics.chi2},
      {"degrees_of_freedom", found.solution.statistics.degrees_of_freedom},
      {"chi2_per_dof", s.chi2_per_dof},
      {"chi2_per_dof_limit", found.solution.statistics.chi2_per_dof_limit},
      {"all_chi2_per_dof", found.solution.statistics.all_chi2_per_dof},
      {"all_chi2_per_dof_limit", found.solution.statistics.all_chi2_per_dof_limit},
      {"likely_cause", mfb::name(found.cause.cause)},
      {"likely_cause_text", found.cause.text},
      {"largest_u_um", u.length_m * kUmPerM},
      {"largest_u_urad", u.angle_rad * kUradPerRad},
      {"residual_rms_before_um", s.before.rms_m * kUmPerM},
      {"residual_rms_after_um", s.after.rms_m * kUmPerM},
      {"held_out_rms_before_um", held_out.no_compensation_rms_m * kUmPerM},
      {"held_out_rms_after_um", held_out.candidate_rms_m * kUmPerM},
      {"budget", budget_json(found.solution.budget)},
      {"gate", verdict_json(candidate.verdict)}};
  if (document.bar)
    object.update({{"measurements", measurements_json(*document.bar)},
                   {"drift_um_per_pass", drift_json(*document.bar)},
                   {"set_aside", set_aside_json(*document.bar)}});
  if (const auto& m = candidate.monte_carlo)
    object["monte_carlo"] = {{"trials", m->trials},
                             {"seed", m->seed},
                             {"mean_ratio", m->mean_ratio},
                             {"smallest_ratio", m->smallest_ratio},
                             {"largest_ratio", m->largest_ratio},
                             {"scatter_of_ratio", m->scatter_of_ratio}};
  return object;
}

void print_mfb_summary(const ModelDocument& document, const MfbCandidate& candidate,
                       const std::filesystem::path& folder) {
  const auto& s = document.statistics;
  const auto& found = candidate.found;
  const LargestUncertainty u(document.model);
  fmt::print("model       {}  ({} tables, any tool of machine \"{}\")\n", model_id(document),
             document.model.tables()->layout().tables().size(), document.machine);
  fmt::print("bar         {}: {} measurements in {} positions, {} touches, {} excluded\n",
             found.observations.bar.name, found.observations.passes.size(),
             found.observations.positions.size(), s.samples, s.lost_samples);
  fmt::print("solution    {}: {} observations, {} unknowns, rank {}, condition {:.3g}\n",
             document.estimator, s.observations, s.unknowns, s.rank, s.condition);
  fmt::print("chi-square  {:.3f} per degree of freedom, at most {:.3f}\n", s.chi2_per_dof,
             found.solution.statistics.chi2_per_dof_limit);
  fmt::print("uncertainty at most {:.3f} um and {:.2f} urad (k = 1)\n", u.length_m * kUmPerM,
             u.angle_rad * kUradPerRad);
  if (const auto& m = candidate.monte_carlo)
    fmt::print("            Monte Carlo, {} trials: {:.3f} of it in the mean, {:.3f} to {:.3f}\n",
               m->trials, m->mean_ratio, m->smallest_ratio, m->largest_ratio);
  fmt::print("residuals   {:.3f} um rms before, {:.3f} um after\n", s.before.rms_m * kUmPerM,
             s.after.rms_m * kUmPerM);
  print_verdict(candidate.verdict);
  fmt::print("written     {}, tables.csv, report.html\n", (folder / "model.json").string());
}

}  // namespace abbe::daemon
