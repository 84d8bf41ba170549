#include "abbe/calib/otf/live/moments.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/estimation/sparse_information.hpp"
#include "abbe/calib/otf/run/path_frame.hpp"
#include "observe/rigid_columns.hpp"

namespace abbe::calib::otf {
namespace {

/// Index l p of C_lp, M and G: l (direction e_1 or e_2) is the slower one.
constexpr Eigen::Index kPowers = 3, kRows = 2 * kPowers;
using Matrix6 = Eigen::Matrix<double, kRows, kRows>;

Matrix6 moment_matrix(const CellMoments& moments) {
  Matrix6 M;
  for (Eigen::Index i = 0; i < kRows; ++i) {
    for (Eigen::Index j = 0; j < kRows; ++j) {
      const auto directions = static_cast<std::size_t>(i / kPowers + j / kPowers);
      const auto power = static_cast<std::size_t>(i % kPowers + j % kPowers);
      M(i, j) = moments.weight[directions][power];
    }
  }
  return M;
}

Vector6 moment_vector(const CellMoments& moments) {
  Vector6 G;
  for (Eigen::Index i = 0; i < kRows; ++i) {
    G(i) = moments.deviation[static_cast<std::size_t>(i / kPowers)]
                            [static_cast<std::size_t>(i % kPowers)];
  }
  return G;
}

/// Cholesky factor L of a positive semidefinite M = L L^T (fewer than three samples give a singular
/// M). A column of L is set to zero if its Schur complement is only rounding of M.
Matrix6 semidefinite_cholesky(const Matrix6& M) {
  constexpr double kRounding = 1e-13;
  Matrix6 L = Matrix6::Zero();
  for (Eigen::Index j = 0; j < kRows; ++j) {
    const double pivot = M(j, j) - L.row(j).head(j).squaredNorm();
    if (!(pivot > kRounding * M(j, j))) {
      continue;
    }
    L(j, j) = std::sqrt(pivot);
    for (Eigen::Index i = j + 1; i < kRows; ++i) {
      L(i, j) = (M(i, j) - L.row(i).head(j).dot(L.row(j).head(j))) / L(j, j);
    }
  }
  return L;
}

/// L^-1 G; zero where the column of L is zero.
Vector6 forward_substitution(const Matrix6& L, const Vector6& G) {
  Vector6 y = Vector6::Zero();
  for (Eigen::Index j = 0; j < kRows; ++j) {
    if (L(j, j) > 0.0) {
      y(j) = (G(j) - L.row(j).head(j).dot(y.head(j))) / L(j, j);
    }
  }
  return y;
}

/// Coefficients of x^0, x^1 and x^2 of a polynomial from its values at x = -1/2, 0 and 1/2.
Vector3 coefficients(double before, double centre, double after) {
  return {centre, after - before, 2.0 * (after + before - 2.0 * centre)};
}

/// Distances from the begin of the leg at which an axis passes an inner node of its tables.
void append_crossings(std::vector<double>& crossing_m, const AxisNodes& nodes, double from_m,
                      double direction, double length_m) {
  if (direction == 0.0) {
    return;
  }
  for (std::size_t i = 1; i + 1 < nodes.nodes_m.size(); ++i) {
    const double along_m = (nodes.nodes_m[i] - from_m) / direction;
    if (along_m > 0.0 && along_m < length_m) {
      crossing_m.push_back(along_m);
    }
  }
}

std::vector<double> crossings(const MachineNodes& nodes, const Vector3& from_m,
                              const Vector3& direction, double length_m) {
  std::vector<double> crossing_m{0.0};
  for (const Axis a : kAllAxes) {
    const auto i = static_cast<Eigen::Index>(index(a));
    append_crossings(crossing_m, nodes[index(a)], from_m(i), direction(i), length_m);
  }
  std::sort(crossing_m.begin(), crossing_m.end());
  crossing_m.push_back(length_m);

  // A diagonal passes nodes of two axes at the same place, within rounding of a length of metres.
  constexpr double kSamePlace_m = 1e-12;
  const auto same = [](double a, double b) { return b - a < kSamePlace_m; };
  crossing_m.erase(std::unique(crossing_m.begin(), crossing_m.end(), same), crossing_m.end());
  return crossing_m;
}

}  // namespace

Result<MomentAccumulator> MomentAccumulator::of(Setup setup) {
  for (const Axis a : kAllAxes) {
    const Interpolation kind = setup.basis.interpolation(a).kind();
    if (kind != Interpolation::Linear) {
      return failure(ErrorCode::NotApplicable,
                     message("moments of samples: the tables of axis ", letter(a), " are ",
                             name(kind), ", must be linear"));
    }
  }

  const Noise& noise = setup.noise;
  if (!(noise.sigma_range_m > 0.0) || !(noise.sigma_angle_rad > 0.0)) {
    return failure(
        ErrorCode::BadInput,
        message("moments of samples: sigma_range ", noise.sigma_range_m, " m, sigma_angle ",
                noise.sigma_angle_rad, " rad: both must be positive"));
  }

  return MomentAccumulator(std::move(setup));
}

MomentAccumulator::MomentAccumulator(Setup setup)
    : setup_(std::move(setup)),
      in_R_(setup_.basis.size() + kRigidUnknowns + (setup_.range_offset ? 1 : 0)) {
  state_.tool_offset_m = setup_.target_offset_m;
}

void MomentAccumulator::begin_leg(const Vector3& from_m, const Vector3& to_m) {
  for (Cell& cell : cells_) {
    close(cell);
  }

  const Vector3 way_m = to_m - from_m;
  // Any two directions across the leg can be used. path_frame() with a beam along the leg gives
  // them.
  const PathFrame frame = path_frame(way_m, way_m, setup_.noise);
  leg_.from_m = from_m;
  leg_.length_m = way_m.norm();
  leg_.direction = frame.a1;
  leg_.e1 = frame.a2;
  leg_.e2 = frame.a3;
  leg_.crossing_m = crossings(setup_.basis.layout().nodes(), from_m, leg_.direction, leg_.length_m);

  state_.travel = travel_after(state_.travel, way_m);
}

void MomentAccumulator::add(const Vector3& p_tracker_m) {
  const Vector3 beam_m = setup_.T_machine_tracker.R * p_tracker_m;
  const Vector3 from_begin_m =
      beam_m + setup_.T_machine_tracker.t_m - setup_.target_offset_m - leg_.from_m;
  const double along_m = leg_.direction.dot(from_begin_m);
  if (!(along_m >= setup_.corner_m && leg_.length_m - along_m >= setup_.corner_m)) {
    return;
  }

  // a2 is the direction of the component of the beam across the leg, (b1, b2) / |(b1, b2)| in e_1
  // and e_2.
  const double b1 = leg_.e1.dot(beam_m), b2 = leg_.e2.dot(beam_m);
  const double across2 = b1 * b1 + b2 * b2, range2 = beam_m.squaredNorm();
  const double sigma_angle2 = setup_.noise.sigma_angle_rad * setup_.noise.sigma_angle_rad;
  const double sigma_range2 = setup_.noise.sigma_range_m * setup_.noise.sigma_range_m;
  const double cosine2 = across2 / range2;
  const double w3 = 1.0 / (sigma_angle2 * range2);
  const double w2 = 1.0 / (sigma_range2 * cosine2 + sigma_angle2 * range2 * (1.0 - cosine2));
  // If the beam is along the leg, both directions have the same weight, and a2 is arbitrary.
  const double per_across = across2 > 0.0 ? (w2 - w3) / across2 : 0.0;
  const std::array w{w3 + per_across * b1 * b1, per_across * b1 * b2, w3 + per_across * b2 * b2};
  const double r1 = leg_.e1.dot(from_begin_m), r2 = leg_.e2.dot(from_begin_m);
  const double wr1 = w[0] * r1 + w[1] * r2, wr2 = w[1] * r1 + w[2] * r2;

  Cell& cell = cell_with(along_m);
  CellMoments& sums = cell.moments;
  const double x = (along_m - cell.centre_m) / cell.half_m;
  const double x2 = x * x;
  const std::array power{1.0, x, x2, x2 * x, x2 * x2};
  for (std::size_t k = 0; k < w.size(); ++k) {
    for (std::size_t p = 0; p < power.size(); ++p) {
      sums.weight[k][p] += w[k] * power[p];
    }
  }
  for (std::size_t p = 0; p < sums.deviation[0].size(); ++p) {
    sums.deviation[0][p] += wr1 * power[p];
    sums.deviation[1][p] += wr2 * power[p];
  }
  sums.chi2 += r1 * wr1 + r2 * wr2;
  ++sums.samples;
  ++samples_;
}

bool MomentAccumulator::contains(const Cell& cell, double along_m) const {
  return cell.number != kNone && along_m >= leg_.crossing_m[cell.number] &&
         along_m < leg_.crossing_m[cell.number + 1];
}

MomentAccumulator::Cell& MomentAccumulator::cell_with(double along_m) {
  if (contains(cells_[current_], along_m)) {
    return cells_[current_];
  }

  current_ = 1 - current_;
  Cell& cell = cells_[current_];
  if (!contains(cell, along_m)) {
    close(cell);
    const auto end =
        std::upper_bound(leg_.crossing_m.begin() + 1, leg_.crossing_m.end() - 1, along_m);
    cell.number = static_cast<std::size_t>(end - leg_.crossing_m.begin()) - 1;
    cell.centre_m = 0.5 * (*end + *(end - 1));
    cell.half_m = 0.5 * (*end - *(end - 1));
  }
  return cell;
}

std::vector<MomentAccumulator::PolynomialColumn> MomentAccumulator::columns_in(
    const Cell& cell) const {
  std::array<std::vector<Column>, kPowers> at;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const double x = 0.5 * (static_cast<double>(i) - 1.0);
    MachineState state = state_;
    state.q_m = leg_.from_m + (cell.centre_m + x * cell.half_m) * leg_.direction;
    at[i].resize(setup_.basis.most_columns() + kRigidUnknowns + 1);
    ModelColumns columns(at[i]);
    setup_.basis.append_columns(state, columns);
    const Vector3 p_m = state.q_m + setup_.target_offset_m;
    append_rigid_columns(columns, setup_.basis.size(), p_m);
    if (setup_.range_offset) {
      const Vector3 beam_m = p_m - setup_.T_machine_tracker.t_m;
      columns.push(setup_.basis.size() + kRigidUnknowns, beam_m.normalized());
    }
    at[i].resize(columns.size());
  }

