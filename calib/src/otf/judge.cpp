#include "abbe/calib/otf/judge.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "abbe/calib/model_comparison.hpp"
#include "abbe/calib/otf/orientation.hpp"
#include "abbe/calib/root_sum_of_squares.hpp"
#include "certainty.hpp"
#include "check_stopped.hpp"
#include "message.hpp"
#include "otf/gauge_of.hpp"

namespace abbe::calib::otf {
namespace {

/// Sums of squares, over all held-out rows, of the residuals of one model or of no compensation.
struct Remainder {
  double whitened_squares = 0.0;
  double squares_m2 = 0.0;
  std::size_t rows = 0;

  [[nodiscard]] double rms() const {
    return std::sqrt(whitened_squares / static_cast<double>(rows));
  }
  [[nodiscard]] double rms_m() const { return std::sqrt(squares_m2 / static_cast<double>(rows)); }
};

/// Entries of the six rigid unknowns in a row of the design. (Residuals of at most kRigidUnknowns
/// rows are not compared: a best-fit rigid motion fits so few rows exactly, whatever the model.)
Vector6 rigid_row(const Observations& o, std::size_t row) {
  Vector6 r = Vector6::Zero();
  for (const SparseRows::Entry& e : o.A.row(row)) {
    if (e.column >= o.rigid_offset()) {
      r(static_cast<Eigen::Index>(e.column - o.rigid_offset())) = e.value;
    }
  }
  return r;
}

/// Removes the best-fit rigid motion from the residuals of the held-out rows and adds the squares
/// of the remaining residuals to `total`.
void add_without_rigid(Remainder& total, const Observations& o, std::span<const std::size_t> rows,
                       std::span<const double> residual_m) {
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 g = Vector6::Zero();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vector6 a = rigid_row(o, rows[i]);
    const double sigma_m = o.rows[rows[i]].sigma_m, weight = 1.0 / (sigma_m * sigma_m);
    H.noalias() += weight * a * a.transpose();
    g += weight * residual_m[i] * a;
  }

  // Complete orthogonal decomposition: a fold with few legs may not determine the whole rigid
  // motion; the undetermined part is then set to zero.
  const Vector6 rigid = H.completeOrthogonalDecomposition().solve(g);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double rest_m = residual_m[i] - rigid_row(o, rows[i]).dot(rigid);
    const double whitened = rest_m / o.rows[rows[i]].sigma_m;
    total.whitened_squares += whitened * whitened;
    total.squares_m2 += rest_m * rest_m;
  }

  total.rows += rows.size();
}

double predicted_by_fit(const Observations& o, std::size_t row, const Eigen::VectorXd& U) {
  double sum = 0.0;
  for (const SparseRows::Entry& e : o.A.row(row)) {
    sum += e.value * U(static_cast<Eigen::Index>(e.column));
  }
  return sum;
}

/// Prediction of y by a model, averaged over the sub-points of the row, as the row is. The model
/// may have other nodes than the design, so the row of the design cannot be used.
double predicted_by_model(const Observations& o, std::size_t row, const VolumetricModel& model) {
  const Observation& r = o.rows[row];
  Vector3 sum = Vector3::Zero();
  for (std::size_t k = 0; k < r.sub_points; ++k) {
    sum += model.V_at(o.sub_points_m[r.first_sub_point + k], o.target_offset_m);
  }
  return r.direction.dot(sum) / static_cast<double>(r.sub_points);
}

/// The rows whose sub-points are all inside the validity volume of a model.
std::vector<std::size_t> inside(const Observations& o, std::span<const std::size_t> rows,
                                const ValidityVolume& volume) {
  std::vector<std::size_t> found;
  std::copy_if(rows.begin(), rows.end(), std::back_inserter(found), [&](std::size_t row) {
    const Observation& r = o.rows[row];
    const auto begin = o.sub_points_m.begin() + static_cast<std::ptrdiff_t>(r.first_sub_point);
    return std::all_of(begin, begin + static_cast<std::ptrdiff_t>(r.sub_points),
                       [&](const Vector3& q) { return volume.contains(q); });
  });
  return found;
}

/// Residuals y - predicted_m(row) of the given rows.
template <class Prediction>
std::vector<double> residuals(const Observations& o, std::span<const std::size_t> rows,
                              Prediction predicted_m) {
  std::vector<double> r;
  r.reserve(rows.size());
  for (const std::size_t row : rows) {
    r.push_back(o.rows[row].y_m - predicted_m(row));
  }
  return r;
}

std::vector<RowInformation> information_by_fold(const Observations& o, std::size_t folds) {
  std::vector<RowInformation> parts;
  for (std::size_t f = 0; f < folds; ++f) {
    parts.push_back(information_of(o, [&](const Observation& r) { return r.leg % folds == f; }));
  }
  return parts;
}

