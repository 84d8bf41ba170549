/// Directly measured error motions of a simulated machine against a model that was identified from
/// a tracker run on the same machine.

#include "abbe/calib/direct/compare.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "direct_measurement.hpp"
#include "joint_parts.hpp"

namespace abbe::calib::direct {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using tests::direct::all_measured;
using tests::direct::DirectDevice;
using tests::direct::measured_table;

class DirectComparison : public ::testing::Test {
 protected:
  static const tests::otf::MadeRun& machine() {
    static const auto run = tests::otf::make_run({.in_datum = true});
    return run;
  }
  static const VolumetricModel& model() {
    static const VolumetricModel found = tests::joint::model_of(machine());
    return found;
  }
  static TableComparison compared(const MeasuredError& error, const CompareOptions& options = {}) {
    return compare(std::vector{error}, model(), options).value().front();
  }
};

TEST_F(DirectComparison, AgreesForTheSameMachine) {
  int contradictions = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const auto tables = compare(all_measured(machine(), {.seed = seed}), model()).value();
    for (const TableComparison& t : tables) {
      contradictions += t.finding == Finding::Contradicts ? 1 : 0;
      EXPECT_LT(t.largest, 5e-6) << t.name;
    }
  }
  // Expected at most 40 * 0.05 = 2; more than 6 has a probability of 0.005.
  EXPECT_LE(contradictions, 6);
}

TEST_F(DirectComparison, StatesTheUncertaintyThatTheDifferencesHave) {
  double squares = 0.0, count = 0.0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    DirectDevice device{.seed = seed, .runs = 10, .noise = 3e-6};
    const auto tables = compare(all_measured(machine(), device), model()).value();
    for (const TableComparison& t : tables) {
      squares += t.rms_normalised * t.rms_normalised;
      count += 1.0;
    }
  }
  // E[1 / max(1, w)] = 0.88, 9 w: chi-square with 9 degrees of freedom; the scatter dominates.
  EXPECT_NEAR(squares / count, 0.88, 0.15);
}

TEST_F(DirectComparison, FindsAChangeOfOneTable) {
  auto errors = all_measured(machine());
  for (Reading& r : errors[1].readings) {  // EYX: a bow of 6 um
    r.value += 6e-6 * (1.0 - r.position_m * r.position_m / 0.09);
  }
  const auto tables = compare(errors, model()).value();
  for (const TableComparison& t : tables) {
    EXPECT_EQ(t.finding == Finding::Contradicts, t.name == "EYX") << t.name;
  }
}

TEST_F(DirectComparison, DoesNotTestOneRunWithoutUncertaintyOfTheDevice) {
  const auto one = measured_table(machine(), "EXX", {.runs = 1});
  const TableComparison t = compared(one);
  EXPECT_EQ(t.finding, Finding::NotTested);
  EXPECT_THAT(t.reason, HasSubstr("state the uncertainty of the device"));
  EXPECT_GT(t.rms, 0.0);
  EXPECT_EQ(compared(one, {.device = {.u_m = 1e-6}}).finding, Finding::Agrees);
}

TEST_F(DirectComparison, AddsTheUncertaintyOfTheDevice) {
  const auto errors = measured_table(machine(), "EXX");
  const TableComparison plain = compared(errors);
  const TableComparison scaled = compared(errors, {.device = {.u_scale = 10e-6}});
  const PointDifference &a = plain.points.front(), &b = scaled.points.front();
  EXPECT_NEAR(b.u * b.u - a.u * a.u, std::pow(10e-6 * 0.3, 2), 1e-16) << "0.3 m from the zero";
}

TEST_F(DirectComparison, UsesTheZeroOfTheAxisOrTheFirstCommonPosition) {
  auto error = measured_table(machine(), "EXX");
  EXPECT_EQ(compared(error).convention, "zero at 0 mm");
  std::erase_if(error.readings, [](const Reading& r) { return r.position_m < 0.04; });
  const TableComparison t = compared(error);
  EXPECT_EQ(t.convention, "zero at 50 mm");
  EXPECT_EQ(t.points.front().difference, 0.0);
}

TEST_F(DirectComparison, RemovesTheLineThatWasAskedFor) {
  const auto error = measured_table(machine(), "EYX");
  const TableComparison ends = compared(error);
  EXPECT_THAT(ends.convention, StartsWith("line through -300 and 300 mm"));
  EXPECT_EQ(ends.points.front().difference, 0.0);
  EXPECT_NEAR(ends.points.back().difference, 0.0, 1e-15);
  const TableComparison fitted = compared(error, {.line = StraightnessLine::LeastSquares});
  double sum = 0.0, moment = 0.0;
  for (const PointDifference& point : fitted.points) {
    sum += point.measured;
    moment += point.measured * point.position_m;
  }
  EXPECT_NEAR(sum, 0.0, 1e-15);
  EXPECT_NEAR(moment, 0.0, 1e-15);
}

