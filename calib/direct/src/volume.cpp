#include "abbe/calib/direct/volume.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/direct/scatter.hpp"
#include "abbe/result/try.hpp"
#include "tables_on_same_nodes.hpp"

namespace abbe::calib::direct {
namespace {

Result<VolumetricModel> model_of(const ParameterLayout& layout, const TableValues& values,
                                 const VolumetricModel& like) {
  MachineNodes ends = layout.nodes();
  for (AxisNodes& axis : ends) {
    axis.nodes_m = {axis.nodes_m.front(), axis.nodes_m.back()};
  }
  auto validity = ValidityVolume::hull_of(tensor_grid(ends));
  ABBE_TRY(validity);
  const Eigen::MatrixXd symmetric = 0.5 * (values.cov_U + values.cov_U.transpose());
  return VolumetricModel::from_vector(layout, ModelDatum::G2, like.tool_offsets_m().first(1),
                                      values.U, symmetric, std::move(*validity));
}

/// Points of a grid inside the validity volume of the model, with at most about 21 nodes per axis
/// including both ends.
std::vector<Vector3> grid_of(const MachineNodes& nodes, const VolumetricModel& model) {
  constexpr std::size_t kCells = 20;
  MachineNodes few = nodes;
  for (AxisNodes& axis : few) {
    const std::vector<double> all = std::move(axis.nodes_m);
    const std::size_t step = std::max<std::size_t>(1, (all.size() - 1 + kCells - 1) / kCells);
    axis.nodes_m.clear();
    for (std::size_t i = 0; i + 1 < all.size(); i += step) {
      axis.nodes_m.push_back(all[i]);
    }
    axis.nodes_m.push_back(all.back());
  }
  std::vector<Vector3> grid = tensor_grid(few);
  std::erase_if(grid, [&](const Vector3& q) { return !model.validity().contains(q); });
  return grid;
}

void add_uncertainty(VolumeComparison& out, std::span<const Vector3> grid) {
  const Vector3& tool_m = out.model.tool_offsets_m().front();
  double sum_m2 = 0.0;
  for (const Vector3& q : grid) {
    sum_m2 += out.measured.error_at(q, tool_m).cov_V_m2.trace() +
              out.model.error_at(q, tool_m).cov_V_m2.trace();
  }
  out.u_rms_m = std::sqrt(sum_m2 / static_cast<double>(grid.size()));
}

std::vector<Vector3> errors_on(std::span<const Vector3> grid, const VolumetricModel& model) {
  std::vector<Vector3> V;
  for (const Vector3& q : grid) {
    V.push_back(model.V_at(q, model.tool_offsets_m().front()));
  }
  return V;
}

void add_names(VolumeComparison& out, const std::vector<UsedError>& used,
               const VolumetricModel& model) {
  for (const UsedError& u : used) {
    out.compared.push_back(u.error->name);
  }
  const auto add = [&](const std::string& of_model) {
    const bool is_left_out =
        std::any_of(out.left_out.begin(), out.left_out.end(),
                    [&](const LeftOut& error) { return error.name == of_model; });
    if (!is_left_out &&
        std::find(out.compared.begin(), out.compared.end(), of_model) == out.compared.end()) {
      out.not_measured.push_back(of_model);
    }
  };
  for (const Table& table : model.tables()->layout().tables()) {
    add(calib::name(table.motion));
  }
  for (const std::string_view squareness : kSquarenessNames) {
    add(std::string(squareness));
  }
}

}  // namespace

Result<VolumeComparison> compare_in_volume(std::span<const MeasuredError> errors,
                                           const VolumetricModel& model,
                                           const DeviceUncertainty& device) {
  if (const auto tables = compare(errors, model, {.device = device}); !tables) {
    return tl::make_unexpected(tables.error());  // reports wrong names, options or runs
  }
  auto usable = usable_errors(errors, model);
  ABBE_TRY(usable);
  const auto layout = common_layout(usable->used, model);
  ABBE_TRY(layout);
  leave_out_squareness(*usable, *layout);
  const CommonValues values = common_values(usable->used, *layout, model, device);
  auto measured = model_of(*layout, values.measured, model);
  auto modelled = model_of(*layout, values.model, model);
  if (!measured || !modelled) {
    return tl::make_unexpected(measured ? modelled.error() : measured.error());
  }

  const std::vector<Vector3> grid = grid_of(layout->nodes(), model);
  auto difference =
      rigid_free_difference(*measured, *modelled, model.tool_offsets_m().front(), grid);
  ABBE_TRY(difference);
  VolumeComparison out{.measured = std::move(*measured), .model = std::move(*modelled)};
  out.points = grid.size();
  out.difference = *difference;
  out.V_measured = vector_statistics(errors_on(grid, out.measured));
  out.V_model = vector_statistics(errors_on(grid, out.model));
  out.left_out = usable->left_out;
  add_names(out, usable->used, model);
  if (std::all_of(usable->used.begin(), usable->used.end(), [&](const UsedError& u) {
        return uncertainty_known(u.motion, scatter_of(u.runs, u.motion), device);
      })) {
    add_uncertainty(out, grid);
  }
  return out;
}

}  // namespace abbe::calib::direct
