#include "abbe/methods/drift.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "abbe/config/calib_error.hpp"
#include "abbe/methods/otf/inputs.hpp"

namespace abbe::daemon {

std::string DriftFinding::state() const {
  if (!test || !test->drifted) return {};
  return fmt::format("the machine changed since this model: {}", calib::text(*test));
}

DriftFinding find_drift(const calib::VolumetricModel& run, const calib::Verdict& verdict,
                        const calib::VolumetricModel& active, const DriftConfig& config) {
  if (!config.test || run.tables() == nullptr || !calib::shows_machine(verdict)) return {};
  auto test = calib::test_drift(run, active);
  if (!test)
    return {
        .notes = {fmt::format("not tested for drift of the active model: {}", test.error().text)}};

  DriftFinding finding{.test = std::move(*test)};
  for (const auto& change : finding.test->tables)
    if (change.drifted)
      finding.notes.push_back(fmt::format("drift since the active model: {}", calib::text(change)));
  if (finding.test->drifted && finding.notes.empty()) finding.notes.push_back(finding.state());

  return finding;
}

calib::UpdateOptions update_options(const CalibrationRun& run, const DriftFinding& finding,
                                    double days, const DriftConfig& config) {
  calib::UpdateOptions options{.forgetting = config.forgetting,
                               .days = days,
                               .length_m_per_root_day = config.length_m_per_root_day,
                               .angle_rad_per_root_day = config.angle_rad_per_root_day};
  for (const auto& [table, noise] : config.of_tables) options.of_tables.push_back({table, noise});
  if (finding.test) options.renewed = finding.test->drifted_tables();

  if (const auto* otf = std::get_if<OtfRun>(&run)) {
    options.u_scale = otf->u_scale;
    options.u_axis_scale = otf->u_axis_scale;
  }
  return options;
}

OffsetInCommon offset_in_common(const std::optional<calib::TrackerPlace>& run,
                                const std::optional<calib::TrackerPlace>& active, double days,
                                const DriftConfig& config) {
  if (!run && active)
    return {.note =
                fmt::format("the run names no place of the tracker: what is known of the offset "
                            "of the ranges at the place \"{}\" is not used, and not kept",
                            active->name)};
  if (!run) return {};
  const auto counts_as_new = [&](const std::string& why) {
    return OffsetInCommon{
        .note = fmt::format("the offset of the ranges at the place \"{}\" counts as a new one: {}",
                            run->name, why)};
  };
  if (!active) return counts_as_new("the active model names no place of the tracker");
  if (active->name != run->name)
    return counts_as_new(fmt::format("the active model is of the place \"{}\"", active->name));
  if (days < 0.0)
    return counts_as_new("the active model has a later date than the run: the clock was set back");
  if (days > config.place_days)
    return counts_as_new(
        fmt::format("the active model is {:.3g} days old, more than [drift] place_days = {:g}",
                    days, config.place_days));
  return {.of_active = active->range_offset};
}

Result<UpdatedModel> updated_model(const calib::ModelWithOffset& run, const calib::Verdict& verdict,
                                   const calib::ModelWithOffset& active,
                                   const calib::DriftTest& test,
                                   const calib::UpdateOptions& options, const GateConfig& gate) {
  if (test.rest.p < test.rest.limit)
    return fail(ErrorCode::Refused,
                fmt::format("the tables that drifted do not explain the change: chi-square {:.4g} "
                            "with {} degrees of freedom",
                            test.rest.statistic, test.rest.dof));
  auto model = calib::update_model(active, run, options);
  if (!model) return tl::unexpected(error_of(model.error()));

  calib::HeldOutFigures figures = verdict.held_out;
  figures.active.reset();
  calib::Verdict of_update = calib::decide(model->model, figures, gate_limits(gate), &active.model);
  of_update.held_out = verdict.held_out;
  of_update.notes.insert(of_update.notes.begin(), verdict.notes.begin(), verdict.notes.end());
  of_update.notes.push_back(
      options.renewed.empty()
          ? fmt::format("the active model, {:.3g} days old, was updated with the run", options.days)
          : fmt::format("the active model, {:.3g} days old, was updated with the run; {} of the "
                        "run alone",
                        options.days, fmt::join(options.renewed, ", ")));

  return UpdatedModel{std::move(*model), std::move(of_update)};
}

}  // namespace abbe::daemon