/// Marks the legs of the fold that observe a parameter without observations in the other folds.
std::vector<bool> legs_needed(const Observations& o, const estimation::Information& others,
                              std::size_t fold, std::size_t folds) {
  std::vector<bool> needed(o.rows.back().leg + 1, false), unseen(o.unknowns());
  for (std::size_t unknown = 0; unknown < unseen.size(); ++unknown) {
    unseen[unknown] = !(others.squared_length(unknown) > 0.0);
  }

  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].leg % folds != fold) {
      continue;
    }
    for (const SparseRows::Entry& e : o.A.row(i)) {
      if (e.value != 0.0 && unseen[e.column]) {
        needed[o.rows[i].leg] = true;
      }
    }
  }

  return needed;
}

struct HeldOutFold {
  Eigen::VectorXd U;
  std::vector<std::size_t> rows;  ///< the held-out rows: U was not fitted to them
};

/// Fits U without the legs of a fold. A leg that has the only observations of a node of a table
/// remains in the fit. If U is not determined even with these legs, the result has no held-out
/// rows.
Result<HeldOutFold> hold_out(const std::vector<RowInformation>& parts, std::size_t fold,
                             const Observations& o, const Options& options) {
  estimation::Information training(o.unknowns());
  for (std::size_t f = 0; f < parts.size(); ++f) {
    if (f != fold) {
      training += parts[f].data;
    }
  }

  const std::vector<bool> needed = legs_needed(o, training, fold, parts.size());
  if (std::find(needed.begin(), needed.end(), true) != needed.end()) {
    training += information_of(o, [&](const Observation& r) { return needed[r.leg]; }).data;
  }

  const Result<Eigen::VectorXd> U =
      gauge_of(o).estimate(training, {.weight = options.gauge_weight});
  if (!U && U.error().code == ErrorCode::RankDeficient) {
    return HeldOutFold{};
  }

  if (!U) {
    return failure(U.error().code, message("held-out test without fold ", fold, " of ",
                                           parts.size(), ": ", U.error().text));
  }

  HeldOutFold held{*U, {}};
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].leg % parts.size() == fold && !needed[o.rows[i].leg]) {
      held.rows.push_back(i);
    }
  }

  return held;
}

/// Inserts the alternatives that refuse the model before the other reasons, because these may be
/// only consequences of the alternatives.
void add_alternatives(Verdict& verdict, const std::vector<Alternative>& others) {
  std::size_t reasons = 0;
  for (const Alternative& other : others) {
    const std::string text = with_effect(other.text, other.bias_m, other.u_m);
    if (other.cause == Cause::CorrelatedNoise) {
      verdict.notes.push_back(other.text);
    } else if (other.bias_m <= other.u_m) {
      verdict.notes.push_back(text);
    } else {  // larger, or NaN
      verdict.refuse(name(other.cause), text, reasons++);
    }
  }
}

double common_scale_error(const VolumetricModel& model) {
  const std::vector<Vector3> at = tensor_grid(model.nodes());
  std::vector<Vector3> V_m;
  for (const Vector3& q : at) {
    V_m.push_back(model.V_at(q, model.tool_offsets_m().front()));
  }
  return common_scale(at, V_m);
}

void require_plausible_scale(Verdict& verdict, double scale, double most) {
  if (!(std::abs(scale) <= most)) {
    verdict.refuse(
        "growth",
        message("the machine is larger by ", 1e6 * scale, " um/m in all directions, limit ",
                1e6 * most, " um/m: wrong scale of the path, of the ranges or of a temperature"));
  }
}

/// Notes for scale errors that residuals do not show and for which no uncertainty is given.
void note_what_u_leaves_out(Verdict& verdict, const Observations& o) {
  const std::vector<Vector3> at = tensor_grid(o.layout().nodes());
  Vector3 centre = Vector3::Zero();
  for (const Vector3& q : at) {
    centre += q / static_cast<double>(at.size());
  }

  double squares = 0.0;
  for (const Vector3& q : at) {
    squares += (q - centre).squaredNorm();
  }

  const double lever_m = std::sqrt(squares / static_cast<double>(at.size()));
  constexpr double kSteel_per_K = 11.5e-6;
  if (!(o.u_scale > 0.0)) {
    verdict.notes.push_back(
        message("not in the uncertainty: the scale of the tracker's ranges; 1 um/m would be ",
                lever_m, " um rms"));
  }

  if (*std::max_element(o.u_axis_scale.begin(), o.u_axis_scale.end()) <= 0.0) {
    verdict.notes.push_back(
        message("not in the uncertainty: the temperature of the machine's scales; 1 K of steel "
                "would be ",
                1e6 * kSteel_per_K * lever_m, " um rms"));
  }
}

