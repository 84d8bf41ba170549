#include "abbe/calib/model_update.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/model_drift.hpp"
#include "axis_scale_columns.hpp"
#include "gauge_coordinates.hpp"
#include "misfit_in_V.hpp"
#include "message.hpp"

namespace abbe::calib {
namespace {

bool has_group(const GaugeCoordinates& c, const std::string& table) {
  return std::any_of(c.groups.begin(), c.groups.end(),
                     [&](const GaugeGroup& group) { return group.name == table; });
}

Result<void> check_update_options(const UpdateOptions& o, const GaugeCoordinates& c) {
  // This form of the conditions refuses NaN.
  if (!(o.forgetting > 0.0 && o.forgetting <= 1.0)) {
    return failure(ErrorCode::BadInput,
                   message("update: forgetting ", o.forgetting, " must be in (0, 1]"));
  }

  const double least =
      std::min({o.days, o.length_m_per_root_day, o.angle_rad_per_root_day, o.u_scale,
                o.u_axis_scale[0], o.u_axis_scale[1], o.u_axis_scale[2]});
  if (!(least >= 0.0) || !std::isfinite(o.days)) {
    return failure(ErrorCode::BadInput,
                   "update: days, process noise and uncertainties must not be negative");
  }

  for (const TableNoise& noise : o.of_tables) {
    if (!has_group(c, noise.table) || !(noise.per_root_day >= 0.0)) {
      return failure(ErrorCode::BadInput,
                     message("update: process noise ", noise.per_root_day, " of ", noise.table,
                             ": unknown table, or negative"));
    }
  }

  for (const std::string& table : o.renewed) {
    if (!has_group(c, table)) {
      return failure(ErrorCode::BadInput, message("update: the models have no table ", table));
    }
  }

  return {};
}

double process_noise(const GaugeGroup& group, const UpdateOptions& o) {
  const auto own = std::find_if(o.of_tables.begin(), o.of_tables.end(),
                                [&](const TableNoise& noise) { return noise.table == group.name; });
  const double of_all = group.is_angle() ? o.angle_rad_per_root_day : o.length_m_per_root_day;
  return std::sqrt(o.days) * (own == o.of_tables.end() ? of_all : own->per_root_day);
}

/// Q of one table: q^2 (I + s s^T), s: its smooth change; q^2 for squareness.
void add_process_noise(Eigen::MatrixXd& C, const GaugeCoordinates& c, const ParameterLayout& layout,
                       const UpdateOptions& o) {
  for (const GaugeGroup& group : c.groups) {
    const double q = process_noise(group, o);
    auto of_group = C.block(group.first, group.first, group.size, group.size);
    of_group.diagonal().array() += q * q;
    if (group.motion) {
      Eigen::VectorXd shape = Eigen::VectorXd::Zero(c.N.rows());
      shape.segment(group.offset, group.count) = q * smooth_change(group, layout);
      const Eigen::VectorXd s = c.of_group(group, shape);
      of_group += s * s.transpose();
    }
  }
}

/// Columns G: a relative error of all ranges changes all positioning tables with slope 1, one of the
/// scale of an axis that of this axis.
Eigen::MatrixXd common_part(const GaugeCoordinates& c, const ParameterLayout& layout,
                            const UpdateOptions& o) {
  const Eigen::MatrixX3d of_axis = axis_scale_columns(layout);
  Eigen::MatrixX4d G(of_axis.rows(), 4);
  G << of_axis * Vector3(o.u_axis_scale[0], o.u_axis_scale[1], o.u_axis_scale[2]).asDiagonal(),
      o.u_scale * of_axis.rowwise().sum();
  return c.N.transpose() * G;
}

/// Adds the rows W e = W e_model of one model for the coordinates `kept`, both divided by `scale`.
Result<void> add_model(estimation::Information& sum, const Eigen::MatrixXd& C,
                       const Eigen::VectorXd& e, const Eigen::VectorXd& scale,
                       const std::vector<Eigen::Index>& kept, std::string_view which) {
  const Eigen::VectorXd s = scale(kept);
  const Eigen::MatrixXd scaled =
      s.cwiseInverse().asDiagonal() * C(kept, kept) * s.cwiseInverse().asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> factor(scaled);
  if (factor.info() != Eigen::Success) {
    return failure(ErrorCode::NotApplicable,
                   message("update: the covariance of the ", which,
                           " model is not larger than the part common to all runs, or leaves a "
                           "combination of parameters without uncertainty"));
  }

  const Eigen::Index n = std::ssize(kept);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, C.cols());
  const Eigen::MatrixXd whitening = factor.matrixL().solve(Eigen::MatrixXd::Identity(n, n));
  A(Eigen::all, kept) = whitening;
  sum.add_rows(A, whitening * e(kept).cwiseQuotient(s));
  return {};
}

std::vector<Eigen::Index> free_coordinates_of(const GaugeCoordinates& c,
                                              const std::vector<std::string>& without) {
  std::vector<Eigen::Index> kept;
  for (const GaugeGroup& group : c.groups) {
    const bool out = std::find(without.begin(), without.end(), group.name) != without.end();
    for (Eigen::Index k = 0; !out && k < group.size; ++k) {
      kept.push_back(group.first + k);
    }
  }
  return kept;
}

}  // namespace

