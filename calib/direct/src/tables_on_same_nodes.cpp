#include "tables_on_same_nodes.hpp"

#include <algorithm>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/direct/convention.hpp"
#include "abbe/calib/internal/direct/scatter.hpp"
#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/internal/statistics/student_tail.hpp"
#include "abbe/result/try.hpp"
#include "device.hpp"
#include "model_curve.hpp"
#include "squareness.hpp"

namespace abbe::calib::direct {
namespace {

constexpr auto kLine = StraightnessLine::EndPoints;  // the straightness line of datum G2

/// Nodes of the axis: all measured positions that lie in the range of all its tables, without near
/// duplicates.
Result<AxisNodes> common_nodes(const std::vector<UsedError>& used, Axis axis,
                               const AxisNodes& of_model) {
  double first_m = -1e300, last_m = 1e300;
  std::vector<double> all;
  for (const UsedError& u : used) {
    if (u.motion && u.motion->axis == axis) {
      first_m = std::max(first_m, u.runs.positions_m.front());
      last_m = std::min(last_m, u.runs.positions_m.back());
      all.insert(all.end(), u.runs.positions_m.begin(), u.runs.positions_m.end());
    }
  }
  if (all.empty()) {
    return of_model;
  }

  std::sort(all.begin(), all.end());
  AxisNodes nodes;
  for (const double p : all) {
    const bool is_new = nodes.nodes_m.empty() || p - nodes.nodes_m.back() > kSameTarget_m;
    if (is_new && p >= first_m && p <= last_m) {
      nodes.nodes_m.push_back(p);
    }
  }
  if (nodes.nodes_m.size() < kLeastPositions) {
    return failure(
        ErrorCode::TooFewObservations,
        message("comparison in the volume: the measured tables of axis ", letter(axis), " have ",
                nodes.nodes_m.size(), " common positions, needs ", kLeastPositions));
  }
  nodes.reference_m = zero_position_m(nodes.nodes_m, of_model.reference_m);
  return nodes;
}

/// Computes the parameters of the measured errors and of the model in the common layout.
class CommonTables {
 public:
  CommonTables(const std::vector<UsedError>& used, const ParameterLayout& layout,
               const VolumetricModel& model, const DeviceUncertainty& device)
      : used_(used),
        layout_(layout),
        model_(model),
        device_(device),
        basis_(TableBasis::of(layout).value()) {  // linear interpolation: any number of nodes
    const auto n = static_cast<Eigen::Index>(layout.model_size());
    convention_ = Eigen::MatrixXd::Identity(n, n);
    for (const UsedError& u : used_) {
      if (u.motion) {
        const auto [first, count] = place_of(*u.motion);
        convention_.block(first, first, count, count) =
            reduction(*u.motion, nodes_of(*u.motion), reference_of(*u.motion), kLine);
        if (const auto change =
                line_change(*u.motion, u.all, u.error->line_m, nodes_of(*u.motion), kLine)) {
          lines_.push_back(*change);
        }
      }
    }
    add_squareness_rows();
  }

  [[nodiscard]] TableValues measured() const {
    const Eigen::Index n = convention_.rows();
    TableValues raw{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n)};
    Eigen::MatrixXd T = Eigen::MatrixXd::Identity(n, n);
    for (const UsedError& u : used_) {
      u.motion ? add_table(raw, u) : add_squareness(raw, u);
      add_levers(T, u);
    }
    T = squareness_ * convention_ * T;
    return {T * raw.U, T * raw.cov_U * T.transpose()};
  }

  [[nodiscard]] TableValues modelled() const {
    Eigen::MatrixXd B = Eigen::MatrixXd::Zero(convention_.rows(), model_.U().size());
    for (const UsedError& u : used_) {
      if (u.motion) {
        const auto [first, count] = place_of(*u.motion);
        B.middleRows(first, count) = ModelCurve(model_, *u.motion).rows(nodes_of(*u.motion));
      } else {
        B.row(squareness_place(u.error->name)) = squareness_row(
            u.error->name, *model_.tables(), tool_m(), *u.error->line_m, lines_, kLine);
      }
    }
    B = squareness_ * convention_ * B;
    return {B * model_.U(), B * model_.covariance() * B.transpose()};
  }

 private:
  struct Place {
    Eigen::Index first, count;
  };
  [[nodiscard]] Place place_of(ErrorMotion motion) const {
    return {static_cast<Eigen::Index>(layout_.find(motion)->offset),
            static_cast<Eigen::Index>(layout_.node_count(motion.axis))};
  }
  [[nodiscard]] Eigen::Index squareness_place(const std::string& name) const {
    const auto found = std::find(kSquarenessNames.begin(), kSquarenessNames.end(), name);
    return static_cast<Eigen::Index>(layout_.squareness_offset()) +
           (found - kSquarenessNames.begin());
  }
  [[nodiscard]] const Vector3& tool_m() const { return model_.tool_offsets_m().front(); }
  /// Adds the rows that convert the slopes of V along the measured lines to the squareness
  /// parameter of the common tables.
  void add_squareness_rows() {
    squareness_ = Eigen::MatrixXd::Identity(convention_.rows(), convention_.rows());
    for (const UsedError& u : used_) {
      if (!u.motion) {
        squareness_.row(squareness_place(u.error->name)) *= 2.0;
        squareness_.row(squareness_place(u.error->name)) -=
            squareness_row(u.error->name, basis_, tool_m(), *u.error->line_m, lines_, kLine);
      }
    }
  }
  [[nodiscard]] std::span<const double> nodes_of(ErrorMotion motion) const {
    return layout_.nodes()[index(motion.axis)].nodes_m;
  }
  [[nodiscard]] double reference_of(ErrorMotion motion) const {
    return layout_.nodes()[index(motion.axis)].reference_m;
  }

