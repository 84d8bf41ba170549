#include "abbe/calib/internal/mfb/solve/pass_rows.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/estimation/observation_group.hpp"
#include "abbe/calib/internal/geometry/cell_form.hpp"

namespace abbe::calib::mfb {
namespace {

using estimation::kNoPrior;

/// Smaller elements of dO_dtouch are rounding errors; real effects are 0.01 and more.
constexpr double kNoEffect = 1e-12;

/// Adds D_ik times the columns of touch k to row i, for all rows on which the touch has an effect.
void add_touch(RowMajorRows& rows, const Eigen::MatrixXd& D, Eigen::Index k, const Vector3& normal,
               std::span<const Column> columns) {
  std::array<double, kMostCellColumns> along{};
  for (std::size_t j = 0; j < columns.size(); ++j) {
    along[j] = normal.dot(columns[j].dV_dU);
  }
  for (Eigen::Index i = 0; i < D.rows(); ++i) {
    const double d = D(i, k);
    if (std::abs(d) < kNoEffect) {
      continue;
    }
    double* row = rows.row(i).data();
    for (std::size_t j = 0; j < columns.size(); ++j) {
      row[columns[j].parameter] -= d * along[j];
    }
  }
}

/// Converts columns of node values and second derivatives (cell_form.hpp) to columns of the
/// parameters U.
RowMajorRows without_curvatures(const RowMajorRows& cells, const TableBasis& basis) {
  const ParameterLayout& layout = basis.layout();
  RowMajorRows rows =
      RowMajorRows::Zero(cells.rows(), static_cast<Eigen::Index>(layout.model_size()));
  for (const Table& table : layout.tables()) {
    const auto offset = static_cast<Eigen::Index>(table.offset);
    const auto nodes = static_cast<Eigen::Index>(layout.node_count(table.motion.axis));
    rows.middleCols(offset, nodes) = cells.middleCols(2 * offset, nodes);
    for (Eigen::Index i = 0; i < nodes; ++i) {
      const auto M =
          basis.interpolation(table.motion.axis).curvature_row(static_cast<std::size_t>(i));
      for (Eigen::Index row = 0; !M.empty() && row < rows.rows(); ++row) {
        const double curvature = cells(row, 2 * offset + nodes + i);
        double* to = rows.row(row).data() + offset;
        for (std::size_t k = 0; k < M.size(); ++k) {
          to[k] += curvature * M[k];
        }
      }
    }
  }
  constexpr Eigen::Index kSquareness = 3;
  rows.rightCols<kSquareness>() = cells.rightCols<kSquareness>();
  return rows;
}

RowMajorRows model_rows(const Observations& o, const PassObservation& pass) {
  const BarPose& pose = o.positions[pass.position].pose;
  const Vector3& tool_m = o.plan.measurements[pass.measurement].tool_offset_m;
  const auto tables = static_cast<Eigen::Index>(o.basis.layout().squareness_offset());
  RowMajorRows cells = RowMajorRows::Zero(pass.dO_dtouch.rows(), 2 * tables + 3);

  std::array<Column, kMostCellColumns> memory;
  for (std::size_t k = 0; k < pass.touched.size(); ++k) {
    ModelColumns columns(memory);
    append_cell_columns(o.basis, {.q_m = pass.reading_m[k], .tool_offset_m = tool_m}, columns);
    const Vector3 normal = pose.axes * pass.normal[k];
    add_touch(cells, pass.dO_dtouch, static_cast<Eigen::Index>(k), normal, columns.span());
  }
  return without_curvatures(cells, o.basis);
}

/// Matrix (3N x 3): effect on O_i if each touch is displaced by `weight` along each of the three
/// bar axes.
Eigen::MatrixXd displaced(const PassObservation& pass, const Eigen::VectorXd& weight) {
  Eigen::MatrixXd along(std::ssize(pass.touched), 3);
  for (std::size_t k = 0; k < pass.touched.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    along.row(row) = weight(row) * pass.normal[k].transpose();
  }
  return pass.dO_dtouch * along;
}

}  // namespace

std::vector<std::size_t> passes_of(const Observations& o, std::size_t position) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < o.passes.size(); ++i) {
    if (o.passes[i].position == position) {
      found.push_back(i);
    }
  }
  return found;
}

