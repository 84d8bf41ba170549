// Error texts of joint/part.hpp and joint/identify.hpp.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/joint/identify.hpp"
#include "otf_run.hpp"

namespace {
namespace joint = abbe::calib::joint;
using abbe::calib::ErrorCode;
using abbe::calib::Interpolation;
using abbe::calib::MachineNodes;
using abbe::calib::ModelDatum;
using abbe::calib::TableBasis;
using abbe::calib::TableOptions;
using abbe::calib::Vector3;
using abbe::calib::VolumetricModel;
using testing::HasSubstr;

const Vector3 kErrorsTool_m(0.02, -0.015, -0.12);

MachineNodes usual_nodes() {
  return abbe::tests::otf::coarse_machine("[w X' b Y Z (C1) t]").nodes;
}

VolumetricModel zero_model(const std::string& chain = "[w X' b Y Z (C1) t]",
                           const MachineNodes& nodes = usual_nodes(),
                           Interpolation kind = Interpolation::Linear) {
  abbe::calib::otf::Machine machine = abbe::tests::otf::coarse_machine(chain);
  machine.nodes = nodes;
  const TableBasis basis =
      *TableBasis::of(abbe::tests::otf::layout_of(machine), TableOptions::all_axes(kind));
  const Eigen::MatrixXd N = abbe::calib::datum_coordinates(basis).N;
  const Eigen::MatrixXd C = 1e-12 * N * N.transpose();
  const std::array<Vector3, 4> hull{Vector3(0, 0, 0), Vector3(0.1, 0, 0), Vector3(0, 0.1, 0),
                                    Vector3(0, 0, -0.1)};
  return *VolumetricModel::from_vector(basis.layout(), ModelDatum::G1, std::array{kErrorsTool_m},
                                       Eigen::VectorXd::Zero(N.rows()), 0.5 * (C + C.transpose()),
                                       *abbe::calib::ValidityVolume::hull_of(hull), kind);
}

joint::Part part_of(const std::string& name, const joint::CommonTables& common) {
  return *joint::part_of_run(name, zero_model(), common);
}

TEST(JointErrors, StateWhatDiffersFromTheCommonTables) {
  const joint::CommonTables common = *joint::tables_of(zero_model());
  const auto text = [&](const VolumetricModel& model) {
    const auto part = joint::part_of_run("run 2", model, common);
    EXPECT_TRUE(part || part.error().code == ErrorCode::NotApplicable);
    return part ? "" : part.error().text;
  };
  EXPECT_EQ(text(zero_model()), "");
  EXPECT_THAT(text(zero_model("[w b Z X Y (C1) t]")),
              HasSubstr("joint identification: run 2 has the axes "));
  EXPECT_THAT(text(zero_model("[w X' b Y Z (C1) t]", usual_nodes(), Interpolation::NaturalCubic)),
              HasSubstr("run 2 has cubic tables of X, not linear"));

  MachineNodes nodes = usual_nodes();
  nodes[1].nodes_m.push_back(0.3);
  EXPECT_THAT(text(zero_model("[w X' b Y Z (C1) t]", nodes)),
              HasSubstr("run 2 has 4 nodes of Y, not 3"));
  nodes = usual_nodes();
  nodes[2].nodes_m[1] = -0.15;
  EXPECT_THAT(text(zero_model("[w X' b Y Z (C1) t]", nodes)),
              HasSubstr("run 2 has a node at Z = -150 mm, not at -200 mm"));
  nodes = usual_nodes();
  nodes[0].reference_m = 0.1;
  EXPECT_THAT(text(zero_model("[w X' b Y Z (C1) t]", nodes)),
              HasSubstr("run 2 has the reference X = 100 mm, not 0 mm"));
}

TEST(JointErrors, StateWhatModelHasNoCommonTables) {
  const VolumetricModel model = zero_model();
  const auto layout = *abbe::calib::ParameterLayout::all_tables(model.chain(), usual_nodes());
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  const std::array<Vector3, 2> tools{kErrorsTool_m, Vector3::Zero()};
  const VolumetricModel two =
      *VolumetricModel::from_vector(layout, ModelDatum::G1, tools, Eigen::VectorXd::Zero(n),
                                    Eigen::MatrixXd::Zero(n, n), model.validity());
  EXPECT_EQ(joint::tables_of(two).error().text,
            "joint identification: the model has 2 tool offsets, must have one");
  EXPECT_THAT(joint::part_of_run("run 2", two, *joint::tables_of(model)).error().text,
              HasSubstr("(run 2)"));
}

/// Half the backlash is common to all runs and is no part of the datum's coordinates.
TEST(JointErrors, RefuseBacklashInTheCovariance) {
  const VolumetricModel model = zero_model();
  const auto& layout = model.tables()->layout();
  Eigen::VectorXd half = Eigen::VectorXd::Zero(model.U().size());
  half.head(static_cast<Eigen::Index>(layout.node_count(layout.tables()[0].motion.axis)))
      .setConstant(1e-6);
  const VolumetricModel with =
      *VolumetricModel::from_vector(layout, ModelDatum::G1, std::array{kErrorsTool_m}, model.U(),
                                    model.covariance() + half * half.transpose(), model.validity());

  ASSERT_TRUE(joint::tables_of(model));
  EXPECT_EQ(joint::tables_of(with).error().code, ErrorCode::NotApplicable);
  EXPECT_THAT(joint::tables_of(with).error().text, HasSubstr("half its backlash"));
}

TEST(JointErrors, NameThePartsThatCannotBeTested) {
  const joint::CommonTables common = *joint::tables_of(zero_model());
  const joint::Part one = part_of("one", common), two = part_of("two", common);
  const auto text = [&](const std::vector<joint::Part>& parts, double false_alarm = 1e-3) {
    const auto result = joint::identify(parts, common, {.false_alarm = false_alarm});
    EXPECT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::BadInput);
    return result.error().text;
  };
  EXPECT_THAT(text({}), HasSubstr("0 parts, needs 2"));
  EXPECT_THAT(text({one}), HasSubstr("1 parts, needs 2"));
  EXPECT_THAT(text({one, one}), HasSubstr("two parts have the name one"));
  EXPECT_THAT(text({one, two}, 0.0), HasSubstr("false-alarm probability 0"));
  EXPECT_THAT(text({one, two}, 1.0), HasSubstr("false-alarm probability 1"));
  joint::Part more = two;
  more.effects.push_back("an effect without a column");
  EXPECT_THAT(text({one, more}), HasSubstr("two has "));
}

TEST(JointErrors, NameParametersThatNoPartDetermines) {
  const joint::CommonTables common = *joint::tables_of(zero_model());
  joint::Part nothing = part_of("nothing", common);
  nothing.information = abbe::calib::estimation::Information(common.basis.size());
  const auto model = joint::joint_model(std::array{nothing}, common);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(model.error().text, HasSubstr("EXX"));
}

}  // namespace
