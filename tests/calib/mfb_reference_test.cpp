#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <string>

#include "abbe/calib/mfb/run/points_of_interest.hpp"
#include "mfb_simulation.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using namespace abbe::tests::mfb;

/// The deviations of the reference at the planned poses.
Observations observations_of(const json& c) {
  Observations o =
      *planned_observations(bar_with(points_in(c.at("x_cal"), kMm)), plan_of(c), paper_machine());
  // The reference has its own nominal bar, at most 0.02 mm beside the pattern.
  const BarTouches nominal = nominal_touches();
  std::vector<Vector3> points_m;
  for (const auto& list : {nominal.holes_m, nominal.rods_m}) {
    for (const auto& feature : list) {
      points_m.insert(points_m.end(), feature.begin(), feature.end());
    }
  }
  for (const auto& pair : nominal.planes_m) {
    for (const auto& plane : pair) {
      points_m.insert(points_m.end(), plane.begin(), plane.end());
    }
  }
  const auto extracted = points_of_interest(nominal, Matrix3::Identity());
  for (std::size_t m = 0; m < o.passes.size(); ++m) {
    o.passes[m].dO_dtouch = extracted->dO_dtouch;
    o.passes[m].normal = extracted->normals;
    const BarPose& pose = o.positions[o.passes[m].position].pose;
    for (std::size_t k = 0; k < points_m.size(); ++k) {
      o.passes[m].reading_m[k] =
          pose.origin_m + pose.axes * points_m[k] - o.plan.measurements[m].tool_offset_m;
    }
    const auto delta_m = points_in(c.at("delta_um").at(m), kUm);
    const Matrix3& axes = o.positions[o.passes[m].position].pose.axes;
    for (std::size_t i = 0; i < delta_m.size(); ++i) {
      o.passes[m].delta_m.segment<3>(3 * static_cast<Eigen::Index>(i)) =
          axes.transpose() * delta_m[i];
    }
  }
  return o;
}

/// Index of "EXX@3" or "EC0Y" in U.
Eigen::Index parameter_of(const ParameterLayout& layout, const std::string& name) {
  for (std::size_t i = 0; i < kSquarenessNames.size(); ++i) {
    if (name == kSquarenessNames[i]) {
      return static_cast<Eigen::Index>(layout.squareness_offset() + i);
    }
  }
  const auto table = layout.find(*error_motion(name.substr(0, 3)));
  return static_cast<Eigen::Index>(table->offset) + std::stoi(name.substr(4));
}

TEST(MfbReference, SimultaneousAdjustmentAgrees) {
  constexpr double kTolerance_um = 0.01;
  const json reference_file = reference("identification_reference.json");
  for (const json& c : reference_file.at("cases")) {
    SCOPED_TRACE(c.at("name").get<std::string>());
    const Observations o = observations_of(c);
    const auto found = solve(o);
    ASSERT_TRUE(found) << found.error().text;
    double worst_um = 0.0, worst_u = 0.0;
    for (std::size_t k = 0; k < c.at("params").size(); ++k) {
      const auto i = parameter_of(o.basis.layout(), c.at("params").at(k));
      const double u_um = c.at("joint_feature_u_k1").at(k);
      worst_um = std::max(worst_um,
                          std::abs(1e6 * found->U(i) - c.at("joint_feature").at(k).get<double>()));
      worst_u = std::max(worst_u, std::abs(1e6 * std::sqrt(found->covariance(i, i)) / u_um - 1.0));
    }
    EXPECT_LT(worst_um, kTolerance_um);
    EXPECT_LT(worst_u, 0.01);
    // The reference has no uncertainty for what the rows neglect (3 nm here).
    EXPECT_NEAR(found->statistics.chi2, c.at("chi2").get<double>(), 2.0);
    EXPECT_NEAR(found->statistics.degrees_of_freedom, 297.0, 0.5);  // the specification, 5.3
    EXPECT_EQ(found->statistics.observations, 612u);
    EXPECT_EQ(found->statistics.rank, found->statistics.unknowns);
    RecordProperty("worst_um", std::to_string(worst_um));
  }
}

