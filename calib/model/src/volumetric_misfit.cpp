// The part of VolumetricModel that contains the misfit.
#include <algorithm>
#include <array>
#include <utility>

#include "abbe/calib/geometry/linear_interpolation.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

Result<void> check(const Misfit& misfit, const VolumetricModel& model) {
  const Eigen::Index n = misfit.u_of_parameters.size();
  const Eigen::Index wanted = model.tables() == nullptr ? 0 : model.U().size();
  if (n != 0 && n != wanted) {
    return failure(ErrorCode::BadInput,
                   message("model: misfit of ", n, " parameters, the model has ", wanted));
  }
  if (!misfit.u_of_parameters.allFinite() || !misfit.u_V_m.allFinite()) {
    return failure(ErrorCode::NotFinite, "model: a misfit is not a number");
  }
  if ((n > 0 && misfit.u_of_parameters.minCoeff() < 0.0) || misfit.u_V_m.minCoeff() < 0.0 ||
      !(misfit.table_length_m >= 0.0) || !(misfit.V_length_m >= 0.0)) {
    return failure(ErrorCode::BadInput, "model: a misfit is negative");
  }
  return {};
}

}  // namespace

Result<VolumetricModel> VolumetricModel::with_misfit(Misfit misfit) const {
  ABBE_TRY(check(misfit, *this));
  VolumetricModel model = *this;
  model.misfit_.reset();
  if (misfit.any()) {
    model.misfit_ = std::move(misfit);
  }
  return model;
}

Matrix3 misfit_of_tables_m2(const Misfit& misfit, const ParameterLayout& layout,
                            const Vector3& axis_position_m, const Vector3& tool_offset_m) {
  Matrix3 cov_m2 = Matrix3::Zero();
  if (misfit.u_of_parameters.size() == 0) {
    return cov_m2;
  }

  const std::array<Vector3, 3> levers = levers_m(layout.chain(), axis_position_m, tool_offset_m);
  for (const Table& table : layout.tables()) {
    const std::size_t a = index(table.motion.axis);
    const std::vector<double>& nodes_m = layout.nodes()[a].nodes_m;
    const BasisRow row = basis_row(
        nodes_m,
        std::clamp(axis_position_m(static_cast<Eigen::Index>(a)), nodes_m.front(), nodes_m.back()));
    const auto node = static_cast<Eigen::Index>(table.offset + row.first);
    const double m = row.weight[0] * misfit.u_of_parameters(node) +
                     row.weight[1] * misfit.u_of_parameters(node + 1);
    if (m > 0.0) {
      const Vector3 moved_m = m * effect(table.motion, levers[a]);
      cov_m2 += moved_m * moved_m.transpose();
    }
  }
  return cov_m2;
}

Matrix3 VolumetricModel::misfit_cov_V_m2(const Vector3& axis_position_m,
                                         const Vector3& tool_offset_m) const {
  if (!misfit_) {
    return Matrix3::Zero();
  }
  Matrix3 cov_m2 = misfit_->u_V_m.cwiseAbs2().asDiagonal();
  if (tables() != nullptr) {
    cov_m2 += misfit_of_tables_m2(*misfit_, tables()->layout(), axis_position_m,
                                  lever_offset_m(tool_offset_m));
  }
  return cov_m2;
}

double mean_misfit_m2(const VolumetricModel& model, std::span<const Vector3> places_m) {
  double sum_m2 = 0.0;
  for (const Vector3& q : places_m) {
    sum_m2 += model.misfit_cov_V_m2(q, model.tool_offsets_m().front()).trace();
  }
  return sum_m2 / std::max(1.0, static_cast<double>(places_m.size()));
}

bool is_notable_misfit(const VolumetricModel& model) {
  constexpr int kPerAxis = 5;
  constexpr double kLeast = 1.02 * 1.02 - 1.0;  // relative increase of the variance that makes u
                                                // larger by 2 %
  std::vector<Vector3> places_m;
  for (int i = 0; i < kPerAxis * kPerAxis * kPerAxis; ++i) {
    const std::array at{i % kPerAxis, i / kPerAxis % kPerAxis, i / kPerAxis / kPerAxis};
    Vector3& q_m = places_m.emplace_back();
    for (std::size_t a = 0; a < 3; ++a) {
      const std::vector<double>& nodes_m = model.nodes()[a].nodes_m;
      q_m(static_cast<Eigen::Index>(a)) =
          nodes_m.front() + (nodes_m.back() - nodes_m.front()) * at[a] / (kPerAxis - 1.0);
    }
  }
  double all_m2 = 0.0;
  for (const Vector3& q_m : places_m) {
    all_m2 += model.error_at(q_m, model.tool_offsets_m().front()).cov_V_m2.trace() /
              static_cast<double>(places_m.size());
  }
  const double of_misfit_m2 = mean_misfit_m2(model, places_m);
  return of_misfit_m2 >= kLeast * (all_m2 - of_misfit_m2);
}

Misfit larger_misfit(const Misfit* a, const Misfit* b) {
  if (a == nullptr || b == nullptr) {
    return a != nullptr ? *a : (b != nullptr ? *b : Misfit{});
  }
  Misfit all = *a;
  if (all.u_of_parameters.size() == 0) {
    all.u_of_parameters = b->u_of_parameters;
  } else if (b->u_of_parameters.size() > 0) {
    all.u_of_parameters = all.u_of_parameters.cwiseMax(b->u_of_parameters);
  }
  all.u_V_m = all.u_V_m.cwiseMax(b->u_V_m);
  all.table_length_m = std::max(a->table_length_m, b->table_length_m);
  all.V_length_m = std::max(a->V_length_m, b->V_length_m);
  return all;
}

}  // namespace abbe::calib
