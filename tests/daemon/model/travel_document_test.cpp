// model.json of a model whose V depends on the direction of travel.
#include <gmock/gmock.h>

#include <array>

#include "abbe/model/model_document.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using calib::Travel;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

ModelDocument travel_document() {
  auto document = test::synthetic_document(12);
  document.model = test::synthetic_travel_model(12);
  return document;
}

std::vector<std::string> faults_after(const std::string& what, const std::string& with) {
  auto text = to_json(travel_document());
  const auto at = text.find(what, text.find("\"travel\": {"));
  if (at == std::string::npos) return {"not in the text: " + what};
  const auto read = parse_model(text.replace(at, what.size(), with), "model.json");
  return read ? std::vector<std::string>{} : read.error().details;
}

TEST(TravelDocument, ReadsBackToTheSameBytesAndTheSameV) {
  const auto written = travel_document();
  const auto read = parse_model(to_json(written), "model.json");
  ASSERT_TRUE(read) << read.error().text << read.error().details.front();
  EXPECT_EQ(to_json(*read), to_json(written));
  const calib::Vector3 q(0.1, 0.05, -0.2), tool = written.model.tool_offsets_m().front();
  const calib::AxisTravel travel{Travel::Forward, Travel::Backward, Travel::Forward};
  const auto a = written.model.error_at(q, tool, travel), b = read->model.error_at(q, tool, travel);
  EXPECT_EQ(a.V_m, b.V_m);
  EXPECT_EQ(a.cov_V_m2, b.cov_V_m2);
  EXPECT_GT((a.V_m - written.model.V_at(q, tool)).norm(), 1e-6);
}

TEST(TravelDocument, HashFollowsADifferenceAndItsCovariance) {
  const auto hash_with = [](auto change) {
    auto travel = *test::synthetic_travel_model(12).travel();
    change(travel);
    return model_hash({test::synthetic_travel_model(12).with_travel(travel).value()});
  };
  const auto hash = hash_with([](calib::TravelDifferences&) {});
  EXPECT_NE(hash, hash_with([](auto& d) { d.D(3) = std::nextafter(d.D(3), 1.0); }));
  EXPECT_NE(hash, hash_with([](auto& d) { d.covariance(2, 2) *= 1.5; }));
  EXPECT_NE(hash, hash_with([](auto& d) { d.cov_U_D(4, 1) = 1e-18; }));
  EXPECT_EQ(hash, model_hash({travel_document().model, "otf"}));
}

/// The text of a model without backlash has no member of it, and its hash is that of version 1.
TEST(TravelDocument, IsNotWrittenForAModelWithoutBacklash) {
  EXPECT_THAT(to_json(test::synthetic_document(12)), Not(HasSubstr("travel\": {")));
}

TEST(TravelDocument, IsNamedWhereItIsUnreadable) {
  EXPECT_THAT(faults_after("per-table", "some"),
              Contains(HasSubstr("travel.kind: must be \"per-table\" or \"forward-backward\"")));
  EXPECT_THAT(faults_after("\"EXX\"", "\"EXQ\""),
              Contains(HasSubstr("travel.differences[0].name: must be an error such as EXX")));
  EXPECT_THAT(faults_after("\"EXX\"", "\"EYX\""),
              Contains(HasSubstr("travel.differences[0]: is EYX, expected EXX")));
  EXPECT_THAT(faults_after("\"unit\": \"um\"", "\"unit\": \"urad\""),
              Contains(HasSubstr("travel.differences[0].unit: must be \"um\"")));
  EXPECT_THAT(faults_after("\"covariance\": [", "\"covariance\": [1,"),
              Contains(HasSubstr("travel.covariance: ")));
  EXPECT_THAT(faults_after("\"covariance\": [", "\"covariances\": ["),
              Contains(HasSubstr("travel.covariance: missing")));
  EXPECT_THAT(faults_after("\"value\": 2.3", "\"value\": 2.4"),
              Contains(HasSubstr("is not positive semidefinite together with that of the tables")));
  EXPECT_THAT(faults_after("0.0033333", "0.0043333"),
              Contains(HasSubstr("hash: is not the hash of the content")));
}

}  // namespace
}  // namespace abbe::daemon
