#pragma once
/// Rows of a run that a fit did not use: selects the legs that may be held out, and computes the
/// residuals that remain after removal of the best-fit rigid motion (judge.hpp).

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <span>
#include <vector>

#include "abbe/calib/otf/judge/judge.hpp"

namespace abbe::calib::otf {

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

/// Entries of the six rigid unknowns in a row of the design.
inline Vector6 rigid_row(const Observations& o, std::size_t row) {
  Vector6 r = Vector6::Zero();
  for (const SparseRows::Entry& e : o.A.row(row)) {
    if (e.column >= o.rigid_offset() && e.column < o.clock_offset()) {
      r(static_cast<Eigen::Index>(e.column - o.rigid_offset())) = e.value;
    }
  }
  return r;
}

/// Removes the best-fit rigid motion from the residuals of the held-out rows and adds the squares
/// of the remaining residuals to `total`. Returns the remaining residuals [m].
inline std::vector<double> add_without_rigid(Remainder& total, const Observations& o,
                                             std::span<const std::size_t> rows,
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
  std::vector<double> left_m;
  left_m.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double rest_m = residual_m[i] - rigid_row(o, rows[i]).dot(rigid);
    left_m.push_back(rest_m);
    const double whitened = rest_m / o.rows[rows[i]].sigma_m;
    total.whitened_squares += whitened * whitened;
    total.squares_m2 += rest_m * rest_m;
  }

  total.rows += rows.size();
  return left_m;
}

/// Prediction of y by a model, averaged over the sub-points of the row, as the row is. The model
/// may have other nodes than the design, so the row of the design cannot be used.
inline double predicted_by_model(const Observations& o, std::size_t row,
                                 const VolumetricModel& model) {
  const Observation& r = o.rows[row];
  Vector3 sum = Vector3::Zero();
  for (std::size_t k = 0; k < r.sub_points; ++k) {
    sum += model.V_at(o.sub_points_m[r.first_sub_point + k], o.target_offset_m);
  }
  return r.direction.dot(sum) / static_cast<double>(r.sub_points);
}

/// The rows whose sub-points are all inside the validity volume of a model.
inline std::vector<std::size_t> rows_inside(const Observations& o,
                                            std::span<const std::size_t> rows,
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
std::vector<double> residuals_of_rows(const Observations& o, std::span<const std::size_t> rows,
                                      Prediction predicted_m) {
  std::vector<double> r;
  r.reserve(rows.size());
  for (const std::size_t row : rows) {
    r.push_back(o.rows[row].y_m - predicted_m(row));
  }
  return r;
}

/// Sums over the held-out rows of all folds: without compensation, by the candidate, and by another
/// model (the active one) with the candidate on the same rows.
struct HeldOutSums {
  Remainder none, candidate, candidate_beside_other, other;

  /// Adds the held-out `rows` of a fold. `predicted_m(row)`: the prediction of the candidate, which
  /// was not fitted to `rows`. `left(row, none_m, candidate_m)` is called with the remaining
  /// residuals of each row. `effect_m(row)`: effect of the run on y of the row that no model
  /// predicts.
  template <class Prediction, class Left, class Effect = double (*)(std::size_t)>
  void add(
      const Observations& o, std::span<const std::size_t> rows, Prediction predicted_m,
      const VolumetricModel* other_model, Left left,
      Effect effect_m = [](std::size_t) { return 0.0; }) {
    // So few rows are not used: a best-fit rigid motion would fit them exactly, because it has as
    // many unknowns.
    if (rows.size() <= kRigidUnknowns) {
      return;
    }
    const std::vector<double> none_m =
        add_without_rigid(none, o, rows, residuals_of_rows(o, rows, effect_m));
    const auto with_effect_m = [&](std::size_t row) { return predicted_m(row) + effect_m(row); };
    const std::vector<double> candidate_m =
        add_without_rigid(candidate, o, rows, residuals_of_rows(o, rows, with_effect_m));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      left(rows[i], none_m[i], candidate_m[i]);
    }

    if (other_model == nullptr || !other_model->holds_for_tool(o.target_offset_m)) {
      return;
    }
    const std::vector<std::size_t> both = rows_inside(o, rows, other_model->validity());
    if (both.size() > kRigidUnknowns) {
      add_without_rigid(candidate_beside_other, o, both, residuals_of_rows(o, both, with_effect_m));
      add_without_rigid(other, o, both, residuals_of_rows(o, both, [&](std::size_t row) {
                          return predicted_by_model(o, row, *other_model) + effect_m(row);
                        }));
    }
  }

  [[nodiscard]] HeldOutFigures figures(std::size_t all_rows) const {
    HeldOutFigures f{.no_compensation = none.rms(),
                     .candidate = candidate.rms(),
                     .observations = none.rows,
                     .not_held_out = all_rows - none.rows,
                     .no_compensation_rms_m = none.rms_m(),
                     .candidate_rms_m = candidate.rms_m()};
    if (other.rows > 0) {
      f.active = other.rms();
      f.active_rms_m = other.rms_m();
      f.candidate_beside_active = candidate_beside_other.rms();
      f.observations_beside_active = other.rows;
    }
    return f;
  }
};

/// Marks the legs of the fold that observe a parameter without observations in the other folds.
/// `linear`: the observations with linear tables, where only the nodes of a cell occur in a row.
inline std::vector<bool> legs_needed(const Observations& linear, std::size_t fold,
                                     std::size_t folds) {
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

inline bool has_linear_tables(const TableBasis& basis) {
  return std::all_of(kAllAxes.begin(), kAllAxes.end(), [&](Axis a) {
    return basis.interpolation(a).kind() == Interpolation::Linear;
  });
}

/// The observations with linear tables on the same nodes.
inline Observations with_linear_tables(const Observations& o) {
  return with_basis(o, *TableBasis::of(o.layout(), {.travel = o.basis.travel()}));
}

}  // namespace abbe::calib::otf