/// Note if the data hardly determine the offset of the ranges, because the model can reproduce it;
/// the prior then determines the estimate.
void note_undetermined_offset(Verdict& verdict, const RangeOffset& offset, double prior_m) {
  const double share = offset.u_m / prior_m;  // 1: the data determine nothing
  constexpr double kOfEqualWeight = 0.7;      // 1/sqrt(2): data and prior of equal weight
  if (!(prior_m > 0.0) || !(share > kOfEqualWeight)) {
    return;
  }
  const double u_of_data_m = offset.u_m / std::sqrt(std::max(1e-12, 1.0 - share * share));
  constexpr double kNormal99 = 2.576;
  verdict.notes.push_back(message(
      "the run hardly determines the offset of the tracker's ranges: its stated uncertainty is ",
      1e6 * prior_m, " um, and an offset below ",
      1e6 * kNormal99 * root_sum_of_squares(u_of_data_m, prior_m), " um would not be detected"));
}

}  // namespace

Result<HeldOutFigures> held_out(const Observations& o, const VolumetricModel* active,
                                const Options& options) {
  const std::size_t folds = options.held_out_folds;
  const std::size_t legs = o.rows.empty() ? 0 : o.rows.back().leg + 1;
  if (folds < 2 || legs < folds) {
    return failure(ErrorCode::TooFewObservations,
                   message("held-out test: ", legs, " legs in ", folds,
                           " folds, needs at least 2 folds and one leg per fold"));
  }

  const bool with_active = active != nullptr && active->holds_for_tool(o.target_offset_m);
  const std::vector<RowInformation> parts = information_by_fold(o, folds);
  Remainder none, candidate, other, candidate_beside;

  for (std::size_t f = 0; f < folds; ++f) {
    if (Result<void> running = check_stopped(options.stopped); !running) {
      return tl::unexpected(running.error());
    }
    const Result<HeldOutFold> fit = hold_out(parts, f, o, options);
    if (!fit) {
      return tl::unexpected(fit.error());
    }
    const std::vector<std::size_t>& rows = fit->rows;
    if (rows.size() <= kRigidUnknowns) {
      continue;
    }
    add_without_rigid(none, o, rows, residuals(o, rows, [](std::size_t) { return 0.0; }));
    const auto by_fit = [&](std::size_t i) { return predicted_by_fit(o, i, fit->U); };
    add_without_rigid(candidate, o, rows, residuals(o, rows, by_fit));
    const std::vector<std::size_t> both =
        with_active ? inside(o, rows, active->validity()) : std::vector<std::size_t>{};
    if (both.size() > kRigidUnknowns) {
      add_without_rigid(candidate_beside, o, both, residuals(o, both, by_fit));
      add_without_rigid(other, o, both, residuals(o, both, [&](std::size_t i) {
                          return predicted_by_model(o, i, *active);
                        }));
    }
    if (options.progress) {
      options.progress(Stage::Judge, static_cast<double>(f + 1) / static_cast<double>(folds));
    }
  }

  if (none.rows == 0) {
    return failure(
        ErrorCode::RankDeficient,
        message("held-out test: without any one of ", folds,
                " folds the other legs do not determine the model; measure every part of the "
                "volume on more legs"));
  }

  HeldOutFigures figures{.no_compensation = none.rms(),
                         .candidate = candidate.rms(),
                         .observations = none.rows,
                         .not_held_out = o.rows.size() - none.rows,
                         .no_compensation_rms_m = none.rms_m(),
                         .candidate_rms_m = candidate.rms_m()};

  if (other.rows > 0) {
    figures.active = other.rms();
    figures.active_rms_m = other.rms_m();
    figures.candidate_beside_active = candidate_beside.rms();
    figures.observations_beside_active = other.rows;
  }

  return figures;
}

Result<Verdict> judge(const Observations& measured, const Solution& solution,
                      const VolumetricModel* active, const GateLimits& limits,
                      const Options& options) {
  const Observations o = without_range_offset(measured, solution.range_offset.value_m);
  const Result<std::vector<Alternative>> others = alternatives(o, solution, options);
  const Result<HeldOutFigures> figures = held_out(o, active, options);

  if (!others || !figures) {
    return tl::unexpected(others ? figures.error() : others.error());
  }

  Verdict verdict = decide(solution.model, *figures, limits, active);
  verdict.notes.insert(verdict.notes.end(), o.notes.begin(), o.notes.end());
  add_alternatives(verdict, *others);
  require_plausible_scale(verdict, common_scale_error(solution.model), limits.max_scale_error);
  require_orientation(verdict, {o.vertices_m}, o.layout().nodes(), o.target_offset_m,
                      o.alignment.T_machine_tracker, options.orientation);
  const CorrectionSize size = correction_size(solution.model);
  require_certainty(verdict, size.V_m, size.u_m);
  note_what_u_leaves_out(verdict, o);
  note_undetermined_offset(verdict, solution.range_offset, o.u_range_offset_m);
  verdict.accepted = verdict.reasons.empty();

  return verdict;
}

}  // namespace abbe::calib::otf