  // Within a cell the non-zero columns are those of the same unknowns at every x.
  std::vector<PolynomialColumn> polynomials;
  polynomials.reserve(at[0].size());
  for (std::size_t k = 0; k < at[0].size(); ++k) {
    const auto along = [&](const Vector3& e) {
      return coefficients(e.dot(at[0][k].dV_dU), e.dot(at[1][k].dV_dU), e.dot(at[2][k].dV_dU));
    };
    PolynomialColumn& column = polynomials.emplace_back();
    column.unknown = at[0][k].parameter;
    column.C << along(leg_.e1), along(leg_.e2);
  }
  return polynomials;
}

void MomentAccumulator::append_rows(const Cell& cell, WaitingRows& to) const {
  if (cell.moments.samples == 0) {
    return;
  }

  const std::vector<PolynomialColumn> polynomials = columns_in(cell);
  const Matrix6 L = semidefinite_cholesky(moment_matrix(cell.moments));
  const Vector6 y = forward_substitution(L, moment_vector(cell.moments));
  std::size_t rows = 0;
  std::vector<estimation::RowEntry> row;
  for (Eigen::Index j = 0; j < kRows; ++j) {
    if (L(j, j) > 0.0) {
      row.clear();
      for (const PolynomialColumn& column : polynomials) {
        row.push_back({column.unknown, L.col(j).dot(column.C)});
      }
      to.A.append(row);
      to.y.push_back(y(j));
      ++rows;
    }
  }

  to.rest += std::max(0.0, cell.moments.chi2 - y.squaredNorm());
  to.removed_rows += 2 * cell.moments.samples - rows;
  ++to.cells;
}

