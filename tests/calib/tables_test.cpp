#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/geometry/parameter_layout.hpp"

namespace {
using namespace abbe::calib;
using testing::ElementsAre;

TEST(ErrorMotion, NamesGoThereAndBack) {
  for (const Axis axis : kAllAxes) {
    for (const Motion motion : kAllMotions) {
      const ErrorMotion e{motion, axis};
      EXPECT_EQ(error_motion(name(e)), e);
    }
  }
  EXPECT_EQ(name({Motion::B, Axis::X}), "EBX");
}

TEST(ErrorMotion, RefusesOtherNames) {
  EXPECT_FALSE(error_motion("EC0Y"));
  EXPECT_FALSE(error_motion("EXC"));
  EXPECT_FALSE(error_motion("FXX"));
}

TEST(Nodes, DivideTheRangeEquallyAndKeepBothEnds) {
  const Result<AxisNodes> axis = equidistant_nodes(-0.3, 0.3, 0.05);
  ASSERT_TRUE(axis);
  ASSERT_EQ(axis->nodes_m.size(), 13u);
  EXPECT_EQ(axis->nodes_m.front(), -0.3);
  EXPECT_EQ(axis->nodes_m.back(), 0.3);
  EXPECT_EQ(axis->reference_m, 0.0);
}

TEST(Nodes, ReferenceIsTheMinimumWhereZeroIsOutside) {
  EXPECT_EQ(equidistant_nodes(0.1, 0.5)->reference_m, 0.1);
}

TEST(Nodes, RefuseARangeThatIsNone) {
  EXPECT_FALSE(equidistant_nodes(0.3, 0.3));
  EXPECT_FALSE(equidistant_nodes(0.0, 1.0, 0.0));
  EXPECT_FALSE(equidistant_nodes(0.0, std::nan("")));
  EXPECT_FALSE(check_nodes(std::vector<double>{0.0, 0.2, 0.1}));
}

TEST(LinearBasis, ReproducesStraightLinesInsideAndOutside) {
  const std::vector<double> nodes{-1.0, 0.5, 2.0, 2.5};
  for (const double q : {-3.0, -1.0, 0.1, 0.5, 1.9, 2.5, 4.0}) {
    const BasisRow b = basis_row(nodes, q);
    EXPECT_NEAR(b.weight[0] + b.weight[1], 1.0, 1e-15);
    EXPECT_NEAR(b.weight[0] * nodes[b.first] + b.weight[1] * nodes[b.first + 1], q, 1e-14);
  }
}

MachineNodes three_axes() {
  return {*equidistant_nodes(-0.3, 0.3), *equidistant_nodes(-0.25, 0.25),
          *equidistant_nodes(-0.4, 0.0)};
}

TEST(ParameterLayout, KeepsThe14TablesOneTargetShows) {
  const auto layout = ParameterLayout::observable_with_one_target({}, three_axes());
  ASSERT_TRUE(layout);
  std::vector<std::string> names;
  for (const auto& t : layout->tables()) {
    names.push_back(name(t.motion));
  }
  EXPECT_THAT(names, ElementsAre("EXX", "EYX", "EZX", "EAX", "EBX", "ECX", "EXY", "EYY", "EZY",
                                 "EAY", "EBY", "EXZ", "EYZ", "EZZ"));
  EXPECT_EQ(layout->model_size(), 163u);
}

TEST(ParameterLayout, DropsTheRotationsOfWhicheverAxisIsLast) {
  const KinematicChain chain = *KinematicChain::parse("[w Z' b X Y t]");
  const auto layout = ParameterLayout::observable_with_one_target(chain, three_axes());
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->tables().size(), 14u);
  EXPECT_FALSE(layout->find({Motion::A, Axis::Y}));
  EXPECT_FALSE(layout->find({Motion::B, Axis::X}));
  EXPECT_TRUE(layout->find({Motion::C, Axis::X}));
}

TEST(ParameterLayout, LabelsEveryParameter) {
  const auto layout = ParameterLayout::observable_with_one_target({}, three_axes());
  EXPECT_EQ(layout->label(0), "EXX at -0.300 m");
  EXPECT_EQ(layout->label(162), "EC0Y");
  EXPECT_EQ(layout->label(166), "rx");
}

}  // namespace
