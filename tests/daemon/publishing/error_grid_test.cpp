/// What subscribers learn of a model and of where it holds.

#include <gmock/gmock.h>

#include "abbe/publishing/idl_messages.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;

PublishedModel published(calib::VolumetricModel model) {
  return {.id = "m",
          .method = "otf",
          .estimator = "two-step",
          .recording_sha256 = {},
          .model = std::move(model)};
}

std::vector<v1::GridNode> nodes_of(const std::vector<v1::ErrorGrid>& slices) {
  std::vector<v1::GridNode> nodes;
  for (const auto& slice : slices)
    nodes.insert(nodes.end(), slice.nodes().begin(), slice.nodes().end());
  return nodes;
}

Vector3 position(const v1::GridNode& node) {
  return {node.position_m()[0], node.position_m()[1], node.position_m()[2]};
}

/// The synthetic model again, but its data reached X = 0 only.
calib::VolumetricModel of_half_the_volume() {
  const auto whole = test::synthetic_model(1);
  std::vector<Vector3> corners;
  for (int i = 0; i < 8; ++i) {
    corners.emplace_back((i & 1) != 0 ? 0.0 : -0.3, (i & 2) != 0 ? 0.3 : -0.3,
                         (i & 4) != 0 ? -0.1 : -0.4);
  }
  return calib::VolumetricModel::from_vector(whole.tables()->layout(), whole.datum(),
                                             whole.tool_offsets_m(), whole.U(), whole.covariance(),
                                             calib::ValidityVolume::hull_of(corners).value())
      .value();
}

TEST(ErrorGrid, MarksEveryNodeAsCoveredByTheDataOrNot) {
  const auto nodes = nodes_of(grid_messages(published(of_half_the_volume()), {}));
  std::size_t inside = 0;
  for (const auto& node : nodes) {
    EXPECT_EQ(node.inside(), position(node).x() < 1e-6) << position(node).transpose();
    inside += node.inside() ? 1 : 0;
  }
  EXPECT_GT(inside, 0u);
  EXPECT_LT(inside, nodes.size());
}

TEST(ErrorGrid, HoldsEveryNodeWhileTheyFit) {
  const auto model = published(test::synthetic_model(1, 3.0));  // 13 x 13 x 10
  const auto slices = grid_messages(model, {});
  EXPECT_EQ(nodes_of(slices).size(), 13u * 13u * 10u);
  for (const auto& slice : slices) EXPECT_TRUE(slice.every_node());
}

TEST(ErrorGrid, ReducesTheNodesOfTheLongestAxesAndReportsIt) {
  const auto model = published(test::synthetic_model(1, 6.0));  // 25 x 25 x 19
  const auto slices = grid_messages(model, {});
  const auto nodes = nodes_of(slices);
  EXPECT_LE(nodes.size(), 4096u);
  EXPECT_GT(nodes.size(), 3600u);
  for (const auto& slice : slices) EXPECT_FALSE(slice.every_node());
  EXPECT_NEAR((position(nodes.front()) - Vector3(-0.3, -0.3, -0.4)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((position(nodes.back()) - Vector3(0.3, 0.3, -0.1)).norm(), 0.0, 1e-12);
}

TEST(ErrorModel, CarriesTheHullOfWhatTheDataCovered) {
  const auto model = published(of_half_the_volume());
  const auto message = model_message(model, {});
  std::vector<Vector3> vertices;
  for (const auto& v : message.validity_hull()) {
    vertices.emplace_back(v.position_m()[0], v.position_m()[1], v.position_m()[2]);
  }
  const auto hull = calib::ValidityVolume::hull_of(vertices).value();
  EXPECT_TRUE(hull.contains({-0.1, 0.2, -0.2}));
  EXPECT_FALSE(hull.contains({0.1, 0.2, -0.2}));
}

}  // namespace
}  // namespace abbe::daemon
