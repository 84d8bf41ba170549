#include "abbe/calib/model/model_update.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/internal/model/offset_of_data.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

bool has_group(const DatumCoordinates& c, const std::string& table) {
  return std::any_of(c.groups.begin(), c.groups.end(),
                     [&](const DatumGroup& group) { return group.name == table; });
}

Result<void> check_update_options(const UpdateOptions& o, const DatumCoordinates& c) {
  // Written with a negation so that NaN is refused.
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

double process_noise(const DatumGroup& group, const UpdateOptions& o) {
  const auto own = std::find_if(o.of_tables.begin(), o.of_tables.end(),
                                [&](const TableNoise& noise) { return noise.table == group.name; });
  const double of_all = group.is_angle() ? o.angle_rad_per_root_day : o.length_m_per_root_day;
  return std::sqrt(o.days) * (own == o.of_tables.end() ? of_all : own->per_root_day);
}

/// Adds the process noise Q of each table: q^2 (I + s s^T), s: smooth change of the table. For
/// squareness q^2.
void add_process_noise(Eigen::MatrixXd& C, const DatumCoordinates& c, const ParameterLayout& layout,
                       const UpdateOptions& o) {
  for (const DatumGroup& group : c.groups) {
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

/// The range offset of a model in the coordinates e; nullopt: the model does not share its offset.
struct OffsetInCoordinates {
  const OffsetInModel* of_model = nullptr;
  Eigen::VectorXd g;  ///< the vector N^T dU_dd
};
std::optional<OffsetInCoordinates> in_coordinates(const std::optional<OffsetInModel>& offset,
                                                  const Eigen::MatrixXd& N) {
  return offset ? std::optional(OffsetInCoordinates{&*offset, N.transpose() * offset->dU_dd})
                : std::nullopt;
}

Result<void> check_offsets(const ModelWithOffset& previous, const ModelWithOffset& run) {
  for (const ModelWithOffset* m : {&previous, &run}) {
    const auto& o = m->range_offset;
    if (o && !(o->u_m > 0.0 && o->u_prior_m > 0.0 && std::isfinite(o->value_m) &&
               o->dU_dd.size() == m->model.U().size() && o->dU_dd.allFinite())) {
      return failure(
          ErrorCode::BadInput,
          message("update: the range offset of a model has ", o->dU_dd.size(), " derivatives for ",
                  m->model.U().size(), " parameters, or no standard uncertainty"));
    }
  }
  if (!previous.range_offset || !run.range_offset) {
    return {};
  }

  constexpr double kSame = 4.0;  // limit in standard uncertainties of the difference
  const OffsetInModel& before = *previous.range_offset;
  const std::optional<OffsetOfData> now = of_data(*run.range_offset);
  if (now &&
      !(std::abs(now->value_m - before.value_m) < kSame * std::hypot(now->u_m, before.u_m))) {
    return failure(
        ErrorCode::NotApplicable,
        message(
            "update: the range offset of this place of the tracker was ", kUmPerM * before.value_m,
            " um (u ", kUmPerM * before.u_m, " um), the run states ", kUmPerM * now->value_m,
            " um (u ", kUmPerM * now->u_m,
            " um). If the tracker was moved, got a new home position or another reflector, give "
            "the place a new name"));
  }
  return {};
}

/// Columns of G (model_update.hpp). A relative error of all ranges changes all positioning tables
/// by a line of slope 1; a relative error of the scale of one axis changes the table of this axis.
Eigen::MatrixXd common_part(const DatumCoordinates& c, const ParameterLayout& layout,
                            const UpdateOptions& o) {
  const Eigen::MatrixX3d of_axis = axis_scale_columns(layout);
  Eigen::MatrixX4d G(of_axis.rows(), 4);
  G << of_axis * Vector3(o.u_axis_scale[0], o.u_axis_scale[1], o.u_axis_scale[2]).asDiagonal(),
      o.u_scale * of_axis.rowwise().sum();
  return c.N.transpose() * G;
}

/// The adjustment of an update. Unknowns: the coordinates e, divided by `scale`, then d / d_scale.
class Update {
 public:
  Update(Eigen::VectorXd scale, double d_scale_m)
      : scale_(std::move(scale)),
        d_scale_m_(d_scale_m),
        sum_(static_cast<std::size_t>(scale_.size()) + 1) {}

  /// Adds the rows W (e + g d) = W (e_model + g value) of one model for the coordinates `kept`.
  Result<void> add_model(const Eigen::MatrixXd& C, const Eigen::VectorXd& e,
                         const std::optional<OffsetInCoordinates>& offset,
                         const std::vector<Eigen::Index>& kept, std::string_view which) {
    const Eigen::VectorXd s = scale_(kept);
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
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, scale_.size() + 1);
    const Eigen::MatrixXd whitening = factor.matrixL().solve(Eigen::MatrixXd::Identity(n, n));
    A(Eigen::all, kept) = whitening;
    Eigen::VectorXd at_d0 = e;
    if (offset) {
      A.col(scale_.size()) = whitening * offset->g(kept).cwiseQuotient(s) * d_scale_m_;
      at_d0 += offset->g * offset->of_model->value_m;
    }
    sum_.add_rows(A, whitening * at_d0(kept).cwiseQuotient(s));
    return {};
  }

  /// Adds the observation d = value with the standard uncertainty u.
  void add_offset(double value_m, double u_m) {
    Eigen::MatrixXd row = Eigen::MatrixXd::Zero(1, scale_.size() + 1);
    row(0, scale_.size()) = d_scale_m_ / u_m;
    sum_.add_rows(row, Eigen::VectorXd::Constant(1, value_m / u_m));
  }

  struct Solution {
    Eigen::VectorXd x;     ///< coordinates e, then d
    Eigen::MatrixXd root;  ///< root of their covariance
  };
  [[nodiscard]] Solution solve() const {
    const Eigen::Index n = scale_.size() + 1;
    Eigen::VectorXd scale(n);
    scale << scale_, d_scale_m_;
    const Eigen::MatrixXd R = sum_.R();
    const auto T = R.triangularView<Eigen::Upper>();
    return {scale.asDiagonal() * T.solve(sum_.z()),
            scale.asDiagonal() * T.solve(Eigen::MatrixXd::Identity(n, n))};
  }

 private:
  Eigen::VectorXd scale_;
  double d_scale_m_;
  estimation::Information sum_;
};

std::vector<Eigen::Index> free_coordinates_of(const DatumCoordinates& c,
                                              const std::vector<std::string>& without) {
  std::vector<Eigen::Index> kept;
  for (const DatumGroup& group : c.groups) {
    const bool out = std::find(without.begin(), without.end(), group.name) != without.end();
    for (Eigen::Index k = 0; !out && k < group.size; ++k) {
      kept.push_back(group.first + k);
    }
  }
  return kept;
}

}  // namespace

Result<ModelWithOffset> update_model(const ModelWithOffset& before, const ModelWithOffset& now,
                                     const UpdateOptions& options) {
  const VolumetricModel &previous = before.model, &run = now.model;
  ABBE_TRY(check_same_parameters(previous, run));

  if (previous.travel() != nullptr || run.travel() != nullptr) {
    return failure(ErrorCode::NotApplicable,
                   message("update: the ", run.travel() == nullptr ? "previous" : "new",
                           " model depends on the direction of travel, which an update does not "
                           "contain; use the new model, or identify both without backlash"));
  }

  const ParameterLayout& layout = run.tables()->layout();
  const DatumCoordinates c = datum_coordinates(*run.tables());
  ABBE_TRY(check_update_options(options, c));
  ABBE_TRY(check_offsets(before, now));

  const Eigen::MatrixXd& N = c.N;
  const Eigen::MatrixXd G = common_part(c, layout, options);
  const auto of_run = in_coordinates(now.range_offset, N);
  // If the run states no offset, the offset of the previous model belongs to another tracker place
  // and is not used.
  const auto of_previous = of_run ? in_coordinates(before.range_offset, N) : std::nullopt;
  const auto given_common = [&](const VolumetricModel& model,
                                const std::optional<OffsetInCoordinates>& offset) {
    Eigen::MatrixXd C = N.transpose() * model.covariance() * N - G * G.transpose();
    if (offset) {
      C -= offset->of_model->u_m * offset->of_model->u_m * offset->g * offset->g.transpose();
    }
    return C;
  };
  const Eigen::MatrixXd C_run = given_common(run, of_run);
  Eigen::MatrixXd C_previous = given_common(previous, of_previous) / options.forgetting;
  add_process_noise(C_previous, c, layout, options);

  const double d_scale_m = of_run ? now.range_offset->u_prior_m : 1.0;
  Update update(C_run.diagonal().unaryExpr(
                    [](double variance) { return variance > 0.0 ? std::sqrt(variance) : 1.0; }),
                d_scale_m);
  Result<void> added = update.add_model(C_previous, N.transpose() * previous.U(), of_previous,
                                        free_coordinates_of(c, options.renewed), "previous");
  if (added) {
    added =
        update.add_model(C_run, N.transpose() * run.U(), of_run, free_coordinates_of(c, {}), "new");
  }
  ABBE_TRY(added);
  update.add_offset(0.0, of_previous ? before.range_offset->u_prior_m : d_scale_m);
  const auto add_data = [&](const OffsetInModel& offset, double factor) {
    if (const std::optional<OffsetOfData> data = of_data(offset)) {
      update.add_offset(data->value_m, data->u_m / std::sqrt(factor));
    }
  };
  if (of_previous) {
    add_data(*before.range_offset, options.forgetting);
  }
  if (of_run) {
    add_data(*now.range_offset, 1.0);
  }

  const auto [x, root] = update.solve();
  const Eigen::Index n = N.cols();
  const Eigen::MatrixXd N_root = N * root.topRows(n), N_G = N * G;
  const Eigen::MatrixXd covariance = N_root * N_root.transpose() + N_G * N_G.transpose();
  std::optional<OffsetInModel> offset;
  if (of_run) {
    const double variance_m2 = root.row(n).squaredNorm();
    offset = OffsetInModel{.dU_dd = -(N_root * root.row(n).transpose()) / variance_m2,
                           .value_m = x(n),
                           .u_m = std::sqrt(variance_m2),
                           .u_prior_m = of_previous ? before.range_offset->u_prior_m : d_scale_m};
  }

  return VolumetricModel::from_vector(
             *run.tables(), run.datum(), run.tool_offsets_m(), N * x.head(n), covariance,
             options.renewed.empty() ? previous.validity() : run.validity())
      .and_then([&](const VolumetricModel& updated) {
        return updated.with_misfit(larger_misfit(previous.misfit(), run.misfit()));
      })
      .map([&](VolumetricModel updated) {
        return ModelWithOffset{std::move(updated), std::move(offset)};
      });
}

Result<VolumetricModel> update_model(const VolumetricModel& previous, const VolumetricModel& run,
                                     const UpdateOptions& options) {
  return update_model(ModelWithOffset{previous}, ModelWithOffset{run}, options)
      .map([](ModelWithOffset updated) { return std::move(updated.model); });
}

}  // namespace abbe::calib
