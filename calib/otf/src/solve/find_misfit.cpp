#include "solve/find_misfit.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/geometry/linear_interpolation.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/model/misfit_in_V.hpp"
#include "solve/repeated_residuals.hpp"

namespace abbe::calib::otf {
namespace {

/// Number of sections of a cell between two nodes. Six sections resolve waves whose length is a
/// third of the distance of the nodes, or more.
constexpr std::size_t kSectionsOfCell = 6;

struct PlaceInCell {
  std::size_t cell = 0;
  double share = 0.0;  ///< 0 at the first node of the cell, 1 at the next
};

PlaceInCell place_in(const std::vector<double>& nodes_m, double q_m) {
  const BasisRow row = basis_row(nodes_m, std::clamp(q_m, nodes_m.front(), nodes_m.back()));
  return {row.first, row.weight[1]};
}

std::vector<Table> tables_of(const ParameterLayout& layout, Axis axis) {
  std::vector<Table> tables;
  for (const Table& table : layout.tables()) {
    if (table.motion.axis == axis) {
      tables.push_back(table);
    }
  }
  return tables;
}

/// Sections of one axis. A table moves a row by the same amount as all its node values together,
/// because the weights of the nodes add up to one.
Places places_of_axis(const ParameterLayout& layout, Axis axis) {
  const std::vector<double>& nodes_m = layout.nodes()[index(axis)].nodes_m;
  const std::vector<Table> tables = tables_of(layout, axis);
  const std::size_t cells = nodes_m.size() - 1;
  return {.sections = kSectionsOfCell * cells,
          .cells = cells,
          .components = tables.size(),
          .section_of =
              [&nodes_m, axis](const Observation& row) {
                const PlaceInCell at =
                    place_in(nodes_m, row.axis_position_m(static_cast<Eigen::Index>(index(axis))));
                const auto within = static_cast<std::size_t>(
                    std::min(at.share * kSectionsOfCell, kSectionsOfCell - 1.0));
                return Section{kSectionsOfCell * at.cell + within, at.cell};
              },
          .effect =
              [tables, nodes = nodes_m.size()](const Observations& o, std::size_t row,
                                               Eigen::Ref<Eigen::VectorXd> x) {
                x.setZero();
                for (const SparseRows::Entry& e : o.A.row(row)) {
                  for (std::size_t t = 0; t < tables.size(); ++t) {
                    if (e.column >= tables[t].offset && e.column < tables[t].offset + nodes) {
                      x(static_cast<Eigen::Index>(t)) += e.value;
                    }
                  }
                }
              }};
}

/// Sections of the volume: the cells between the nodes of all axes. Components: V in machine axes.
Places places_of_volume(const ParameterLayout& layout) {
  const MachineNodes& nodes = layout.nodes();
  std::array<std::size_t, 3> count{};
  for (std::size_t a = 0; a < 3; ++a) {
    count[a] = nodes[a].nodes_m.size() - 1;
  }
  return {.sections = count[0] * count[1] * count[2],
          .cells = 1,
          .components = 3,
          .section_of =
              [&nodes, count](const Observation& row) {
                std::size_t at = 0;
                for (std::size_t a = 0; a < 3; ++a) {
                  at = at * count[a] +
                       place_in(nodes[a].nodes_m, row.axis_position_m(static_cast<Eigen::Index>(a)))
                           .cell;
                }
                return Section{at, 0};
              },
          .effect = [](const Observations& o, std::size_t row,
                       Eigen::Ref<Eigen::VectorXd> x) { x = o.rows[row].direction; }};
}

/// Sets the standard uncertainty at each node: the larger of the values of both adjacent cells.
void set_at_nodes(Misfit& misfit, const Table& table, const Eigen::VectorXd& variance_of_cell) {
  const Eigen::Index cells = variance_of_cell.size();
  for (Eigen::Index node = 0; node <= cells; ++node) {
    const double before = node > 0 ? variance_of_cell(node - 1) : 0.0;
    const double after = node < cells ? variance_of_cell(node) : 0.0;
    misfit.u_of_parameters(static_cast<Eigen::Index>(table.offset) + node) =
        std::sqrt(std::max(before, after));
  }
}

/// Part of the variance of V that the misfit of the tables causes: mean over the rows.
Vector3 mean_of_tables_m2(const Misfit& misfit, std::span<const ResidualsOfRun> runs) {
  Vector3 sum_m2 = Vector3::Zero();
  double rows = 0.0;
  for (const ResidualsOfRun& run : runs) {
    for (const Observation& row : run.o.rows) {
      sum_m2 +=
          misfit_of_tables_m2(misfit, run.o.layout(), row.axis_position_m, run.o.target_offset_m)
              .diagonal();
      rows += 1.0;
    }
  }
  return sum_m2 / std::max(1.0, rows);
}

Eigen::MatrixXd joined(const std::vector<Eigen::MatrixXd>& parts, Eigen::Index rows) {
  Eigen::Index columns = 0;
  for (const Eigen::MatrixXd& part : parts) {
    columns += part.cols();
  }
  Eigen::MatrixXd all(rows, columns);
  Eigen::Index at = 0;
  for (const Eigen::MatrixXd& part : parts) {
    all.middleCols(at, part.cols()) = part;
    at += part.cols();
  }
  return all;
}

/// Text such as "EYX 1.4 um between 100 and 150 mm".
std::string note_on(const Table& table, const AxisNodes& axis, const Eigen::VectorXd& variances) {
  const double mean = variances.mean();
  Eigen::Index most = 0;
  const double largest = variances.maxCoeff(&most);
  std::string text = message(name(table.motion), " ", kUmPerM * std::sqrt(mean),
                             is_rotation(table.motion.motion) ? " urad rms" : " um rms");
  constexpr double kOneCell = 4.0;  // a cell with more than this multiple of the mean is named
  if (largest > kOneCell * mean && variances.size() > 1) {
    const auto cell = static_cast<std::size_t>(most);
    text += message(", most of it between ", kMmPerM * axis.nodes_m[cell], " and ",
                    kMmPerM * axis.nodes_m[cell + 1], " mm");
  }
  return text;
}

class Finder {
 public:
  Finder(std::span<const ResidualsOfRun> runs, const Eigen::MatrixXd& of_noise,
         const Eigen::MatrixXd& Q)
      : runs_(runs), layout_(runs.front().o.layout()), of_noise_(of_noise), Q_(Q) {}

