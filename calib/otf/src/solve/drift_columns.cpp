#include "solve/drift_columns.hpp"

#include <cmath>

namespace abbe::calib::otf {
namespace {

/// Appends the entries of a row that are not negligible. The prediction from earlier rows decreases
/// with their age, and so do the entries in the columns of earlier knots.
void append_significant(const auto& row, std::vector<SparseRows::Entry>& out) {
  constexpr double kNegligible = 1e-10;
  const double least = kNegligible * row.cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < row.size(); ++k) {
    if (std::abs(row(k)) > least) {
      out.push_back({static_cast<std::size_t>(k), row(k)});
    }
  }
}

}  // namespace

void DriftColumns::append(const Observation& row, Entries& out) const {
  if (offsets_ > 0) {
    out.push_back({0, drow_drange_offset(o_, row)});
  }
  const RigidTransform& T = o_.alignment.T_machine_tracker;
  const Vector3 p_tracker_m = T.R.transpose() * (row.axis_position_m + o_.target_offset_m - T.t_m);
  const Vector3 direction = T.R.transpose() * row.direction;
  const double time_s = o_.drift->segment_s[row.segment];
  basis_.append_along(direction, time_s, p_tracker_m, offsets_, out);
  if (between_ == BetweenKnots::Walk) {
    basis_.append_between_knots(direction, time_s, p_tracker_m, offsets_ + basis_.size(), out);
  }
}

RowMatrix DriftColumns::prewhitened(const WhitenedRows& rows) const {
  RowMatrix columns = RowMatrix::Zero(std::ssize(o_.rows), static_cast<Eigen::Index>(size()));
  Entries entries;
  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    entries.clear();
    append(o_.rows[i], entries);
    for (const SparseRows::Entry& e : entries) {
      columns(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(e.column)) += e.value;
    }
  }
  rows.apply(columns);
  return columns;
}

double DriftColumns::effect_m(const Observation& row, const Eigen::VectorXd& d) const {
  Entries entries;
  append(row, entries);
  double sum_m = 0.0;
  for (const SparseRows::Entry& e : entries) {
    sum_m += e.value * d(static_cast<Eigen::Index>(e.column));
  }
  return sum_m;
}

AddedColumns DriftColumns::sums(const WhitenedRows& rows, std::span<const double> residual_m,
                                const std::function<bool(const Observation&)>& take) const {
  AddedColumns sums(size(), o_.unknowns());
  const std::vector<double> r_m = rows.values(residual_m);
  const RowMatrix columns = rows.are_sums() ? prewhitened(rows) : RowMatrix();
  Entries entries;
  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    if (take && !take(o_.rows[i])) {
      continue;
    }
    entries.clear();
    if (rows.are_sums()) {
      append_significant(columns.row(static_cast<Eigen::Index>(i)), entries);
    } else {
      append(o_.rows[i], entries);
    }
    sums.add(o_.rows[i], rows.row(i), r_m[i], entries);
  }
  return sums;
}

}  // namespace abbe::calib::otf
