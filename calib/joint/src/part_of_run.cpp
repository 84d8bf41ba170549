#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/joint/left_out_rotations.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/internal/model/offset_of_data.hpp"
#include "abbe/calib/joint/part.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::joint {
namespace {

/// Columns of the effects that a run shares with other parts, one standard uncertainty each.
struct SharedColumns {
  Eigen::MatrixXd G;              ///< change of the model parameters by one standard uncertainty of
                                  ///< each effect
  Eigen::MatrixXd in_covariance;  ///< columns g of these effects in the covariance of the model:
                                  ///< each adds g g^T
  std::vector<std::string> names;
  std::vector<double> u;
};

SharedColumns shared_columns(const ParameterLayout& layout, const CommonEffects& e) {
  const Eigen::MatrixX3d of_axis = axis_scale_columns(layout);
  constexpr Eigen::Index kMost = 5;
  SharedColumns shared{
      Eigen::MatrixXd(of_axis.rows(), kMost), Eigen::MatrixXd(of_axis.rows(), kMost), {}, {}};
  Eigen::Index columns = 0;
  const auto add = [&](double u, double u_left, const Eigen::VectorXd& column, std::string name) {
    if (u > 0.0 && column.squaredNorm() > 0.0) {
      shared.in_covariance.col(columns) = u_left * column;
      shared.G.col(columns++) = u * column;
      shared.names.push_back(std::move(name));
      shared.u.push_back(u);
    }
  };

  // A relative error of the ranges scales the whole machine.
  add(e.u_ranges, e.u_ranges, of_axis.rowwise().sum(), "ranges of " + e.ranges_of);
  for (const Axis a : kAllAxes) {
    const double u = e.u_axis_scale[index(a)];
    add(u, u, of_axis.col(static_cast<Eigen::Index>(index(a))), message("scale of ", letter(a)));
  }
  if (e.place) {
    const OffsetInModel& of_run = e.place->range_offset;
    add(of_run.u_prior_m, of_run.u_m, of_run.dU_dd, "offset of the ranges " + e.place->name);
  }
  shared.G.conservativeResize(Eigen::NoChange, columns);
  shared.in_covariance.conservativeResize(Eigen::NoChange, columns);
  return shared;
}

/// Adds the information of the run's data, without the prior, about its range offset d. The unknown
/// is d divided by the standard uncertainty of its prior.
void add_offset_of_data(estimation::Information& information, const OffsetInModel& of_run,
                        Eigen::Index column) {
  if (const std::optional<OffsetOfData> data = of_data(of_run)) {
    Eigen::MatrixXd row =
        Eigen::MatrixXd::Zero(1, static_cast<Eigen::Index>(information.unknowns()));
    row(0, column) = of_run.u_prior_m / data->u_m;
    information.add_rows(row, Eigen::VectorXd::Constant(1, data->value_m / data->u_m));
  }
}

Result<void> check_offset(const std::string& part, const CommonEffects& effects,
                          const CommonTables& common) {
  const auto& shared = effects.place;
  if (!shared) {
    return {};
  }
  const OffsetInModel& of_run = shared->range_offset;
  if (of_run.u_prior_m > 0.0 && of_run.u_m > 0.0 && of_run.dU_dd.squaredNorm() > 0.0 &&
      of_run.dU_dd.size() == static_cast<Eigen::Index>(common.basis.size())) {
    return {};
  }
  return failure(ErrorCode::NotApplicable,
                 message("joint identification: ", part, " has no estimate of the range offset '",
                         shared->name, "': it needs u_range_offset, and no nests"));
}

/// Text such as "has 4 nodes of X, not 5"; empty if nodes, reference and interpolation of the axis
/// are the same.
std::string difference_of_axis(Axis axis, const TableBasis& own, const TableBasis& common) {
  constexpr double kSame_m = 1e-9;  // larger than the rounding of decimal numbers in files (mm)
  const AxisNodes &x = own.layout().nodes()[index(axis)], &y = common.layout().nodes()[index(axis)];
  if (x.nodes_m.size() != y.nodes_m.size()) {
    return message("has ", x.nodes_m.size(), " nodes of ", letter(axis), ", not ",
                   y.nodes_m.size());
  }
  for (std::size_t i = 0; i < x.nodes_m.size(); ++i) {
    if (!(std::abs(x.nodes_m[i] - y.nodes_m[i]) < kSame_m)) {
      return message("has a node at ", letter(axis), " = ", kMmPerM * x.nodes_m[i], " mm, not at ",
                     kMmPerM * y.nodes_m[i], " mm");
    }
  }
  if (!(std::abs(x.reference_m - y.reference_m) < kSame_m)) {
    return message("has the reference ", letter(axis), " = ", kMmPerM * x.reference_m, " mm, not ",
                   kMmPerM * y.reference_m, " mm");
  }

  const auto of_own = own.interpolation(axis).kind(), of_common = common.interpolation(axis).kind();
  return of_own == of_common ? ""
                             : message("has ", name(of_own), " tables of ", letter(axis), ", not ",
                                       name(of_common));
}

Result<void> check_same_layout(const std::string& name, const VolumetricModel& model,
                               const CommonTables& common) {
  const Result<CommonTables> own = tables_of(model);
  if (!own) {
    return failure(own.error().code, message(own.error().text, " (", name, ")"));
  }

  const ParameterLayout &a = own->basis.layout(), &b = common.basis.layout();
  std::string difference;
  if (a.chain().order_w_to_t() != b.chain().order_w_to_t()) {
    difference = message("has the axes ", a.chain().text(), ", not ", b.chain().text());
  } else if (const auto [s, t] = std::mismatch(
                 a.tables().begin(), a.tables().end(), b.tables().begin(), b.tables().end(),
                 [](const Table& p, const Table& q) { return p.motion == q.motion; });
             s != a.tables().end() || t != b.tables().end()) {
    difference = message("has ", a.tables().size(), " tables, the common ones are ",
                         b.tables().size(), "; the first that differs is ",
                         abbe::calib::name(s != a.tables().end() ? s->motion : t->motion));
  }
  for (const Axis axis : kAllAxes) {
    difference =
        difference.empty() ? difference_of_axis(axis, own->basis, common.basis) : difference;
  }
  if (!difference.empty()) {
    return failure(ErrorCode::NotApplicable,
                   message("joint identification: ", name, " ", difference));
  }
  return {};
}

/// Cholesky factor of a covariance that is scaled by its diagonal; nullopt if it is not positive
/// definite.
struct ScaledTriangle {
  Eigen::VectorXd scale;
  Eigen::LLT<Eigen::MatrixXd> factor;
};
std::optional<ScaledTriangle> scaled_triangle(const Eigen::MatrixXd& C) {
  ScaledTriangle t{C.diagonal().unaryExpr([](double v) { return v > 0.0 ? std::sqrt(v) : 1.0; }),
                   {}};
  const Eigen::VectorXd inverse = t.scale.cwiseInverse();
  t.factor.compute(inverse.asDiagonal() * C * inverse.asDiagonal());
  if (t.factor.info() != Eigen::Success) {
    return std::nullopt;
  }
  return t;
}

/// Cholesky factor of C - G G^T: the covariance without the effects of the columns of G, which have
/// the names `names`.
Result<ScaledTriangle> triangle_without_effects(const std::string& part, const Eigen::MatrixXd& C,
                                                const Eigen::MatrixXd& G,
                                                const std::vector<std::string>& names) {
  if (std::optional<ScaledTriangle> triangle = scaled_triangle(C - G * G.transpose())) {
    return *std::move(triangle);
  }
  if (names.empty() || !scaled_triangle(C)) {
    return failure(ErrorCode::NotApplicable,
                   message("joint identification: the covariance of ", part,
                           " leaves a combination of its parameters without uncertainty"));
  }

  std::string stated;
  for (const std::string& effect : names) {
    stated += (stated.empty() ? "" : ", ") + effect;
  }
  return failure(
      ErrorCode::NotApplicable,
      message("joint identification: the covariance of ", part,
              " is not larger than the effects stated as common (", stated,
              "): state the u_scale, u_axis_scale and range offset with which the run was "
              "identified"));
}

/// The product W M, with W^T W = C^-1.
Eigen::MatrixXd whitened_by(const ScaledTriangle& t, const Eigen::MatrixXd& M) {
  return t.factor.matrixL().solve(t.scale.cwiseInverse().asDiagonal() * M);
}

}  // namespace