  std::optional<FoundMisfit> find() {
    found_.misfit.u_of_parameters =
        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout_.model_size()));
    for (const Axis axis : kAllAxes) {
      add_axis(axis);
    }
    add_volume();
    add_two_axes();
    if (!found_.misfit.any()) {
      return std::nullopt;
    }
    if (found_.misfit.u_of_parameters.maxCoeff() == 0.0) {
      found_.misfit.u_of_parameters.resize(0);
    }
    found_.root_of_covariance = joined(roots_, Q_.rows());
    return std::move(found_);
  }

 private:
  void add_axis(Axis axis) {
    const std::vector<Table> tables = tables_of(layout_, axis);
    const RepeatedResiduals repeated(places_of_axis(layout_, axis), runs_,
                                     static_cast<std::size_t>(Q_.rows()));
    const Eigen::MatrixXd of_cells = repeated.variances(of_noise_);
    if (of_cells.isZero(0.0)) {
      return;
    }
    const AxisNodes& nodes = layout_.nodes()[index(axis)];
    const double section_m = (nodes.nodes_m.back() - nodes.nodes_m.front()) /
                             static_cast<double>(kSectionsOfCell * (nodes.nodes_m.size() - 1));
    std::string text;
    double length_m = 0.0;
    for (std::size_t t = 0; t < tables.size(); ++t) {
      const Eigen::VectorXd variances = of_cells.row(static_cast<Eigen::Index>(t));
      if (!(variances.maxCoeff() > 0.0)) {
        continue;
      }
      set_at_nodes(found_.misfit, tables[t], variances);
      text += (text.empty() ? "" : "; ") + note_on(tables[t], nodes, variances);
      const double stays_m = section_m * repeated.length_in_sections(of_cells, t);
      length_m = length_m > 0.0 ? std::min(length_m, stays_m) : stays_m;
    }
    roots_.push_back(repeated.root_of_covariance(of_cells, Q_));
    double& all_m = found_.misfit.table_length_m;
    all_m = all_m > 0.0 ? std::min(all_m, length_m) : length_m;
    // The correlation of a wave falls to one half after a sixth of its length.
    found_.notes.push_back(message(
        "between the nodes of ", letter(axis), " the machine differs from the model by ", text,
        "; it is in the uncertainty; nodes ", kMmPerM * std::max(length_m, section_m),
        " mm apart there, on a path that crosses all of them on several legs, would follow it"));
  }