NuisanceLayout nuisance_layout(const Observations& o, std::size_t position,
                               const NuisanceOptions& options) {
  Eigen::Index further_tools = 0, pairs = 0, rates = 0;
  for (const std::size_t i : passes_of(o, position)) {
    const PassObservation& pass = o.passes[i];
    further_tools = std::max(further_tools, static_cast<Eigen::Index>(pass.tool));
    if (pass.pair && options.drift) {
      pairs = std::max(pairs, static_cast<Eigen::Index>(*pass.pair) + 1);
    }
    ++rates;
  }
  if (!(options.u_rate_of_every_pass_m > 0.0)) {
    rates = 0;
  }

  NuisanceLayout layout;
  layout.pairs = layout.tools + 3 * further_tools;
  layout.rates = layout.pairs + 6 * pairs;
  layout.temperature = layout.rates + 3 * rates;
  const bool temperature =
      o.bar.expansion && o.bar.expansion->alpha_per_K != 0.0 && o.plan.noise.u_temperature_K > 0.0;
  layout.size = layout.temperature + (temperature ? 1 : 0);
  layout.u.assign(static_cast<std::size_t>(layout.size), kNoPrior);
  layout.u[kRollUnknown] = options.u_roll_rad;
  std::fill(layout.u.begin() + layout.rates, layout.u.begin() + layout.temperature,
            options.u_rate_of_every_pass_m);
  if (temperature) {
    layout.u.back() = o.plan.noise.u_temperature_K;
  }
  return layout;
}

RowMajorRows shared_rows(const Observations& o, const PassObservation& pass,
                         const SharedUnknowns& shared) {
  RowMajorRows rows(pass.dO_dtouch.rows(), shared.size());
  shared.reduce(model_rows(o, pass), rows.leftCols(shared.parameters()));
  rows.middleCols(shared.bar_offset(), shared.bar_root().cols()) = shared.bar_root();
  if (shared.alphas() > 0) {
    const double warmer_K = pass.temperature_K - kReferenceTemperature_K;
    for (std::size_t i = 0; i < o.bar.O_m.size(); ++i) {
      rows.block<3, 1>(3 * static_cast<Eigen::Index>(i), shared.alpha_offset()) =
          warmer_K * shared.u_alpha_per_K() * o.bar.O_m[i];
    }
  }
  if (shared.temperatures() > 0) {
    for (std::size_t i = 0; i < o.bar.O_m.size(); ++i) {
      rows.block<3, 1>(3 * static_cast<Eigen::Index>(i), shared.temperature_offset()) =
          shared.growth_of_temperature() * o.bar.O_m[i];
    }
  }
  return rows;
}

Eigen::MatrixXd nuisance_rows(const Observations& o, const PassObservation& pass,
                              std::size_t number, const NuisanceLayout& layout,
                              const NuisanceOptions& options) {
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(pass.dO_dtouch.rows(), layout.size);
  const Vector3 middle_m = 0.5 * o.bar.O_m.back();
  const double alpha_per_K = o.bar.expansion ? o.bar.expansion->alpha_per_K : 0.0;
  for (std::size_t i = 0; i < o.bar.O_m.size(); ++i) {
    const auto row = 3 * static_cast<Eigen::Index>(i);
    L.block<3, 3>(row, 0).setIdentity();
    L.block<3, 3>(row, 3) = rotation_effect(o.bar.O_m[i] - middle_m);
    if (pass.tool > 0) {
      L.block<3, 3>(row, layout.tools + 3 * (static_cast<Eigen::Index>(pass.tool) - 1))
          .setIdentity();
    }
    if (pass.pair && options.drift && pass.second_of_pair) {
      L.block<3, 3>(row, layout.pairs + 6 * static_cast<Eigen::Index>(*pass.pair) + 3)
          .setIdentity();
    }
    if (layout.has_temperature()) {
      L.block<3, 1>(row, layout.temperature) = alpha_per_K * o.bar.O_m[i];
    }
  }

  if (pass.pair && options.drift) {
    L.middleCols<3>(layout.pairs + 6 * static_cast<Eigen::Index>(*pass.pair)) =
        displaced(pass, pass.time);
  }
  if (layout.temperature > layout.rates) {
    const Eigen::VectorXd from_middle = pass.time.array() - pass.time.mean();
    L.middleCols<3>(layout.rates + 3 * static_cast<Eigen::Index>(number)) =
        displaced(pass, from_middle);
  }
  return L;
}

}  // namespace abbe::calib::mfb