TEST_F(DirectComparison, ReportsBacklash) {
  const TableComparison t =
      compared(measured_table(machine(), "EXX", {.noise = 0.1e-6, .reversal = 4e-6}));
  ASSERT_TRUE(t.reversal);
  EXPECT_NEAR(t.reversal->mean, 4e-6, 5.0 * *t.reversal->u);
  EXPECT_LT(*t.reversal->u, 0.1e-6);
}

TEST_F(DirectComparison, ComparesOnlyTheCommonRange) {
  auto error = measured_table(machine(), "EXX");
  for (int run = 1; run <= 5; ++run) {
    for (const bool forward : {true, false}) {
      error.readings.push_back({0.5, 1.0, run, forward});
    }
  }
  const TableComparison t = compared(error);
  EXPECT_EQ(t.outside, 1u);
  EXPECT_EQ(t.finding, Finding::Agrees);
}

/// Ends of the axes.
Vector3 end_m(const tests::otf::MadeRun& run, bool last) {
  Vector3 end;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto& nodes_m = run.machine.nodes[a].nodes_m;
    end(static_cast<Eigen::Index>(a)) = last ? nodes_m.back() : nodes_m.front();
  }
  return end;
}

/// Rotations times levers make each of them differ from place to place.
TEST_F(DirectComparison, ComparesSquarenessWhereItWasMeasured) {
  const Vector3 first = end_m(machine(), false), last = end_m(machine(), true);
  for (const std::string name : {"EA0Z", "EB0Z", "EC0Y"}) {
    for (const double part : {0.1, 0.8}) {
      auto error = tests::direct::measured_squareness(machine(), name,
                                                      first + part * (last - first), first, last);
      EXPECT_LT(compared(error).largest, 2e-6) << name << " " << part;
      error.line_m = std::nullopt;
      EXPECT_EQ(compared(error).finding, Finding::NotCompared);
      EXPECT_THAT(compared(error).reason, HasSubstr("is not stated (x_mm, y_mm, z_mm)"));
    }
  }
}

TEST_F(DirectComparison, NamesTheReversedSignOfASquareness) {
  const Vector3 first = end_m(machine(), false), last = end_m(machine(), true);
  auto error =
      tests::direct::measured_squareness(machine(), "EC0Y", 0.5 * (first + last), first, last);
  for (Reading& r : error.readings) {
    r.value = -r.value;
  }
  const TableComparison reversed = compared(error, {.device = {.u_rad = 1e-6}});
  EXPECT_THAT(reversed.causes, Contains(HasSubstr("sign")));
}

/// A bow makes the line over half of the range another one than that over all.
TEST_F(DirectComparison, RefersSquarenessToTheCommonLines) {
  const Vector3 first = end_m(machine(), false);
  Vector3 at = 0.5 * first, last = end_m(machine(), true);
  auto straightness =
      measured_table(machine(), "EYX", {.runs = 1, .noise = 0.0, .offset = 0.0, .slope = 0.0});
  std::erase_if(straightness.readings, [](const Reading& r) { return r.position_m > 0.01; });
  const double of_all =
      tests::direct::slope_on_line(machine(), {Motion::Y, Axis::X}, at, first.x(), last.x());
  last.x() = 0.0;
  const double of_half =
      tests::direct::slope_on_line(machine(), {Motion::Y, Axis::X}, at, first.x(), last.x());
  const auto squareness = tests::direct::measured_squareness(machine(), "EC0Y", at, first, last);
  const auto tables = compare(std::vector{squareness, straightness}, model()).value();
  EXPECT_LT(tables[0].largest, 2e-6);
  EXPECT_GT(std::abs(of_half - of_all), 20e-6) << "the test shows nothing";
}

TEST_F(DirectComparison, RefusesWhatItCannotCompare) {
  const auto error = measured_table(machine(), "EXX");
  EXPECT_EQ(compare(std::vector{error, error}, model()).error().code, ErrorCode::BadInput);
  EXPECT_FALSE(compare(std::vector{MeasuredError{.name = "EXW", .readings = {}}}, model()));
  EXPECT_FALSE(compare(std::vector{error}, model(), {.false_alarm = 0.0}));
  EXPECT_FALSE(compare(std::vector{error}, model(), {.device = {.u_m = -1.0}}));
}

TEST_F(DirectComparison, SaysWhyATableIsNotCompared) {
  MeasuredError roll = measured_table(machine(), "EXX");
  roll.name = "ECZ";
  EXPECT_THAT(compared(roll).reason, HasSubstr("does not have this table"));
  auto far = measured_table(machine(), "EXX");
  for (Reading& r : far.readings) {
    r.position_m += 2.0;
  }
  EXPECT_THAT(compared(far).reason,
              HasSubstr("from 1700 to 2300 mm, the model covers -300 to 300"));
  EXPECT_EQ(compared(far).finding, Finding::NotCompared);
}

}  // namespace
}  // namespace abbe::calib::direct
