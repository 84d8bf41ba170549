#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

#include "abbe/calib/otf/judge.hpp"
#include "check_stopped.hpp"
#include "message.hpp"
#include "otf/run_unknowns.hpp"

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
    if (e.column >= o.rigid_offset() && e.column < o.clock_offset()) {
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
/// `linear`: the observations with linear tables, where only the nodes of a cell occur in a row.
std::vector<bool> legs_needed(const Observations& linear, std::size_t fold, std::size_t folds) {
  std::vector<bool> needed(linear.rows.back().leg + 1, false), seen(linear.unknowns(), false);
  const auto for_rows = [&](bool in_fold, const auto& use) {
    for (std::size_t i = 0; i < linear.rows.size(); ++i) {
      if ((linear.rows[i].leg % folds == fold) == in_fold) {
        for (const SparseRows::Entry& e : linear.A.row(i)) {
          if (e.value != 0.0) {
            use(linear.rows[i].leg, e.column);
          }
        }
      }
    }
  };

  for_rows(false, [&](std::size_t, std::size_t column) { seen[column] = true; });
  for_rows(true, [&](std::size_t leg, std::size_t column) {
    needed[leg] = needed[leg] || !seen[column];
  });
  return needed;
}

bool has_linear_tables(const estimation::TableBasis& basis) {
  return std::all_of(kAllAxes.begin(), kAllAxes.end(), [&](Axis a) {
    return basis.interpolation(a).kind() == estimation::Interpolation::Linear;
  });
}

/// The observations with linear tables on the same nodes.
Observations with_linear_tables(const Observations& o) {
  return with_basis(o, *estimation::TableBasis::of(o.layout(), {.travel = o.basis.travel()}));
}

/// A run with the information of each of its folds.
struct RunByFold {
  const Observations& o;
  std::vector<RowInformation> parts;
  std::optional<Observations> with_linear;  ///< absent if the tables of `o` are linear

  RunByFold(const Observations& run, std::size_t folds)
      : o(run), parts(information_by_fold(run, folds)) {
    if (!has_linear_tables(run.basis)) {
      with_linear = with_linear_tables(run);
    }
  }
  [[nodiscard]] const Observations& linear() const { return with_linear ? *with_linear : o; }
};

struct HeldOutFold {
  Eigen::VectorXd U;
  /// for each run the held-out rows: U was not fitted to them
  std::vector<std::vector<std::size_t>> rows;
};

/// Fits U without the legs of a fold. A leg that has the only observations of a node of a table in
/// its run remains in the fit. If U is not determined even with these legs, the result has no
/// held-out rows.
Result<HeldOutFold> hold_out(const std::vector<RunByFold>& runs, std::size_t fold,
                             std::size_t folds, const Options& options) {
  const RunUnknowns unknowns(runs.front().o, runs.size());
  estimation::Information training(unknowns.size());
  std::vector<std::vector<bool>> needed;

  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::vector<std::size_t> at = unknowns.of_run(k);
    for (std::size_t f = 0; f < folds; ++f) {
      if (f != fold) {
        training.add(runs[k].parts[f].data, at);
      }
    }
    const std::vector<bool>& legs = needed.emplace_back(legs_needed(runs[k].linear(), fold, folds));
    if (std::find(legs.begin(), legs.end(), true) != legs.end()) {
      training.add(
          information_of(runs[k].o, [&](const Observation& r) { return legs[r.leg]; }).data, at);
    }
  }

  const Observations& any = runs.front().o;
  Result<Eigen::VectorXd> U = gauge_of_runs(any.basis, unknowns.size())
                                  .estimate(with_backlash_prior(std::move(training), any),
                                            {.weight = options.gauge_weight});
  if (!U && U.error().code == ErrorCode::RankDeficient) {
    return HeldOutFold{};
  }

  if (!U) {
    return failure(U.error().code, message("held-out test without fold ", fold, " of ", folds, ": ",
                                           U.error().text));
  }

  // The model is the mean of both directions of travel: it does not predict backlash.
  const auto model = static_cast<Eigen::Index>(any.layout().model_size());
  U->segment(model, static_cast<Eigen::Index>(any.basis.size()) - model).setZero();
  HeldOutFold held{*std::move(U), std::vector<std::vector<std::size_t>>(runs.size())};
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::vector<Observation>& rows = runs[k].o.rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].leg % folds == fold && !needed[k][rows[i].leg]) {
        held.rows[k].push_back(i);
      }
    }
  }

  return held;
}

}  // namespace

Result<HeldOutFigures> held_out(const Observations& o, const VolumetricModel* active,
                                const Options& options) {
  return held_out(std::span(&o, 1), active, options);
}

Result<HeldOutFigures> held_out(std::span<const Observations> observed,
                                const VolumetricModel* active, const Options& options) {
  const std::size_t folds = options.held_out_folds;
  std::vector<RunByFold> runs;
  std::size_t all_rows = 0;
  for (const Observations& o : observed) {
    const std::size_t legs = o.rows.empty() ? 0 : o.rows.back().leg + 1;
    if (folds < 2 || legs < folds) {
      return failure(ErrorCode::TooFewObservations,
                     message("held-out test: ", legs, " legs in ", folds,
                             " folds, needs at least 2 folds and one leg per fold"));
    }
    runs.emplace_back(o, folds);
    all_rows += o.rows.size();
  }

  const RunUnknowns unknowns(observed);
  Remainder none, candidate, other, candidate_beside;

  for (std::size_t f = 0; f < folds; ++f) {
    if (Result<void> running = check_stopped(options.stopped); !running) {
      return tl::unexpected(running.error());
    }
    const Result<HeldOutFold> fit = hold_out(runs, f, folds, options);
    if (!fit) {
      return tl::unexpected(fit.error());
    }
    for (std::size_t k = 0; k < fit->rows.size(); ++k) {
      const Observations& o = observed[k];
      const std::vector<std::size_t>& rows = fit->rows[k];
      if (rows.size() <= kRigidUnknowns) {
        continue;
      }
      add_without_rigid(none, o, rows, residuals(o, rows, [](std::size_t) { return 0.0; }));
      const Eigen::VectorXd U = unknowns.part(fit->U, k);
      const auto by_fit = [&](std::size_t i) { return predicted_by_fit(o, i, U); };
      add_without_rigid(candidate, o, rows, residuals(o, rows, by_fit));
      const bool with_active = active != nullptr && active->holds_for_tool(o.target_offset_m);
      const std::vector<std::size_t> both =
          with_active ? inside(o, rows, active->validity()) : std::vector<std::size_t>{};
      if (both.size() > kRigidUnknowns) {
        add_without_rigid(candidate_beside, o, both, residuals(o, both, by_fit));
        add_without_rigid(other, o, both, residuals(o, both, [&](std::size_t i) {
                            return predicted_by_model(o, i, *active);
                          }));
      }
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
                         .not_held_out = all_rows - none.rows,
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

}  // namespace abbe::calib::otf
