#include "abbe/calib/direct/compare.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/direct/convention.hpp"
#include "abbe/calib/internal/direct/judge.hpp"
#include "abbe/calib/internal/direct/scatter.hpp"
#include "abbe/result/try.hpp"
#include "causes.hpp"
#include "device.hpp"
#include "model_curve.hpp"
#include "squareness.hpp"

namespace abbe::calib::direct {
namespace {

/// One error, with its runs at the positions that measurement and model have in common.
struct Reduced {
  TableComparison table;
  Runs runs;
  Eigen::VectorXd measured;  // mean over the runs, before the convention
  std::optional<LineChange> lines{};
  Scatter scatter{};
  double change = 0.0;  // for a squareness: part of `measured` that squareness_change() added to
                        // the readings
};

bool is_squareness_name(std::string_view name) {
  return std::find(kSquarenessNames.begin(), kSquarenessNames.end(), name) !=
         kSquarenessNames.end();
}

Result<void> check_names(std::span<const MeasuredError> errors) {
  std::set<std::string> seen;
  for (const MeasuredError& error : errors) {
    if (!error_motion(error.name) && !is_squareness_name(error.name)) {
      return failure(ErrorCode::BadInput,
                     message("comparison: \"", error.name, "\" is not the name of an error"));
    }
    if (!seen.insert(error.name).second) {
      return failure(ErrorCode::BadInput, message("comparison: ", error.name, " is given twice"));
    }
  }
  return {};
}

Result<void> check_options(const CompareOptions& options) {
  if (!(options.false_alarm > 0.0 && options.false_alarm < 1.0)) {
    return failure(ErrorCode::BadInput, message("comparison: false-alarm probability ",
                                                options.false_alarm, " must be in (0, 1)"));
  }
  const DeviceUncertainty& u = options.device;
  for (const double value : {u.u_m, u.u_rad, u.u_scale}) {
    if (!(value >= 0.0 && std::isfinite(value))) {
      return failure(ErrorCode::BadInput, message("comparison: uncertainty of the device ", value,
                                                  " must be finite and >= 0"));
    }
  }
  return {};
}

std::string why_no_common_range(const Runs& runs, const ModelCurve& curve) {
  const std::vector<double>& nodes_m = curve.nodes().nodes_m;
  std::string text =
      message("measured at ", runs.positions_m.size(), " positions from ",
              kMmPerM * runs.positions_m.front(), " to ", kMmPerM * runs.positions_m.back(),
              " mm, the model covers ", kMmPerM * nodes_m.front(), " to ", kMmPerM * nodes_m.back(),
              " mm: fewer than ", kLeastPositions, " common positions");
  return text;
}

Result<Reduced> compare_motion(const MeasuredError& error, ErrorMotion motion,
                               const VolumetricModel& model, const CompareOptions& options) {
  const auto all = runs_of(error);
  ABBE_TRY(all);
  Reduced out;
  out.table.name = error.name;
  out.table.is_angle = is_rotation(motion.motion);
  out.table.runs = all->values.size();
  out.table.left_out = all->left_out;
  out.table.reversal = reversal_of(*all);
  if (!model.tables()->layout().find(motion)) {
    out.table.reason =
        "the model does not have this table: with one tool offset its effect is part "
        "of other tables";
    return out;
  }

  const ModelCurve curve(model, motion, error.line_m);
  out.runs = at_positions(*all, [&](double p) { return curve.covers(p); });
  out.table.outside = all->positions_m.size() - out.runs.positions_m.size();
  if (out.runs.positions_m.size() < kLeastPositions) {
    out.table.reason = why_no_common_range(*all, curve);
    return out;
  }

  const std::vector<double>& p = out.runs.positions_m;
  const double reference_m = curve.nodes().reference_m;
  const Eigen::MatrixXd P = reduction(motion, p, reference_m, options.line);
  const Eigen::MatrixXd B = P * curve.rows(p);
  out.measured = out.runs.mean();
  out.table.convention = convention_text(motion, p, reference_m, options.line);
  out.lines = line_change(motion, *all, error.line_m, p, options.line);
  out.scatter = scatter_of(out.runs, motion);
  out.table.dof = out.scatter.dof;
  add_points(
      out.table, out.runs, P * out.measured, B * model.U(),
      {covariance_of_runs(out.runs, motion, out.scatter, P),
       covariance_of_device(motion, P, p, options.device), B * model.covariance() * B.transpose()},
      uncertainty_known(motion, out.scatter, options.device));
  return out;
}

std::vector<LineChange> lines_of(std::span<const Reduced> motions) {
  std::vector<LineChange> lines;
  for (const Reduced& r : motions) {
    if (r.lines) {
      lines.push_back(*r.lines);
    }
  }
  return lines;
}

Result<Reduced> compare_squareness(const MeasuredError& error, const VolumetricModel& model,
                                   std::span<const Reduced> motions,
                                   const CompareOptions& options) {
  const auto runs = runs_of(error);
  ABBE_TRY(runs);
  if (runs->positions_m.size() != 1) {
    return failure(
        ErrorCode::BadInput,
        message(error.name, ": a squareness has one value per run, not one per position"));
  }

  Reduced out{.table = {}, .runs = *runs, .measured = runs->mean()};
  out.table.name = error.name;
  out.table.is_angle = out.table.is_squareness = true;
  out.table.runs = runs->values.size();
  const std::vector<LineChange> lines = lines_of(motions);
  out.table.reason = why_not_comparable(error, model.tables()->layout().nodes(), lines);
  if (!out.table.reason.empty()) {
    return out;
  }

  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(1, 1);
  const Eigen::MatrixXd row =
      squareness_row(error.name, *model.tables(), model.tool_offsets_m().front(), *error.line_m,
                     lines, options.line);
  out.change = squareness_change(error.name, lines);
  out.measured.array() += out.change;
  out.table.convention = squareness_text(error.name, lines);
  out.scatter = scatter_of(*runs, std::nullopt);
  out.table.dof = out.scatter.dof;
  add_points(out.table, *runs, out.measured, row * model.U(),
             {covariance_of_runs(*runs, std::nullopt, out.scatter, one),
              options.device.u_rad * options.device.u_rad * one,
              row * model.covariance() * row.transpose()},
             uncertainty_known(std::nullopt, out.scatter, options.device));
  return out;
}

/// Adds a likely cause for a squareness. It has one value, so that only a reversed sign can be
/// tested.
void add_squareness_cause(Reduced& r) {
  const PointDifference& point = r.table.points.front();
  const double reversed = std::abs(2.0 * r.change - point.measured - point.model);
  if (reversed <= std::max(point.limit, std::abs(point.difference) / 3.0)) {
    const bool fits = r.table.finding == Finding::Contradicts && reversed <= point.limit;
    r.table.causes.push_back(
        message(fits ? "fits" : "closer", " with the sign of the value reversed"));
  }
}

void add_causes(Reduced& r, const VolumetricModel& model, const MeasuredError& error,
                const CompareOptions& options, const Limits& limits) {
  if (r.table.finding == Finding::Agrees || r.table.points.empty()) {
    return;
  }
  if (r.table.is_squareness) {
    add_squareness_cause(r);
    return;
  }
  const ModelCurve curve(model, *error_motion(error.name), error.line_m);
  std::optional<CauseTest> test;
  if (r.table.finding == Finding::Contradicts) {
    test = CauseTest{r.scatter, r.table.runs, options.device, limits};
  }
  r.table.causes = likely_causes(curve, r.runs.positions_m, r.measured, options.line, test);
}

}  // namespace

std::string_view name(Finding finding) {
  switch (finding) {
    case Finding::Agrees:
      return "agrees";
    case Finding::Contradicts:
      return "contradicts";
    case Finding::NotTested:
      return "not tested";
    case Finding::NotCompared:
      break;
  }
  return "not compared";
}

Result<std::vector<TableComparison>> compare(std::span<const MeasuredError> errors,
                                             const VolumetricModel& model,
                                             const CompareOptions& options) {
  if (model.tables() == nullptr) {
    return failure(
        ErrorCode::NotApplicable,
        "comparison: the model consists of polynomials and has no tables of error motions");
  }
  for (const Result<void>& valid : {check_names(errors), check_options(options)}) {
    ABBE_TRY(valid);
  }

  std::vector<Reduced> all(errors.size());
  for (const bool squareness : {false, true}) {  // the squareness errors come second: they need the
                                                 // straightness lines
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const auto motion = error_motion(errors[i].name);
      if (motion.has_value() == squareness) {
        continue;
      }
      auto reduced = motion ? compare_motion(errors[i], *motion, model, options)
                            : compare_squareness(errors[i], model, all, options);
      ABBE_TRY(reduced);
      all[i] = std::move(*reduced);
    }
  }

  std::size_t tests = 0;
  for (const Reduced& r : all) {
    tests += count_tests(r.table);
  }
  const double p = options.false_alarm / static_cast<double>(std::max<std::size_t>(1, tests));
  std::vector<TableComparison> tables;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Limits limits = limits_of(p, all[i].scatter.dof);
    judge(all[i].table, limits);
    add_causes(all[i], model, errors[i], options, limits);
    tables.push_back(std::move(all[i].table));
  }
  return tables;
}

}  // namespace abbe::calib::direct