  /// Covariance of W mean() from the scatter of the runs, enlarged because the scatter has few
  /// degrees of freedom.
  [[nodiscard]] static Eigen::MatrixXd scatter_covariance(const UsedError& u,
                                                          const Eigen::MatrixXd& W) {
    const Scatter scatter = scatter_of(u.runs, u.motion);
    const double t = scatter.dof > 0 ? student_over_normal(static_cast<double>(scatter.dof)) : 1.0;
    return t * t * covariance_of_runs(u.runs, u.motion, scatter, W);
  }

  void add_table(TableValues& raw, const UsedError& u) const {
    const auto [first, count] = place_of(*u.motion);
    const auto nodes_m = nodes_of(*u.motion);
    const Eigen::MatrixXd W = interpolation_matrix(u.runs.positions_m, nodes_m);
    raw.U.segment(first, count) = W * u.runs.mean();
    raw.cov_U.block(first, first, count, count) =
        scatter_covariance(u, W) +
        covariance_of_device(*u.motion, Eigen::MatrixXd::Identity(count, count), nodes_m, device_);
  }

  void add_squareness(TableValues& raw, const UsedError& u) const {
    const Eigen::Index i = squareness_place(u.error->name);
    raw.U(i) = u.runs.mean()(0) + squareness_change(u.error->name, lines_);
    raw.cov_U(i, i) = scatter_covariance(u, Eigen::MatrixXd::Identity(1, 1))(0, 0) +
                      device_.u_rad * device_.u_rad;
  }

  /// Subtracts rotation x lever from a translation that was measured on a known line.
  void add_levers(Eigen::MatrixXd& T, const UsedError& u) const {
    if (!u.motion || !u.error->line_m || is_rotation(u.motion->motion)) {
      return;
    }
    const Vector3 lever_m =
        lever(layout_.chain(), u.motion->axis, *u.error->line_m, model_.tool_offsets_m().front());
    const Place to = place_of(*u.motion);
    for (const Table& table : layout_.tables()) {
      if (table.motion.axis == u.motion->axis && is_rotation(table.motion.motion)) {
        const double along =
            effect(table.motion, lever_m)(static_cast<Eigen::Index>(direction(u.motion->motion)));
        const Place from = place_of(table.motion);
        T.block(to.first, from.first, to.count, from.count).diagonal().array() -= along;
      }
    }
  }

  const std::vector<UsedError>& used_;
  const ParameterLayout& layout_;
  const VolumetricModel& model_;
  DeviceUncertainty device_;
  TableBasis basis_;
  Eigen::MatrixXd convention_, squareness_;
  std::vector<LineChange> lines_;
};

}  // namespace

Result<UsableErrors> usable_errors(std::span<const MeasuredError> errors,
                                   const VolumetricModel& model) {
  UsableErrors out;
  for (const MeasuredError& error : errors) {
    const auto motion = error_motion(error.name);
    auto runs = runs_of(error);
    ABBE_TRY(runs);
    if (!motion) {
      out.used.push_back({&error, std::nullopt, *runs, *runs});
    } else if (model.tables()->layout().find(*motion)) {
      const ModelCurve curve(model, *motion);
      Runs covered = at_positions(*runs, [&](double p) { return curve.covers(p); });
      if (covered.positions_m.size() < kLeastPositions) {
        out.left_out.push_back({error.name, "too few common positions"});
      } else {
        out.used.push_back({&error, motion, std::move(covered), std::move(*runs)});
      }
    }
  }
  return out;
}

void leave_out_squareness(UsableErrors& errors, const ParameterLayout& layout) {
  std::vector<LineChange> lines;
  for (const UsedError& u : errors.used) {
    if (u.motion) {
      const auto change = line_change(*u.motion, u.all, u.error->line_m,
                                      layout.nodes()[index(u.motion->axis)].nodes_m, kLine);
      if (change) {
        lines.push_back(*change);
      }
    }
  }
  std::erase_if(errors.used, [&](const UsedError& u) {
    const std::string reason = u.motion ? "" : why_not_comparable(*u.error, layout.nodes(), lines);
    if (!reason.empty()) {
      errors.left_out.push_back({u.error->name, reason});
    }
    return !reason.empty();
  });
}

Result<ParameterLayout> common_layout(const std::vector<UsedError>& used,
                                      const VolumetricModel& model) {
  MachineNodes nodes;
  for (const Axis axis : kAllAxes) {
    const auto of_axis = common_nodes(used, axis, model.tables()->layout().nodes()[index(axis)]);
    ABBE_TRY(of_axis);
    nodes[index(axis)] = *of_axis;
  }
  std::vector<ErrorMotion> motions;
  for (const UsedError& u : used) {
    if (u.motion) {
      motions.push_back(*u.motion);
    }
  }
  if (motions.empty()) {
    return failure(ErrorCode::TooFewObservations,
                   "comparison in the volume: no error motion was measured that the model has");
  }
  return ParameterLayout::with_tables(model.chain(), nodes, motions);
}

CommonValues common_values(const std::vector<UsedError>& used, const ParameterLayout& layout,
                           const VolumetricModel& model, const DeviceUncertainty& device) {
  const CommonTables common(used, layout, model, device);
  return {common.measured(), common.modelled()};
}

}  // namespace abbe::calib::direct
