#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "abbe/calib/joint/part.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::joint {
namespace {

/// The rotations of all tables that the common tables do not have.
std::vector<Table> left_out_tables(const ParameterLayout& all, const ParameterLayout& common) {
  std::vector<Table> left_out;
  for (const Table& table : all.tables()) {
    if (!common.find(table.motion)) {
      left_out.push_back(table);
    }
  }
  return left_out;
}

/// Matrix that gives all 18 tables, not in a datum, from the common tables and the left-out
/// rotations phi (columns after those of the common tables). The translations of the axis of phi
/// contain phi x (tool of the common tables).
Eigen::MatrixXd all_tables_of(const CommonTables& common, const ParameterLayout& all) {
  const ParameterLayout& given = common.basis.layout();
  const std::vector<Table> left_out = left_out_tables(all, given);
  auto columns = static_cast<Eigen::Index>(given.model_size());
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(all.fit_size()), columns);
  for (const Table& table : given.tables()) {
    const auto at = static_cast<Eigen::Index>(all.find(table.motion)->offset);
    const auto nodes = static_cast<Eigen::Index>(given.node_count(table.motion.axis));
    M.block(at, static_cast<Eigen::Index>(table.offset), nodes, nodes).setIdentity();
  }
  constexpr Eigen::Index kSquareness = 3;
  M.block(static_cast<Eigen::Index>(all.squareness_offset()),
          static_cast<Eigen::Index>(given.squareness_offset()), kSquareness, kSquareness)
      .setIdentity();

  for (const Table& phi : left_out) {
    const auto nodes = static_cast<Eigen::Index>(all.node_count(phi.motion.axis));
    const Vector3 about = Vector3::Unit(static_cast<Eigen::Index>(direction(phi.motion.motion)));
    const Vector3 displacement_m = about.cross(common.tool_offset_m);
    M.conservativeResize(Eigen::NoChange, columns + nodes);
    M.rightCols(nodes).setZero();
    M.block(static_cast<Eigen::Index>(phi.offset), columns, nodes, nodes).setIdentity();
    for (std::size_t m = 0; m < 3; ++m) {
      const auto translation = all.find({kAllMotions[m], phi.motion.axis});
      M.block(static_cast<Eigen::Index>(translation->offset), columns, nodes, nodes)
          .diagonal()
          .setConstant(-displacement_m(static_cast<Eigen::Index>(m)));
    }
    columns += nodes;
  }
  return M;
}

/// The matrix all_tables_of(), transformed to datum G2 of all 18 tables, in which the bar is
/// adjusted.
Result<Eigen::MatrixXd> all_tables_in_datum(const CommonTables& common, const TableBasis& all) {
  // Three tools that are not on a line, so that the 18 tables are valid for every tool.
  const std::array tools_m{Vector3(0.0, 0.0, 0.0), Vector3(0.1, 0.0, 0.0), Vector3(0.0, 0.1, 0.0)};
  const ParameterLayout& layout = all.layout();
  const estimation::Datum datum(datum_conditions(ModelDatum::G2, all, layout.fit_size()));
  return datum.transformation(unobservable_combinations(layout, tools_m))
      .map([&](const Eigen::MatrixXd& S) {
        const auto model = static_cast<Eigen::Index>(layout.model_size());
        return Eigen::MatrixXd((S * all_tables_of(common, layout)).topRows(model));
      });
}

bool same_nodes(const AxisNodes& a, const AxisNodes& b) {
  constexpr double kSame_m = 1e-9;  // larger than the rounding of decimal numbers in files (mm)
  const auto same = [](double x_m, double y_m) { return std::abs(x_m - y_m) < kSame_m; };
  return std::equal(a.nodes_m.begin(), a.nodes_m.end(), b.nodes_m.begin(), b.nodes_m.end(), same) &&
         same(a.reference_m, b.reference_m);
}

Result<void> check_bar(const mfb::Observations& o, const CommonTables& common) {
  const ParameterLayout &own = o.basis.layout(), &given = common.basis.layout();
  bool same = own.chain().order_w_to_t() == given.chain().order_w_to_t();
  for (const Axis a : kAllAxes) {
    same = same && same_nodes(own.nodes()[index(a)], given.nodes()[index(a)]) &&
           o.basis.interpolation(a).kind() == common.basis.interpolation(a).kind();
  }
  if (!same) {
    return failure(ErrorCode::NotApplicable,
                   "the bar was observed on other axes, nodes or with another interpolation than "
                   "those of the common tables: use bar_machine()");
  }
  return {};
}

/// Axis positions covered by the touches. Readings beyond the nodes are moved to the end node:
/// touches of a hole at the end of the travel are up to its radius beyond it.
std::vector<Vector3> covered_m(const mfb::Observations& o) {
  std::vector<Vector3> covered;
  for (const mfb::PassObservation& pass : o.passes) {
    for (Vector3 q_m : pass.reading_m) {
      for (const Axis a : kAllAxes) {
        const std::vector<double>& nodes_m = o.basis.layout().nodes()[index(a)].nodes_m;
        double& of_axis = q_m(static_cast<Eigen::Index>(index(a)));
        of_axis = std::clamp(of_axis, nodes_m.front(), nodes_m.back());
      }
      covered.push_back(q_m);
    }
  }
  return covered;
}

