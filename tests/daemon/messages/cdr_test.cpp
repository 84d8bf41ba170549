#include "abbe/messages/cdr.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <random>
#include <sstream>
#include <string>

#include "abbe/messages/topics.hpp"

namespace abbe::daemon {
namespace {

using testing::HasSubstr;
using namespace std::chrono_literals;

v1::Snapshot some_snapshot() {
  v1::Snapshot s;
  s.machine("vmc-3");
  s.sequence_number(42);
  s.host_time_ns(-7);
  s.position({0.1, 0.2, 0.3});
  s.velocity({1.0, 2.0, 3.0});
  s.u_position({1e-6, 2e-6, 3e-6});
  s.has_tracker_point(true);
  s.p_tracker_m({1.5, -2.5, 0.25});
  s.relative_humidity(0.5);
  return s;
}

v1::ErrorModel some_model() {
  v1::ErrorModel m;
  m.machine("vmc-3");
  m.model_id("otf-1");
  m.chain("[w X' b Y Z (C1) t]");
  v1::Parameter p;
  p.name("EXX");
  p.value(1e-6);
  m.parameters({p, p, p});
  v1::AxisRange r;
  r.axis("X");
  r.max_m(0.5);
  m.validity({r});

  return m;
}

template <class T>
std::vector<std::byte> encoded(const T& value) {
  std::vector<std::byte> payload;
  EXPECT_TRUE(encode(value, payload).has_value());
  return payload;
}

TEST(Cdr, PayloadBeginsWithLittleEndianCdrHeader) {
  const auto payload = encoded(some_snapshot());
  const std::vector<std::byte> header(payload.begin(), payload.begin() + 4);
  EXPECT_EQ(header, (std::vector{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}}));
}

TEST(Cdr, FirstMemberIsLaidOutAsXcdr1String) {
  const auto payload = encoded(some_snapshot());
  EXPECT_EQ(payload[4], std::byte{6});  // length of "vmc-3" with its NUL, little endian
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(payload.data()) + 8, 6),
            std::string("vmc-3\0", 6));
}

TEST(Cdr, SnapshotSurvivesTheRoundTripFieldByField) {
  const auto s = some_snapshot();
  const auto back = decode<v1::Snapshot>(encoded(s));
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(*back, s);
}

TEST(Cdr, ModelSurvivesTheRoundTripFieldByField) {
  const auto m = some_model();
  const auto back = decode<v1::ErrorModel>(encoded(m));
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(*back, m);
}

TEST(Cdr, EncodeRefusesTextBeyondItsBound) {
  auto s = some_snapshot();
  s.machine(std::string(65, 'm'));
  std::vector<std::byte> payload;
  const auto result = encode(s, payload);
  ASSERT_FALSE(result.has_value());
  EXPECT_THAT(result.error().text, HasSubstr("machine: 65 bytes, bound 64"));
  EXPECT_TRUE(payload.empty());
}

TEST(Cdr, EncodeRefusesSequenceBeyondItsBound) {
  auto s = some_snapshot();
  s.velocity(std::vector<double>(9));
  std::vector<std::byte> payload;
  EXPECT_FALSE(encode(s, payload).has_value());
}