  void add_volume() {
    const RepeatedResiduals repeated(places_of_volume(layout_), runs_,
                                     static_cast<std::size_t>(Q_.rows()));
    Eigen::MatrixXd of_V_m2 = repeated.variances(of_noise_);
    of_V_m2.col(0) -= mean_of_tables_m2(found_.misfit, runs_);
    of_V_m2 = of_V_m2.cwiseMax(0.0).eval();
    if (of_V_m2.isZero(0.0)) {
      return;
    }
    found_.misfit.u_V_m = of_V_m2.col(0).cwiseSqrt();
    found_.misfit.V_length_m = mean_node_distance_m();
    roots_.push_back(repeated.root_of_covariance(of_V_m2, Q_));
    found_.notes.push_back(
        message("the machine has errors that depend on several axes at once, or on a rotation that "
                "is not in the model: (",
                kUmPerM * found_.misfit.u_V_m.transpose(),
                ") um rms in X, Y, Z; no table represents them; they are in the uncertainty"));
  }

  void add_two_axes() {
    Vector3 mean_m2 = Vector3::Zero();
    for (const ResidualsOfRun& run : runs_) {
      if (run.two_axes) {
        mean_m2 += run.two_axes->rms_m().cwiseAbs2() / static_cast<double>(runs_.size());
      }
    }
    if (!(mean_m2.maxCoeff() > 0.0)) {
      return;
    }
    found_.misfit.u_V_m = (found_.misfit.u_V_m.cwiseAbs2() + mean_m2).cwiseSqrt();
    found_.misfit.V_length_m = std::max(found_.misfit.V_length_m, half_diagonal_m());
    found_.notes.push_back(
        message("the machine has errors that depend on two axes at once, such as a tilt under a "
                "moving load: (",
                kUmPerM * mean_m2.cwiseSqrt().transpose(),
                ") um rms in X, Y, Z; no table represents them; they are in the uncertainty"));
  }

  /// Half the length of a body diagonal of the travels.
  [[nodiscard]] double half_diagonal_m() const {
    Vector3 half_m;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::vector<double>& nodes_m = layout_.nodes()[a].nodes_m;
      half_m(static_cast<Eigen::Index>(a)) = 0.5 * (nodes_m.back() - nodes_m.front());
    }
    return half_m.norm();
  }

  [[nodiscard]] double mean_node_distance_m() const {
    double sum_m = 0.0;
    for (const AxisNodes& axis : layout_.nodes()) {
      sum_m += (axis.nodes_m.back() - axis.nodes_m.front()) /
               static_cast<double>(axis.nodes_m.size() - 1);
    }
    return sum_m / 3.0;
  }

  std::span<const ResidualsOfRun> runs_;
  const ParameterLayout& layout_;
  const Eigen::MatrixXd& of_noise_;
  const Eigen::MatrixXd& Q_;
  FoundMisfit found_;
  std::vector<Eigen::MatrixXd> roots_;
};

}  // namespace

std::optional<FoundMisfit> find_misfit(std::span<const ResidualsOfRun> runs,
                                       const Eigen::MatrixXd& of_noise, const Eigen::MatrixXd& Q) {
  return Finder(runs, of_noise, Q).find();
}

}  // namespace abbe::calib::otf
