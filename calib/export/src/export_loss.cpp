#include <algorithm>
#include <cmath>

#include "abbe/calib/export/held_correction.hpp"
#include "abbe/result/try.hpp"
#include "motion_fit.hpp"

namespace abbe::calib {
namespace {

/// Number of nodes per axis for the losses of single errors. 11 are enough, because the errors of a
/// model are smooth, and the effects of squareness and levers are linear.
constexpr std::size_t kLossNodes = 11;

/// V at the places for a model in which only the `count` parameters from index `first` on are not
/// zero.
std::vector<Vector3> effects_of(const TableBasis& basis, const Eigen::VectorXd& U,
                                std::size_t first, std::size_t count, const Vector3& tool_m,
                                std::span<const LatticePlace> places) {
  Eigen::VectorXd one = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(basis.size()));
  const auto begin = static_cast<Eigen::Index>(first), size = static_cast<Eigen::Index>(count);
  one.segment(begin, size) = U.segment(begin, size);
  MachineState state;
  state.tool_offset_m = tool_m;

  std::vector<Vector3> V_m;
  for (const LatticePlace& place : places) {
    state.q_m = place.p_m;
    V_m.push_back(basis.V_m(state, {one.data(), static_cast<std::size_t>(one.size())}));
  }
  return V_m;
}

double rms_of(std::span<const Vector3> vectors) {
  double sum = 0.0;
  for (const Vector3& v : vectors) sum += v.squaredNorm();
  return std::sqrt(sum / static_cast<double>(vectors.size()));
}

ErrorLoss loss_of(std::string name, std::span<const Vector3> V_m, const MotionFit& fit,
                  HeldTables& held, std::span<const LatticePlace> places) {
  const auto values = fit.fit(V_m);
  for (std::size_t m = 0; m < held.tables.size(); ++m) held.tables[m].value = values[m];

  ErrorLoss loss{std::move(name), rms_of(V_m), 0.0, 0.0};
  std::vector<Vector3> lost_m;
  for (std::size_t i = 0; i < places.size(); ++i) {
    lost_m.emplace_back(V_m[i] - held.c_m(places[i].p_m));
    loss.max_lost_m = std::max(loss.max_lost_m, lost_m.back().norm());
  }
  loss.rms_lost_m = rms_of(lost_m);
  return loss;
}

GridAxes loss_nodes(const ExportBox& box) {
  GridAxes nodes;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto k = static_cast<Eigen::Index>(a);
    for (std::size_t i = 0; i < kLossNodes; ++i) {
      const double w = static_cast<double>(i) / (kLossNodes - 1);
      nodes[a].push_back((1.0 - w) * box.min_m[k] + w * box.max_m[k]);
    }
  }
  return nodes;
}

}  // namespace

Result<ExportLoss> export_loss(const VolumetricModel& model, const Vector3& tool_m,
                               std::span<const ExportPlace> places,
                               const std::optional<AxisTravel>& travel,
                               const CorrectionFunction& held) {
  ExportLoss loss;
  Vector3 without = Vector3::Zero(), lost = Vector3::Zero();
  for (const ExportPlace& place : places) {
    const auto c =
        model.command_correction(place.commanded_m, tool_m, travel.value_or(place.travel));
    ABBE_TRY(c);
    const Vector3 difference_m = c->c_m - held(place);
    without += c->c_m.cwiseAbs2();
    lost += difference_m.cwiseAbs2();
    loss.max_without_m = loss.max_without_m.cwiseMax(c->c_m.cwiseAbs());
    loss.max_lost_m = loss.max_lost_m.cwiseMax(difference_m.cwiseAbs());
  }
  const auto n = static_cast<double>(std::max<std::size_t>(places.size(), 1));
  loss.rms_without_m = (without / n).cwiseSqrt();
  loss.rms_lost_m = (lost / n).cwiseSqrt();
  return loss;
}

Result<std::vector<ErrorLoss>> losses_by_error(const VolumetricModel& model, const Vector3& tool_m,
                                               std::span<const ErrorMotion> motions,
                                               const ExportBox& box) {
  std::vector<ErrorLoss> losses;
  const auto* basis = model.tables();
  if (basis == nullptr) return losses;

  const GridAxes nodes = loss_nodes(box);
  const auto places = lattice_places(model.validity(), nodes);
  ABBE_TRY(places);
  const std::array<std::size_t, 3> anchors{kLossNodes / 2, kLossNodes / 2, kLossNodes / 2};
  const MotionFit fit(model.chain(), tool_m, motions, nodes, *places, anchors);
  HeldTables held{model.chain(), tool_m, nodes, {}};
  for (const ErrorMotion& motion : motions) held.tables.push_back({motion, {}, {}});

  const auto add = [&](std::string error, std::size_t first, std::size_t count) {
    const auto V_m = effects_of(*basis, model.U(), first, count, tool_m, *places);
    if (rms_of(V_m) > 0.0) {
      losses.push_back(loss_of(std::move(error), V_m, fit, held, *places));
    }
  };
  const ParameterLayout& layout = basis->layout();
  for (const Table& table : layout.tables()) {
    add(name(table.motion), table.offset, layout.node_count(table.motion.axis));
  }
  for (std::size_t i = 0; i < kSquarenessNames.size(); ++i) {
    add(std::string(kSquarenessNames[i]), layout.squareness_offset() + i, 1);
  }
  return losses;
}

}  // namespace abbe::calib
