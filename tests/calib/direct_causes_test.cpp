/// Mistakes in files of directly measured errors are named.

#include <gmock/gmock.h>

#include <cmath>

#include "abbe/calib/direct/compare.hpp"
#include "direct_measurement.hpp"
#include "joint_parts.hpp"

namespace abbe::calib::direct {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using tests::direct::measured_table;

class DirectCauses : public ::testing::Test {
 protected:
  template <class Change>
  TableComparison with(const std::string& name, Change change) const {
    MeasuredError error = measured_table(run_, name);
    for (Reading& r : error.readings) {
      change(r);
    }
    return compare(std::vector{error}, model_).value().front();
  }

  /// Identified once: it takes seconds.
  static const tests::otf::MadeRun& machine() {
    static const auto run = tests::otf::make_run({.in_datum = true});
    return run;
  }
  static const VolumetricModel& identified() {
    static const VolumetricModel model = tests::joint::model_of(machine());
    return model;
  }

  const tests::otf::MadeRun& run_ = machine();
  const VolumetricModel& model_ = identified();
};

TEST_F(DirectCauses, NamesAReversedSign) {
  for (const char* name : {"EXX", "EYX", "ECX", "EZY"}) {
    const auto t = with(name, [](Reading& r) { r.value = -r.value; });
    EXPECT_EQ(t.finding, Finding::Contradicts) << name;
    EXPECT_THAT(t.causes, Contains(HasSubstr("with the sign of the values reversed"))) << name;
  }
}

/// The sign explains most of the difference, not all: a bow of 6 um is left.
TEST_F(DirectCauses, CallsCloserWhatStillContradicts) {
  const auto bow = [](double p) { return 6e-6 * std::sin(20.0 * p); };
  const auto t = with("EXX", [&](Reading& r) { r.value = bow(r.position_m) - r.value; });
  EXPECT_THAT(t.causes, ::testing::Contains(
                            ::testing::StartsWith("closer with the sign of the values reversed")));
  const auto plain = with("EXX", [](Reading& r) { r.value = -r.value; });
  EXPECT_THAT(
      plain.causes,
      ::testing::Contains(::testing::StartsWith("fits with the sign of the values reversed")));
}

TEST_F(DirectCauses, NamesReversedPositions) {
  const auto t = with("EXX", [](Reading& r) { r.position_m = -r.position_m; });
  EXPECT_THAT(t.causes, ElementsAre(HasSubstr("with the sign of the positions reversed: ")));
}

TEST_F(DirectCauses, NamesPositionsFromTheOtherEnd) {
  const auto t = with("EZZ", [](Reading& r) { r.position_m = -0.4 - r.position_m; });
  EXPECT_THAT(t.causes, ::testing::Contains(HasSubstr("counted from the other end: ")));
}

/// Two nodes are left in the common range, so that an offset with a slope would fit any values.
TEST_F(DirectCauses, DoNotNameAnOffsetOfThePositionsThatFewNodesCannotShow) {
  const auto t = with("EXX", [](Reading& r) { r.position_m += 0.05; });
  EXPECT_EQ(t.finding, Finding::Contradicts);
  EXPECT_THAT(t.causes, ::testing::Not(::testing::Contains(HasSubstr("mm added to the"))));
}

TEST_F(DirectCauses, NamesAWrongUnit) {
  const auto t = with("EXX", [](Reading& r) { r.value *= 1e-3; });
  EXPECT_THAT(t.causes, ElementsAre(MatchesRegex(".*with the values divided by 0.00(0[89]|10).*")));
}

TEST_F(DirectCauses, NamesAScaleOfLengths) {
  const auto t = with("EXX", [](Reading& r) { r.value += 150e-6 * r.position_m; });
  EXPECT_THAT(t.causes, ElementsAre(MatchesRegex(".*after removal of 1(49|50|51)[.0-9]* um/m.*")));
}

/// A line 0.2 m beside the axis: EXX + EBX 0.2 m.
TEST_F(DirectCauses, NamesALeverOfTheMeasuredLine) {
  const auto t = with("EXX", [&](Reading& r) {
    r.value += 0.4 * tests::direct::table_value(run_, {Motion::B, Axis::X}, r.position_m);
  });
  EXPECT_THAT(t.causes, ElementsAre(HasSubstr("rotations times levers")));
}

TEST_F(DirectCauses, NamesNothingForAnOffsetOfTheValues) {
  const auto t = with("EXX", [](Reading& r) { r.value += 1e-3; });
  EXPECT_EQ(t.finding, Finding::Agrees);
  EXPECT_THAT(t.causes, IsEmpty());
}

TEST_F(DirectCauses, NamesNothingForAnotherMachine) {
  const auto other = tests::otf::make_run({.seed = 9, .in_datum = true});
  const auto t = compare(std::vector{measured_table(other, "EXX")}, model_).value().front();
  EXPECT_EQ(t.finding, Finding::Contradicts);
  EXPECT_THAT(t.causes, IsEmpty());
}

/// Measured on a stated line: rotations times levers are part of the model's
/// value.
TEST_F(DirectCauses, AKnownLineNeedsNoCause) {
  const Vector3 line(0.0, 0.1, -0.3), t = run_.machine.target_offset_m;
  MeasuredError error = measured_table(run_, "EXX");
  error.line_m = line;
  for (Reading& r : error.readings) {
    const double EBX = tests::direct::table_value(run_, {Motion::B, Axis::X}, r.position_m);
    const double ECX = tests::direct::table_value(run_, {Motion::C, Axis::X}, r.position_m);
    r.value += EBX * (line.z() + t.z()) - ECX * (line.y() + t.y());
  }
  EXPECT_EQ(compare(std::vector{error}, model_).value().front().finding, Finding::Agrees);
  error.line_m = std::nullopt;
  EXPECT_EQ(compare(std::vector{error}, model_).value().front().finding, Finding::Contradicts);
}

}  // namespace
}  // namespace abbe::calib::direct