TEST(Cdr, EncodeTakesSequenceAtItsBound) {
  v1::ErrorGrid grid;
  grid.nodes(std::vector<v1::GridNode>(456));
  EXPECT_LE(encoded(grid).size(), 48'000u);
}

TEST(Cdr, EncodeRefusesBoundsBrokenInsideASequence) {
  auto m = some_model();
  m.parameters()[2].name(std::string(17, 'E'));
  std::vector<std::byte> payload;
  EXPECT_FALSE(encode(m, payload).has_value());
}

TEST(Cdr, EncodeRefusesTextWithNulInside) {
  auto s = some_snapshot();
  s.machine(std::string("a\0b", 3));
  std::vector<std::byte> payload;
  EXPECT_FALSE(encode(s, payload).has_value());
}

TEST(Cdr, DecodeRefusesAnEnumeratorThatDoesNotExist) {
  v1::ModelState state;
  state.machine("m");
  auto payload = encoded(state);
  // header 4, machine 4 + 2 (padded to 8), sequence number 8, host time 8, then the enumeration.
  payload.at(4 + 8 + 8 + 8) = std::byte{17};
  EXPECT_FALSE(decode<v1::ModelState>(payload).has_value());
}

TEST(Cdr, DecodeRefusesWhatEncodeWouldRefuse) {
  auto payload = encoded(some_snapshot());
  payload.at(4) = std::byte{200};  // a longer machine name, reaching into what follows
  EXPECT_FALSE(decode<v1::Snapshot>(payload).has_value());
}

TEST(Cdr, DecodeRefusesEveryTruncation) {
  const auto payload = encoded(some_model());
  for (std::size_t n = 0; n < payload.size(); ++n) {
    EXPECT_FALSE(decode<v1::ErrorModel>(std::span(payload).first(n)).has_value()) << n << " bytes";
  }
}

TEST(Cdr, DecodeTakesPaddingToAMultipleOfFourButNoMore) {
  auto payload = encoded(some_snapshot());
  payload.resize(payload.size() + 3);
  EXPECT_TRUE(decode<v1::Snapshot>(payload).has_value());
  payload.resize(payload.size() + 1);
  EXPECT_FALSE(decode<v1::Snapshot>(payload).has_value());
}

TEST(Cdr, DecodeOfDamagedBytesNeverCrashes) {
  std::mt19937 random(4711);
  const auto good = encoded(some_model());
  std::size_t refused = 0;

  for (int i = 0; i < 5000; ++i) {
    auto bad = good;
    for (int k = 0; k < 4; ++k)
      bad[4 + random() % (bad.size() - 4)] = static_cast<std::byte>(random());
    const auto value = decode<v1::ErrorModel>(bad);
    if (!value) {
      ++refused;
      EXPECT_FALSE(value.error().text.empty());
    }
  }

  EXPECT_GT(refused, 0u);
}

TEST(Cdr, NamesAreThoseOfDdsAndMcap) {
  EXPECT_EQ(type_name<v1::ErrorGrid>(), "abbe::v1::ErrorGrid");
  EXPECT_EQ(topic_name<v1::ErrorGrid>(), "abbe/v1/ErrorGrid");
}

/// Bounded members of one struct as in the IDL text.
std::map<std::string, std::size_t> bounds_in_idl(const std::string& type) {
  std::string text(idl_text());
  const auto begin = text.find("struct " + type + " {");
  EXPECT_NE(begin, std::string::npos) << type;
  text = text.substr(begin, text.find("};", begin) - begin);
  std::map<std::string, std::size_t> bounds;
  std::istringstream lines(text);

  for (std::string line; std::getline(lines, line);) {
    // Lines such as
    //   @key string<64> machine;
    //   sequence<double, 8> position;  // m or rad
    const auto close = line.find("> "), open = line.find_last_of("<,", close), end = line.find(';');
    if (close == std::string::npos || end == std::string::npos || close > end) continue;
    bounds[line.substr(close + 2, end - close - 2)] = std::stoul(line.substr(open + 1));
  }

  return bounds;
}

template <class T>
void expect_bounds_of_idl(const std::string& type) {
  std::map<std::string, std::size_t> checked;
  for (const MemberBound& b : member_bounds<T>()) checked[std::string(b.member)] = b.bound;
  EXPECT_EQ(checked, bounds_in_idl(type)) << type;
  EXPECT_FALSE(checked.empty());
}

TEST(AddToAge, ChangesTheAgeAndNothingElseWhateverTheLengthsOfTheTexts) {
  for (std::size_t length = 0; length < 64; ++length) {
    v1::Compensation vector;
    vector.machine(std::string(length, 'm'));
    vector.model_id(std::string(length * 7 % 64, 'i'));
    vector.cov_m2()[5] = 1e-12;
    vector.age_ns(5'000'000'001);
    vector.validity_ns(500'000'000);
    std::vector<std::byte> payload, expected;
    ASSERT_TRUE(encode(vector, payload));
    ASSERT_TRUE(add_to_age(payload, 7ms));
    vector.age_ns(5'007'000'001);
    ASSERT_TRUE(encode(vector, expected));
    EXPECT_EQ(payload, expected) << length;
  }
}

TEST(AddToAge, RefusesBytesThatAreNoCompensation) {
  std::vector<std::byte> payload;
  ASSERT_TRUE(encode(v1::Compensation{}, payload));
  auto longer = payload;
  longer.push_back(std::byte{});
  EXPECT_FALSE(add_to_age(longer, 7ms));
  for (; !payload.empty(); payload.pop_back())
    EXPECT_FALSE(add_to_age(std::span(payload).first(payload.size() - 1), 7ms)) << payload.size();
}

TEST(Cdr, BoundsCheckedAreThoseOfTheIdl) {
  expect_bounds_of_idl<v1::TrackerPoint>("TrackerPoint");
  expect_bounds_of_idl<v1::AxisSample>("AxisSample");
  expect_bounds_of_idl<v1::ProbeTrigger>("ProbeTrigger");
  expect_bounds_of_idl<v1::TouchScan>("TouchScan");
  expect_bounds_of_idl<v1::EnvironmentSample>("EnvironmentSample");
  expect_bounds_of_idl<v1::RawBytes>("RawBytes");
  expect_bounds_of_idl<v1::CalibrationEvent>("CalibrationEvent");
  expect_bounds_of_idl<v1::Snapshot>("Snapshot");
  expect_bounds_of_idl<v1::Compensation>("Compensation");
  expect_bounds_of_idl<v1::Parameter>("Parameter");
  expect_bounds_of_idl<v1::AxisRange>("AxisRange");
  expect_bounds_of_idl<v1::ErrorModel>("ErrorModel");
  expect_bounds_of_idl<v1::ErrorGrid>("ErrorGrid");
  expect_bounds_of_idl<v1::ModelState>("ModelState");
  expect_bounds_of_idl<v1::Health>("Health");
  expect_bounds_of_idl<v1::Identity>("Identity");
}

TEST(Cdr, IdlTextCarriesNoPathOfTheBuildMachine) {
  EXPECT_THAT(std::string(idl_text()), HasSubstr("struct Snapshot {"));
  EXPECT_EQ(idl_text().find("/home"), std::string_view::npos);
  EXPECT_EQ(idl_text().find("#line"), std::string_view::npos);
}

}  // namespace
}  // namespace abbe::daemon
