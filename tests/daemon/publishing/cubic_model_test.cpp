// A model of cubic tables from the configuration to store and subscribers.
#include <gmock/gmock.h>

#include "abbe/calib/model/interpolation_grid.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/publishing/idl_messages.hpp"
#include "config_fixture.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using calib::Interpolation;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

ModelDocument document_of(Interpolation interpolation) {
  ModelDocument document = test::synthetic_document(3);
  auto description = document.model.description();
  description.interpolation = interpolation;
  document.model = calib::VolumetricModel::from_description(std::move(description)).value();
  return document;
}

std::string replaced_once(std::string text, const std::string& what, const std::string& with) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

TEST(CubicModelDocument, ReadsBackToTheSameModel) {
  const auto written = document_of(Interpolation::NaturalCubic);
  const auto text = to_json(written);
  EXPECT_THAT(text, HasSubstr("\"kind\": \"cubic\""));
  EXPECT_THAT(text, HasSubstr("\"nodes_mm\": [-300, -150, 0, "));
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().details.front();
  EXPECT_EQ(read->model.interpolation(), Interpolation::NaturalCubic);
  EXPECT_EQ(model_hash(*read), model_hash(written));
  const calib::Vector3 q(0.07, -0.11, -0.23), t(0.02, -0.015, -0.12);
  EXPECT_EQ(read->model.error_at(q, t).V_m, written.model.error_at(q, t).V_m);
  EXPECT_EQ(read->model.error_at(q, t).cov_V_m2, written.model.error_at(q, t).cov_V_m2);
  EXPECT_EQ(to_json(*read), text);
}

TEST(CubicModelDocument, TellsTheEndConditionsApart) {
  const auto written = document_of(Interpolation::NotAKnotCubic);
  const auto text = to_json(written);
  EXPECT_THAT(text, HasSubstr("\"kind\": \"not-a-knot-cubic\""));
  const auto read = parse_model(text, "model.json");
  ASSERT_TRUE(read) << read.error().details.front();
  EXPECT_EQ(read->model.interpolation(), Interpolation::NotAKnotCubic);
  EXPECT_EQ(to_json(*read), text);
  EXPECT_NE(model_hash(written), model_hash(document_of(Interpolation::NaturalCubic)));
}

TEST(CubicModelDocument, HasAnotherHashThanLinearTables) {
  EXPECT_NE(model_hash(document_of(Interpolation::NaturalCubic)),
            model_hash(document_of(Interpolation::Linear)));
  EXPECT_EQ(model_hash(document_of(Interpolation::Linear)),
            model_hash(test::synthetic_document(3)));
}

TEST(CubicModelDocument, IsRefusedWithAKindThatThisVersionDoesNotKnow) {
  const auto text = replaced_once(to_json(document_of(Interpolation::NaturalCubic)),
                                  "\"kind\": \"cubic\"", "\"kind\": \"quintic\"");
  const auto read = parse_model(text, "model.json");
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().details,
              ElementsAre(HasSubstr(
                  "basis.kind: is \"quintic\", must be \"linear\", \"cubic\", "
                  "\"not-a-knot-cubic\" or \"legendre\"; another kind needs a newer abbe")));
  const auto changed = replaced_once(to_json(document_of(Interpolation::NaturalCubic)),
                                     "\"kind\": \"cubic\"", "\"kind\": \"linear\"");
  EXPECT_FALSE(parse_model(changed, "model.json"));  // the hash does not fit
}

TEST(CubicModelMessages, StateTheErrorOfLinearInterpolation) {
  const PublishedModel model{.id = "m",
                             .method = "otf",
                             .estimator = "simultaneous",
                             .recording_sha256 = {},
                             .model = document_of(Interpolation::NaturalCubic).model};
  EXPECT_EQ(model_message(model, {}).basis(), "cubic");
  const auto grid = calib::interpolation_grid(model.model, 4096);
  std::size_t nodes = 0, wider = 0;
  for (const auto& slice : grid_messages(model, {})) {
    EXPECT_FALSE(slice.every_node());
    for (const auto& node : slice.nodes()) {
      const auto& q = node.position_m();
      const auto e = model.model.error_at({q[0], q[1], q[2]}, model.model.tool_offsets_m().front());
      const std::size_t of_z = grid.axes_m[2].size(), of_y = grid.axes_m[1].size();
      const auto missed = calib::interpolation_error(
          model.model, grid, {nodes / (of_y * of_z), nodes / of_z % of_y, nodes % of_z});
      EXPECT_EQ(node.error_m()[0], e.V_m.x() + missed.mean_m.x());
      wider += node.cov_m2()[0] > e.cov_V_m2(0, 0) ? 1 : 0;
      ++nodes;
    }
  }
  EXPECT_GT(nodes, 3000u);
  EXPECT_LE(nodes, 4096u);
  EXPECT_GT(wider, nodes / 2);
}

/// The machine of the tests ends with its [model].
TEST(CubicModelConfig, IsChosenByTheBasisOfTheModel) {
  const auto cubic = parse_config(kMachine + "basis = \"cubic\"\n", "abbed.toml");
  ASSERT_TRUE(cubic) << cubic.error().details.front();
  EXPECT_EQ(otf_machine(cubic->machine)->interpolation, Interpolation::NaturalCubic);
  const auto free_ends = parse_config(kMachine + "basis = \"not-a-knot-cubic\"\n", "abbed.toml");
  ASSERT_TRUE(free_ends) << free_ends.error().details.front();
  EXPECT_EQ(otf_machine(free_ends->machine)->interpolation, Interpolation::NotAKnotCubic);
  const auto usual = parse_config(kMachine, "abbed.toml");
  ASSERT_TRUE(usual);
  EXPECT_EQ(otf_machine(usual->machine)->interpolation, Interpolation::Linear);
  EXPECT_EQ(machine_hash(*cubic), machine_hash(*usual));  // it is the same machine
}

TEST(CubicModelConfig, RefusesOtherWordsAndTooManyNodes) {
  EXPECT_THAT(faults_of(kMachine + "basis = \"spline\"\n"), ElementsAre(HasSubstr("model.basis")));
  EXPECT_THAT(faults_of(replaced_once(kMachine, "mm = 50\n", "mm = 1\nbasis = \"cubic\"\n")),
              ::testing::Contains(HasSubstr("cubic tables have at most 500")));
}

}  // namespace
}  // namespace abbe::daemon
