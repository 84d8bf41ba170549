// What is published is what subscribers of two DDS implementations read, whenever they join.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "sample_messages.hpp"
#include "shop_floor.hpp"

namespace abbe::test {
namespace {

std::string g17(double v) {
  return fmt::format("{:.17g}", v);
}

std::vector<std::string> model_lines() {
  const auto m = error_model();
  std::vector<std::string> lines{fmt::format(
      "model {} {} {} {} {} {} {} {} {} {} {} {} {} {}", m.machine(), m.sequence_number(),
      m.model_id(), m.method(), m.estimator(), m.gauge(), m.chain(), m.basis(), m.squareness(),
      g17(m.tool_offset_m()[0]), g17(m.tool_offset_m()[1]), g17(m.tool_offset_m()[2]),
      m.recording_sha256(), m.created_utc_ns())};

  for (const auto& p : m.parameters()) {
    lines.push_back(fmt::format("parameter {} {} {} {}", p.name(), g17(p.position_m()),
                                g17(p.value()), g17(p.u())));
  }

  for (const auto& r : m.validity()) {
    lines.push_back(fmt::format("validity {} {} {}", r.axis(), g17(r.min_m()), g17(r.max_m())));
  }

  for (const auto& v : m.validity_hull()) {
    const auto& p = v.position_m();
    lines.push_back(fmt::format("hull {} {} {}", g17(p[0]), g17(p[1]), g17(p[2])));
  }

  return lines;
}

std::vector<std::string> slice_lines() {
  const auto g = grid_slices()[1];
  std::vector<std::string> lines{fmt::format("grid {} {} {} {} {} {:d}", g.machine(), g.slice(),
                                             g.slices(), g.sequence_number(), g.model_id(),
                                             g.every_node())};
  for (const auto& n : g.nodes()) {
    const auto& p = n.position_m();
    const auto& e = n.error_m();
    lines.push_back(fmt::format("node {} {} {} {} {} {} {} {:d}", g17(p[0]), g17(p[1]), g17(p[2]),
                                g17(e[0]), g17(e[1]), g17(e[2]), g17(n.cov_m2()[5]), n.inside()));
  }
  return lines;
}

std::vector<std::string> texts(Process& process) {
  std::vector<std::string> texts;
  for (const Line& line : process.lines()) texts.push_back(line.text);
  return texts;
}

using DdsInteroperation = ShopFloor;

TEST_F(DdsInteroperation, CycloneThatJoinsLateReadsModelAndGridFieldByField) {
  start_feeder();
  {
    // Another subscriber already has the model: it was published before the late one joins.
    Process early(watch({"--until-model", "--timeout-s", "20"}));
    ASSERT_EQ(early.wait_for_end(), 0) << early.transcript();
  }
  Process late({ABBE_CYCLONE_FIELDS_PROGRAM, domain_.text()});
  ASSERT_EQ(late.wait_for_end(), 0) << late.transcript();
  EXPECT_THAT(texts(late), testing::IsSupersetOf(model_lines()));
  EXPECT_THAT(texts(late), testing::IsSupersetOf(slice_lines()));
}

// It misses the first heartbeat of abbe-dds's discovery; the second would come a second later.
TEST_F(DdsInteroperation, CycloneThatJoinsLateDoesNotWaitForTheSecondHeartbeat) {
  start_feeder();
  Process early(cyclone_subscriber());
  ASSERT_TRUE(early.wait_for("vmc-3: apply V")) << early.transcript();
  std::vector<double> joined_s;

  for (int i = 0; i < 5; ++i) {
    const auto start = Clock::now();
    Process late(cyclone_subscriber());
    const auto state = late.wait_for("vmc-3: state 1");
    ASSERT_TRUE(state.has_value()) << late.transcript();
    joined_s.push_back(std::chrono::duration<double>(state->came - start).count());
  }

  std::ranges::sort(joined_s);
  std::printf("  joined within %.2f s (median), %.2f s (worst)\n", joined_s[2], joined_s[4]);
  EXPECT_LT(joined_s[2], 0.7);  // about 0.1 s, and 0.9 s if it waits
}

TEST_F(DdsInteroperation, CycloneThatWaitsReadsTheModelWhenItComes) {
  Process early({ABBE_CYCLONE_FIELDS_PROGRAM, domain_.text()});
  start_feeder();
  ASSERT_EQ(early.wait_for_end(), 0) << early.transcript();
  EXPECT_THAT(texts(early), testing::IsSupersetOf(model_lines()));
}

TEST_F(DdsInteroperation, FastSubscriberReadsEveryFieldOfTheModel) {
  start_feeder();
  Process process(watch({"--json", "--until-model", "--timeout-s", "20"}));
  ASSERT_EQ(process.wait_for_end(), 0) << process.transcript();
  const auto line = process.wait_for(R"({"topic":"abbe/v1/ErrorModel")");
  ASSERT_TRUE(line.has_value());
  const auto json = nlohmann::json::parse(line->text);
  const auto expected = error_model();
  EXPECT_EQ(json["chain"], expected.chain());
  EXPECT_EQ(json["created_utc_ns"], expected.created_utc_ns());
  ASSERT_EQ(json["parameters"].size(), expected.parameters().size());
  for (std::size_t i = 0; i < expected.parameters().size(); ++i) {
    EXPECT_EQ(json["parameters"][i]["value"], expected.parameters()[i].value());
  }
}

TEST_F(DdsInteroperation, WatchComparesTheReceivedGridWithKnownErrors) {
  const auto known = directory_ / "known.csv";
  {
    std::ofstream csv(known);
    csv << "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
    for (const double at : {0.05, 0.21, 0.4, 0.77}) {
      const std::array<double, 3> p{at, 0.8 * at * at, 0.8 - at};  // not on a line
      const auto e = error_at(p);
      csv << fmt::format("{},{},{},{},{},{}\n", p[0] * 1e3, p[1] * 1e3, p[2] * 1e3, e[0] * 1e6,
                         e[1] * 1e6, e[2] * 1e6);
    }
  }
  start_feeder();
  const auto grid = directory_ / "grid.csv";
  Process process(watch({"--json", "--timeout-s", "20", "--grid-csv", grid, "--compare", known}));
  ASSERT_EQ(process.wait_for_end(), 0) << process.transcript();
  const auto line = process.wait_for(R"({"comparison")");
  ASSERT_TRUE(line.has_value());
  const auto comparison = nlohmann::json::parse(line->text)["comparison"];
  EXPECT_EQ(comparison["points"], 4);
  EXPECT_GT(comparison["before_mean_um"], 10.0);
  // The sample errors are linear along every axis, so nothing but rounding is left between the
  // nodes.
  EXPECT_LT(comparison["after_max_um"], 1e-6);
  std::ifstream written(grid);
  std::size_t rows = 0;
  for (std::string row; std::getline(written, row);) ++rows;
  EXPECT_EQ(rows, 1 + kNodesPerAxis * kNodesPerAxis * kNodesPerAxis);
}

TEST_F(DdsInteroperation, WatchWithoutAPublisherReportsItAndEndsWithOne) {
  Process process(watch({"--until-model", "--timeout-s", "0.3"}));
  EXPECT_EQ(process.wait_for_end(), 1);
}

}  // namespace
}  // namespace abbe::test