Result<Part> part_of_run(std::string name, const VolumetricModel& model, const CommonTables& common,
                         const CommonEffects& effects) {
  ABBE_TRY(check_same_layout(name, model, common));
  ABBE_TRY(check_offset(name, effects, common));

  const Eigen::MatrixXd N = datum_coordinates(common.basis).N;
  SharedColumns shared = shared_columns(common.basis.layout(), effects);
  const Eigen::MatrixXd G = N.transpose() * shared.G;
  const Result<ScaledTriangle> triangle =
      triangle_without_effects(name, N.transpose() * model.covariance() * N,
                               N.transpose() * shared.in_covariance, shared.names);
  ABBE_TRY(triangle);

  const LeftOutRotations left_out(common, model.tool_offsets_m().front() - common.tool_offset_m);
  const Result<Eigen::MatrixXd> of_rotations = left_out.of_parameters();
  if (!of_rotations) {
    return failure(of_rotations.error().code,
                   message("joint identification: ", name, ": ", of_rotations.error().text));
  }

  const auto n = static_cast<Eigen::Index>(common.basis.size()), own = std::ssize(shared.names);
  Eigen::MatrixXd A(N.cols(), n + own + of_rotations->cols());
  A << N.transpose(), G.leftCols(own), N.transpose() * *of_rotations;
  estimation::Information information(static_cast<std::size_t>(A.cols()));
  Eigen::VectorXd U = model.U();
  if (effects.place) {
    U += effects.place->range_offset.dU_dd * effects.place->range_offset.value_m;
    add_offset_of_data(information, effects.place->range_offset, n + own - 1);
  }
  information.add_rows(whitened_by(*triangle, A), whitened_by(*triangle, N.transpose() * U));

  std::vector<std::size_t> eliminated(left_out.size());
  std::iota(eliminated.begin(), eliminated.end(), static_cast<std::size_t>(n + own));
  const std::span<const Vector3> hull = model.validity().vertices_m();
  return Part{.name = std::move(name),
              .method = "otf",
              .information = eliminated.empty() ? std::move(information)
                                                : information.without_unknowns(eliminated),
              .effects = std::move(shared.names),
              .u_of_effects = std::move(shared.u),
              .covered_m = {hull.begin(), hull.end()},
              .misfit = model.misfit() != nullptr ? std::optional(*model.misfit()) : std::nullopt};
}

}  // namespace abbe::calib::joint