Result<VolumetricModel> update_model(const VolumetricModel& previous, const VolumetricModel& run,
                                     const UpdateOptions& options) {
  if (Result<void> same = check_same_parameters(previous, run); !same) {
    return tl::unexpected(same.error());
  }

  if (previous.travel() != nullptr || run.travel() != nullptr) {
    return failure(ErrorCode::NotApplicable,
                   message("update: the ", run.travel() == nullptr ? "previous" : "new",
                           " model depends on the direction of travel, which an update does not "
                           "contain; use the new model, or identify both without backlash"));
  }

  const ParameterLayout& layout = run.tables()->layout();
  const GaugeCoordinates c = gauge_coordinates(*run.tables());
  if (Result<void> valid = check_update_options(options, c); !valid) {
    return tl::unexpected(valid.error());
  }

  const Eigen::MatrixXd& N = c.N;
  const Eigen::MatrixXd G = common_part(c, layout, options);
  const Eigen::MatrixXd common = G * G.transpose();
  const Eigen::MatrixXd C_run = N.transpose() * run.covariance() * N - common;
  Eigen::MatrixXd C_previous =
      (N.transpose() * previous.covariance() * N - common) / options.forgetting;
  add_process_noise(C_previous, c, layout, options);

  const Eigen::VectorXd scale = C_run.diagonal().unaryExpr(
      [](double variance) { return variance > 0.0 ? std::sqrt(variance) : 1.0; });
  estimation::Information sum(static_cast<std::size_t>(scale.size()));
  Result<void> added = add_model(sum, C_previous, N.transpose() * previous.U(), scale,
                                 free_coordinates_of(c, options.renewed), "previous");
  if (added) {
    added =
        add_model(sum, C_run, N.transpose() * run.U(), scale, free_coordinates_of(c, {}), "new");
  }
  if (!added) {
    return tl::unexpected(added.error());
  }

  const Eigen::MatrixXd R = sum.R();
  const auto T = R.triangularView<Eigen::Upper>();
  const Eigen::Index n = scale.size();
  const Eigen::MatrixXd N_scaled = N * scale.asDiagonal();
  const Eigen::MatrixXd root = N_scaled * T.solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd N_G = N * G;
  const Eigen::VectorXd U = N_scaled * T.solve(sum.z());
  const Eigen::MatrixXd covariance = root * root.transpose() + N_G * N_G.transpose();

  return VolumetricModel::from_vector(
             *run.tables(), run.gauge(), run.tool_offsets_m(), U, covariance,
             options.renewed.empty() ? previous.validity() : run.validity())
      .and_then([&](const VolumetricModel& updated) {
        return updated.with_misfit(larger_misfit(previous.misfit(), run.misfit()));
      });
}

}  // namespace abbe::calib