TEST(MfbReference, SequenceAgrees) {
  const json reference_file = reference("identification_reference.json");
  for (const json& c : reference_file.at("cases")) {
    SCOPED_TRACE(c.at("name").get<std::string>());
    const Observations o = observations_of(c);
    const auto found = solve(o, {.estimator = Estimator::Sequential});
    ASSERT_TRUE(found) << found.error().text;
    for (const auto& [name, values] : c.at("sequential").items()) {
      const bool table = values.is_array();
      double worst = 0;
      for (std::size_t k = 0; k < (table ? values.size() : 1); ++k) {
        const auto i =
            parameter_of(o.basis.layout(), table ? name + "@" + std::to_string(k) : name);
        const double expected = table ? values.at(k).get<double>() : values.get<double>();
        worst = std::max(worst, std::abs(1e6 * found->U(i) - expected));
      }
      EXPECT_LT(worst, 0.01) << name;
    }
  }
}

/// U with the same value at all nodes of each table; the tables of the squareness turn the tool in
/// eq. 8, in the model they do not.
Eigen::VectorXd constant_errors(const ParameterLayout& layout,
                                const std::function<double(const std::string&)>& error) {
  Eigen::VectorXd U(static_cast<Eigen::Index>(layout.model_size()));
  for (const Table& table : layout.tables()) {
    const std::string motion = name(table.motion);
    double value = error(motion);
    value += motion == "ECY" ? error("EC0Y") : 0.0;
    value += motion == "EAZ" ? error("EA0Z") : (motion == "EBZ" ? error("EB0Z") : 0.0);
    U.segment(static_cast<Eigen::Index>(table.offset),
              static_cast<Eigen::Index>(layout.node_count(table.motion.axis)))
        .setConstant(value);
  }
  U.tail<3>() << error("EA0Z"), error("EB0Z"), error("EC0Y");
  return U;
}

TableBasis paper_basis() {
  const MfbMachine machine = paper_machine();
  return *TableBasis::of(*ParameterLayout::all_tables(machine.chain, machine.nodes),
                         TableOptions::all_axes(machine.interpolation));
}

Vector3 V_of(const TableBasis& basis, const Eigen::VectorXd& U, const Vector3& q_m,
             const Vector3& tool_m) {
  return basis.V_m({.q_m = q_m, .tool_offset_m = tool_m},
                   {U.data(), static_cast<std::size_t>(U.size())});
}

TEST(MfbErrorModel, IsMinusTheDeviationOfEquations10To12) {
  constexpr double kRounding_m = 1e-15;  // 1e-12 mm
  const json rows = reference("htm_reference.json").at("rows");
  EXPECT_EQ(rows.size(), 40u);
  const TableBasis basis = paper_basis();
  for (const json& row : rows) {
    const Eigen::VectorXd U = constant_errors(basis.layout(), [&](const std::string& error) {
      const double value = row.at("E").at(error);
      return error[1] < 'X' ? value : value * kMm;  // A, B, C: rotations
    });
    const Vector3 V_m =
        V_of(basis, U, vector_in(row.at("reading"), kMm), -vector_in(row.at("J"), kMm));
    EXPECT_LT((V_m + vector_in(row.at("delta_eq10_12"), kMm)).norm(), kRounding_m);
  }
}

TEST(MfbErrorModel, NeglectsLessThanTenNanometresOfEquation8) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> travel(0.0, 0.55);
  const SimulatedMachine machine(random, 0.5);  // rotations up to 50 urad, as in the paper
  const TableBasis basis = paper_basis();
  double largest_m = 0.0;
  for (int i = 0; i < 200; ++i) {
    const Vector3 tool_m = 0.1 * Vector3(i % 3 - 1, (i / 3) % 3 - 1, -1.5);
    const Vector3 p_m = Vector3(travel(random), travel(random), travel(random)) + tool_m;
    const Vector3 q_m = machine.reading_m(p_m, tool_m);
    const Eigen::VectorXd U = constant_errors(basis.layout(), [&](const std::string& error) {
      if (error == "EA0Z" || error == "EB0Z" || error == "EC0Y") {
        return error == "EA0Z" ? machine.EA0Z : (error == "EB0Z" ? machine.EB0Z : machine.EC0Y);
      }
      const ErrorMotion e = *error_motion(error);
      const std::size_t axis = index(e.axis);
      return machine.error[axis][static_cast<std::size_t>(e.motion)].at(
          q_m(static_cast<Eigen::Index>(axis)));
    });
    largest_m = std::max(largest_m, (V_of(basis, U, q_m, tool_m) - (p_m - q_m - tool_m)).norm());
  }
  EXPECT_LT(largest_m, 10e-9);
  EXPECT_GT(largest_m, 0.1e-9);  // the exact transforms are not linear
}

}  // namespace
