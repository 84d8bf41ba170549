#include "otf/drift_columns.hpp"

#include <algorithm>

namespace abbe::calib::otf {

void DriftColumns::append(const Observation& row, Entries& out) const {
  if (offsets_ > 0) {
    out.push_back({0, drow_drange_offset(o_, row)});
  }
  const RigidTransform& T = o_.alignment.T_machine_tracker;
  const Vector3 p_tracker_m = T.R.transpose() * (row.axis_position_m + o_.target_offset_m - T.t_m);
  const Vector3 direction = T.R.transpose() * row.direction;
  const double time_s = o_.drift->block_s[row.block];
  basis_.append_along(direction, time_s, p_tracker_m, offsets_, out);
  if (between_ == BetweenKnots::Walk) {
    basis_.append_between_knots(direction, time_s, p_tracker_m, offsets_ + basis_.size(), out);
  }
}

void DriftColumns::append_sum(std::span<const WhitenedRows::Term> terms, Entries& out) const {
  for (const WhitenedRows::Term& term : terms) {
    const std::size_t first = out.size();
    append(o_.rows[term.row], out);
    for (std::size_t i = first; i < out.size(); ++i) {
      out[i].value *= term.factor;
    }
  }

  std::stable_sort(out.begin(), out.end(),
                   [](const auto& a, const auto& b) { return a.column < b.column; });
  std::size_t kept = 0;
  for (std::size_t i = 1; i < out.size(); ++i) {
    if (out[i].column == out[kept].column) {
      out[kept].value += out[i].value;
    } else {
      out[++kept] = out[i];
    }
  }
  out.resize(std::min(kept + 1, out.size()));
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
  Entries entries;
  for (std::size_t i = 0; i < o_.rows.size(); ++i) {
    if (take && !take(o_.rows[i])) {
      continue;
    }
    entries.clear();
    if (rows.are_sums()) {
      append_sum(rows.terms(i), entries);
    } else {
      append(o_.rows[i], entries);
    }
    const double r_m = rows.value(i, [&](std::size_t row) { return residual_m[row]; });
    sums.add(o_.rows[i], rows.row(i), r_m, entries);
  }
  return sums;
}

}  // namespace abbe::calib::otf