/// Rows of a bar, with columns for the common tables, the effects of the bar and the left-out
/// rotations.
struct BarRows {
  Eigen::MatrixXd of_tables, of_bar, of_left_out;
  Eigen::VectorXd y;
};

Result<BarRows> rows_of_bar(const mfb::WholeSystem& system, const mfb::Observations& o,
                            const CommonTables& common) {
  const Result<Eigen::MatrixXd> all = all_tables_in_datum(common, o.basis);
  ABBE_TRY(all);
  const mfb::SharedUnknowns& shared = system.shared;
  Eigen::MatrixXd free(shared.parameters(), all->cols());
  for (Eigen::Index k = 0; k < free.cols(); ++k) {
    free.col(k) = shared.free_of(all->col(k));
  }

  Eigen::Index count = 0;
  for (const mfb::PositionSystem& position : system.positions) {
    count += position.E.rows();
  }
  Eigen::MatrixXd E(count, shared.size());
  BarRows rows{.of_tables = {}, .of_bar = {}, .of_left_out = {}, .y = Eigen::VectorXd(count)};
  Eigen::Index first = 0;
  for (const mfb::PositionSystem& position : system.positions) {
    E.middleRows(first, position.E.rows()) = position.E;
    rows.y.segment(first, position.E.rows()) = position.e;
    first += position.E.rows();
  }
  const Eigen::MatrixXd of_model = E.leftCols(shared.parameters()) * free;
  const auto tables = static_cast<Eigen::Index>(common.basis.size());
  rows.of_tables = of_model.leftCols(tables);
  rows.of_left_out = of_model.rightCols(of_model.cols() - tables);
  rows.of_bar = E.rightCols(shared.size() - shared.parameters());
  return rows;
}

/// Removes the unknowns of `eliminated` from the rows; they may have any value. Combinations of
/// them that the rows do not determine are permitted.
void eliminate(const Eigen::MatrixXd& eliminated, Eigen::MatrixXd& A, Eigen::VectorXd& y) {
  constexpr double kRounding = 1e-10;
  if (eliminated.cols() == 0) {
    return;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kRounding);
  qr.compute(eliminated);
  A.applyOnTheLeft(qr.householderQ().adjoint());
  y.applyOnTheLeft(qr.householderQ().adjoint());
  const Eigen::Index left = A.rows() - qr.rank();
  A = A.bottomRows(left).eval();
  y = y.tail(left).eval();
}

}  // namespace

mfb::MfbMachine bar_machine(const CommonTables& common) {
  return {common.basis.layout().chain(), common.basis.layout().nodes(),
          common.basis.interpolation(Axis::X).kind()};
}

Result<Part> part_of_bar(std::string name, const mfb::Observations& o, const CommonTables& common,
                         const BarOptions& options) {
  const auto in_this_part = [&](const Error& e) {
    return Error{e.code, message("joint identification: ", name, ": ", e.text)};
  };
  if (Result<void> valid = check_bar(o, common); !valid) {
    return tl::unexpected(in_this_part(valid.error()));
  }
  const Result<mfb::WholeSystem> system = mfb::whole_system(o, {.u_roll_rad = options.u_roll_rad});
  if (!system) {
    return tl::unexpected(in_this_part(system.error()));
  }
  Result<BarRows> rows = rows_of_bar(*system, o, common);
  if (!rows) {
    return tl::unexpected(in_this_part(rows.error()));
  }

  Part part{.name = std::move(name),
            .method = "mfb",
            .information = estimation::Information(0),
            .covered_m = covered_m(o)};
  Eigen::MatrixXd A = rows->of_tables;
  const auto append = [&](const Eigen::MatrixXd& column, const std::string& effect, double u) {
    A.conservativeResize(Eigen::NoChange, A.cols() + 1);
    A.rightCols<1>() = column;
    part.effects.push_back(effect);
    part.u_of_effects.push_back(u);
  };
  const Eigen::MatrixX3d of_axis = axis_scale_columns(common.basis.layout());
  for (const Axis a : kAllAxes) {
    if (const double u = options.effects.u_axis_scale[index(a)]; u > 0.0) {
      append(rows->of_tables * (u * of_axis.col(static_cast<Eigen::Index>(index(a)))),
             message("scale of ", letter(a)), u);
    }
  }
  const mfb::SharedUnknowns& shared = system->shared;
  const auto of_bar = [&](Eigen::Index unknown) {
    return Eigen::MatrixXd(rows->of_bar.col(unknown - shared.parameters()));
  };
  const Eigen::MatrixXd& calibration_m = shared.bar_root();
  for (Eigen::Index k = 0; k < calibration_m.cols(); ++k) {
    append(of_bar(shared.bar_offset() + k), message("calibration ", k + 1, " of ", options.bar),
           calibration_m.col(k).norm());
  }
  if (shared.alphas() > 0) {
    append(of_bar(shared.alpha_offset()), "expansion of " + options.bar, shared.u_alpha_per_K());
  }
  if (shared.temperatures() > 0) {
    append(of_bar(shared.temperature_offset()), "thermometer of " + options.bar,
           shared.growth_of_temperature());
  }

  eliminate(rows->of_left_out, A, rows->y);
  part.information = estimation::Information(static_cast<std::size_t>(A.cols()));
  part.information.add_rows(A, rows->y);
  return part;
}

}  // namespace abbe::calib::joint