void MomentAccumulator::WaitingRows::add_to(estimation::Information& information) const {
  std::vector<estimation::WeightedRow> rows;
  rows.reserve(y.size());
  for (std::size_t i = 0; i < y.size(); ++i) {
    rows.push_back({A.row(i), y[i], 1.0});
  }
  information += estimation::information_of(information.unknowns(), rows);
  information.add_rest(rest, removed_rows);
}

void MomentAccumulator::close(Cell& cell) {
  append_rows(cell, waiting_);
  cell = {};
  if (waiting_.cells >= WaitingRows::kMostCells) {
    waiting_.add_to(in_R_);
    within_R_.chi2 += waiting_.rest;
    within_R_.rows += waiting_.removed_rows;
    waiting_ = {};
  }
}

MomentAccumulator::WithinCells MomentAccumulator::within_cells() const {
  WaitingRows open;
  for (const Cell& cell : cells_) {
    append_rows(cell, open);
  }
  return {within_R_.chi2 + waiting_.rest + open.rest,
          within_R_.rows + waiting_.removed_rows + open.removed_rows};
}

estimation::Information MomentAccumulator::information() const {
  WaitingRows rows = waiting_;
  for (const Cell& cell : cells_) {
    append_rows(cell, rows);
  }
  estimation::Information all = in_R_;
  rows.add_to(all);
  return all;
}

}  // namespace abbe::calib::otf
