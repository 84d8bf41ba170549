/// A machine with errors probes a bar: readings by exact kinematics, and what every option does.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <fstream>
#include <nlohmann/json.hpp>

#include "abbe/sim/mfb/files.hpp"
#include "abbe/sim/mfb/reversal.hpp"
#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/touching.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;
using nlohmann::json;

/// The machine of a state of the reference, with all errors multiplied by `factor`. The reference
/// turns the tool with its squareness, too; the tables of the rotations contain this here.
TruthMachine machine_of(const json& state, double factor) {
  const json& E = state.at("E");
  const auto error = [&](const std::string& name) { return factor * E.at(name).get<double>(); };
  TruthMachine machine;
  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const std::string name = motion_name(m, axis);
      double value = error(name) * (m < 3 ? 1e-3 : 1.0);
      if (name == "ECY") value += error("EC0Y");
      if (name == "EAZ") value += error("EA0Z");
      if (name == "EBZ") value += error("EB0Z");
      machine.axis(axis).error[m] = ErrorFunction::polynomial({value});
    }
  }
  machine.squareness = {error("EA0Z"), error("EB0Z"), error("EC0Y")};
  return machine;
}

Vector3d mm_in(const json& v) {
  return 1e-3 * Vector3d(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>());
}

json htm_states() {
  std::ifstream in(std::string(ABBE_TEST_DATA) + "/mfb/htm_reference.json");
  return json::parse(in).at("rows");
}

TEST(MfbKinematics, AgreeWithEquation8) {
  constexpr double kSmallAngles_m = 1e-8;  // Eq. 8 has small-angle matrices: (1e-4 rad)^2 0.5 m
  const json states = htm_states();
  EXPECT_EQ(states.size(), 40u);
  for (const json& state : states) {
    TruthMachine machine = machine_of(state, 1.0);
    machine.target_offset_m = -mm_in(state.at("J"));
    const Vector3d tip_m = position_m(machine, mm_in(state.at("reading")));
    EXPECT_LT((tip_m - mm_in(state.at("tip_eq8"))).norm(), kSmallAngles_m);
  }
}

TEST(MfbKinematics, AgreeWithEquations10To12ToFirstOrder) {
  // 1000 times smaller errors leave the first order alone; V is then known to 1e-13 m.
  constexpr double kSmaller = 1e-3, kSecondOrder_m = 1e-11;
  for (const json& state : htm_states()) {
    TruthMachine machine = machine_of(state, kSmaller);
    machine.target_offset_m = -mm_in(state.at("J"));
    const Vector3d V_m = error_m(machine, mm_in(state.at("reading"))) / kSmaller;
    EXPECT_LT((V_m + mm_in(state.at("delta_eq10_12"))).norm(), kSecondOrder_m);
  }
}

TruthMachine bar_machine(std::uint64_t seed = 1) {
  TruthMachine machine;
  for (const Axis axis : kAxes) machine.axis(axis).range = {0.0, 0.55, 0.0};
  return random_truth(machine, {.seed = seed,
                                .mean_error_m = 40e-6,
                                .node_spacing_m = 0.005,
                                .beyond_m = 0.025,
                                .shape = Shape::Cubic});
}

TEST(MfbMachine, IsInTheDatumOfTheMethod) {
  const TruthMachine machine = bar_machine(3);
  EXPECT_NEAR(mean_error_m(machine), 40e-6, 0.1e-6);
  for (const Axis axis : kAxes) {
    for (std::size_t m = 0; m < kMotions; ++m) {
      const ErrorFunction& f = machine.axis(axis).error[m];
      const bool straightness = m < 3 && m != static_cast<std::size_t>(axis);
      EXPECT_NEAR(f.at(0.0), 0.0, 1e-18);
      EXPECT_LT(f.nodes_m().front(), -0.02);
      if (straightness) {
        EXPECT_NEAR(f.at(0.55), 0.0, 1e-18);
      } else {
        EXPECT_GT(std::abs(f.at(0.55)), 1e-9);
      }
    }
  }
}

/// Nothing random, no pre-travel.
ProbingOptions plain() {
  ProbingOptions options;
  options.probe = {.noise_m = 0.0, .lobing_m = 0.0, .delay_s = 0.0, .feed_scatter = 0.0};
  options.machine_noise_m = options.clamping_m = options.clamping_rad = 0.0;
  return options;
}

std::vector<Measurement> two_passes() {
  auto plan = reference_plan(PlanKind::Full, Passes::Pairs, 0.55);
  plan.resize(2);  // X1 and its way back
  return plan;
}

const TrueBar kBar = random_bar(reference_pattern(), {.seed = 2});

ProbedBar probed(const ProbingOptions& options, std::vector<Measurement> plan = two_passes()) {
  const auto found = probe_bar(bar_machine(), kBar, plan, options);
  EXPECT_TRUE(found) << found.error().text;
  return found.value_or(ProbedBar{});
}

/// Differences of the readings of two runs with the same touches.
std::vector<Vector3d> differences_m(const ProbedBar& a, const ProbedBar& b) {
  std::vector<Vector3d> all;
  EXPECT_EQ(a.touches.size(), b.touches.size());
  for (std::size_t i = 0; i < std::min(a.touches.size(), b.touches.size()); ++i)
    all.emplace_back(a.touches[i].reading_m - b.touches[i].reading_m);
  return all;
}

TEST(MfbProbing, SolvesTheReadings) {
  TruthMachine machine = bar_machine();
  const auto plan = reference_plan(PlanKind::Full, Passes::ForwardAlone, 0.55);
  const ProbedBar run = probed(plain(), plan);
  EXPECT_EQ(run.touches.size(), 17u * 316u);
  const auto all = targets(kBar.pattern);
  for (std::size_t i = 0; i < run.touches.size(); ++i) {
    const Touch& t = run.touches[i];
    const Measurement& m = plan[t.measurement];
    const Contact touched = contact(kBar, t.target, i % all.size(), 1.5e-3);
    Eigen::Matrix3d axes;
    axes << m.bar_x, m.bar_z.cross(m.bar_x), m.bar_z;
    machine.target_offset_m = m.tool_offset_m;
    const Vector3d tip_m = position_m(machine, t.reading_m);
    ASSERT_LT((tip_m - (m.origin_m + axes * touched.centre_m)).norm(), 1e-12)
        << m.name << "," << name(t.target);
  }
}

TEST(MfbProbing, IsReproducible) {
  const auto plan = two_passes();
  const auto text = [&](std::uint64_t seed) {
    ProbingOptions options;
    options.seed = seed;
    options.drift_m = 1e-6;
    options.temperature = {.spread_K = 0.3, .u_K = 0.1, .alpha_per_K = 1e-6};
    const ProbedBar run = probed(options);
    return format_points_csv(plan, run) + format_plan_toml(plan, run, options);
  };
  EXPECT_EQ(text(7), text(7));
  EXPECT_NE(text(7), text(8));
}

TEST(MfbProbing, DriftIsLinearThroughAPassAndItsWayBack) {
  // The reading follows the tip but for the slope of V, 5e-4, times up to 7 um.
  constexpr double kDrift_m = 2e-6, kSlopeOfV_m = 3.5e-9;
  ProbingOptions drifting = plain();
  drifting.drift_m = kDrift_m;
  const auto moved_m = differences_m(probed(drifting), probed(plain()));
  const std::size_t touches = moved_m.size() / 2;
  const Vector3d at_end_m = moved_m[touches - 1];
  for (Eigen::Index k = 0; k < 3; ++k) EXPECT_NEAR(std::abs(at_end_m(k)), kDrift_m, kSlopeOfV_m);
  for (std::size_t i = 0; i < touches; ++i) {
    const double time = static_cast<double>(i) / static_cast<double>(touches - 1);
    EXPECT_LT((moved_m[i] - time * at_end_m).norm(), kSlopeOfV_m);
    EXPECT_LT((moved_m[touches + i] - (1.0 + time) * at_end_m).norm(), kSlopeOfV_m);
  }
}

TEST(MfbProbing, BackwardPassesBeginAtTheLastHole) {
  const ProbedBar run = probed(plain());
  const std::size_t touches = run.touches.size() / 2;
  for (std::size_t i = 0; i < touches; ++i) {
    const Touch &there = run.touches[i], &back = run.touches[2 * touches - 1 - i];
    EXPECT_EQ(there.target.feature, back.target.feature);
    EXPECT_EQ(there.reading_m, back.reading_m);
  }
}

TEST(MfbProbing, OutlierIsOneTouchAlongItsNormal) {
  ProbingOptions wrong = plain();
  wrong.wrong_m["X1,hole,3,,2"] = 50e-6;
  const auto moved_m = differences_m(probed(wrong), probed(plain()));
  const auto all = targets(kBar.pattern);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < moved_m.size(); ++i) {
    if (moved_m[i].norm() < 1e-12) continue;
    ++moved;
    EXPECT_EQ(name(all.at(i)), "hole,3,,2");
    EXPECT_NEAR(moved_m[i].dot(all.at(i).normal), 50e-6, 0.1e-6);
  }
  EXPECT_EQ(moved, 1u);
}

TEST(MfbProbing, MissedTouchesAreLeftOut) {
  ProbingOptions missing = plain();
  missing.missed = {"X1,rod,2,,5", "X1 back,plane,4,R,3"};
  const ProbedBar run = probed(missing);
  EXPECT_EQ(run.touches.size(), 2u * 316u - 2u);
  for (const Touch& t : run.touches)
    EXPECT_FALSE(missing.missed.contains(two_passes()[t.measurement].name + "," + name(t.target)));
}

/// Centre of the least-squares circle through the touches of a hole in the first measurement:
///   x^2 + y^2 = 2 c . (x, y) + d
Eigen::Vector2d centre_of_hole_m(const ProbedBar& run, std::size_t hole) {
  Eigen::Matrix<double, 8, 3> A;
  Eigen::Matrix<double, 8, 1> b;
  Eigen::Index row = 0;
  for (const Touch& t : run.touches) {
    if (t.measurement != 0 || t.target.feature != Feature{Kind::Hole, hole, Side::Left}) continue;
    const Eigen::Vector2d p_m = t.reading_m.head<2>();
    A.row(row) << 2.0 * p_m.x(), 2.0 * p_m.y(), 1.0;
    b(row++) = p_m.squaredNorm();
  }
  const Eigen::Vector3d solution = A.colPivHouseholderQr().solve(b);
  return solution.head<2>();
}

/// y of the hole relative to the first one: the signature as it shows in machine axes.
double shift_of_hole_m(const ProbedBar& run, std::size_t hole) {
  return centre_of_hole_m(run, hole).y() - centre_of_hole_m(run, 0).y();
}

TEST(MfbProbing, TurnedBarShowsItsSignatureTurned) {
  constexpr double kShift_m = 1e-3, kErrors_m = 0.2e-3;  // of bar and machine, squareness included
  const auto shift = [](std::optional<Turned> turned, std::size_t hole) {
    ProbingOptions options = plain();
    if (turned) options.turned["P1"] = *turned;
    return shift_of_hole_m(probed(options), hole);
  };
  EXPECT_NEAR(shift(std::nullopt, 2), kShift_m, kErrors_m);
  EXPECT_NEAR(shift(Turned::AboutX, 2), -kShift_m, kErrors_m);
  EXPECT_NEAR(shift(Turned::AboutY, 2), 0.0, kErrors_m);
  EXPECT_NEAR(shift(Turned::AboutY, 9), kShift_m, kErrors_m);
  EXPECT_NEAR(shift(Turned::AboutZ, 9), -kShift_m, kErrors_m);
}

TEST(MfbProbing, GrowsWithTheTemperature) {
  ProbingOptions warm = plain();
  warm.temperature = {.stated_C = 30.0, .alpha_per_K = 1e-6};
  const auto moved_m = differences_m(probed(warm), probed(plain()));
  EXPECT_NEAR(moved_m[0].x(), 0.0, 0.1e-6);              // hole 1: at its radius
  EXPECT_NEAR(moved_m[315].x(), 10e-6 * 0.55, 0.15e-6);  // hole N
}

TEST(MfbProbing, SagsAlongGravity) {
  ProbingOptions loaded = plain();
  loaded.sag = reference_sag(kBar.pattern);
  const auto moved_m = differences_m(probed(loaded), probed(plain()));
  double middle_m = 0.0;
  const auto all = targets(kBar.pattern);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].feature == Feature{Kind::Rod, 5, Side::Left}) middle_m += moved_m[i].z() / 12.0;
  }
  EXPECT_NEAR(middle_m, -0.155e-6, 0.01e-6);
  loaded.gravity = Vector3d::UnitX();  // along the bar
  for (const Vector3d& d : differences_m(probed(loaded), probed(plain())))
    EXPECT_LT(d.norm(), 1e-12);
}

TEST(MfbProbing, ClampingMovesAPositionAsAWhole) {
  ProbingOptions scattered = plain();
  scattered.clamping_m = 0.1e-3;
  const auto moved_m = differences_m(probed(scattered), probed(plain()));
  EXPECT_GT(moved_m[0].norm(), 10e-6);
  for (const Vector3d& d : moved_m) EXPECT_LT((d - moved_m[0]).norm(), 0.2e-6);  // slope of V
}

TEST(MfbProbing, PretravelIsAlongTheApproach) {
  ProbingOptions late = plain();
  late.probe.delay_s = 1e-3;  // 4 um at 4 mm/s
  const auto moved_m = differences_m(probed(late), probed(plain()));
  const auto all = targets(kBar.pattern);
  for (std::size_t i = 0; i < all.size(); ++i)
    EXPECT_LT((moved_m[i] + 4e-6 * all[i].normal).norm(), 0.01e-6);

  late.probe.delay_s = 0.0;
  late.probe.lobing_m = 1e-6;
  const auto lobed_m = differences_m(probed(late), probed(plain()));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Vector3d approach = -all[i].normal;
    const double phi_rad = std::atan2(approach.y(), approach.x());
    const double across = std::hypot(approach.x(), approach.y());
    EXPECT_NEAR(lobed_m[i].dot(approach), 1e-6 * std::cos(3.0 * phi_rad) * across, 0.01e-6);
  }
}

TEST(MfbProbing, NoiseHasTheStatedSize) {
  ProbingOptions noisy = plain();
  noisy.probe.noise_m = 0.125e-6;
  noisy.machine_noise_m = 0.25e-6;
  const auto moved_m = differences_m(probed(noisy), probed(plain()));
  const auto all = targets(kBar.pattern);
  double along = 0.0, every = 0.0;
  for (std::size_t i = 0; i < moved_m.size(); ++i) {
    const Vector3d n = all[i < all.size() ? i : 2 * all.size() - 1 - i].normal;
    along += moved_m[i].dot(n) * moved_m[i].dot(n);
    every += moved_m[i].squaredNorm();
  }
  const auto count = static_cast<double>(moved_m.size());
  EXPECT_NEAR(std::sqrt(along / count), std::hypot(0.125e-6, 0.25e-6), 0.03e-6);
  EXPECT_NEAR(std::sqrt((every - along) / count), 0.25e-6 * std::sqrt(2.0), 0.03e-6);
}

TEST(MfbProbing, NamesThatAreNotInThePlanAreRefused) {
  ProbingOptions options;
  options.missed = {"X1,hole,13,,2"};
  auto refused = probe_bar(bar_machine(), kBar, two_passes(), options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text.find("X1,hole,13,,2"), std::string::npos);

  options = {};
  options.turned["X7"] = Turned::AboutX;
  refused = probe_bar(bar_machine(), kBar, two_passes(), options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text.find("X7"), std::string::npos);

  options = {};
  options.probe.tip_radius_m = 8e-3;
  EXPECT_FALSE(probe_bar(bar_machine(), kBar, two_passes(), options));
}

TEST(MfbReversal, SignatureChangesItsSideAndTheGaugeShowsTheMachine) {
  ReversalOptions options;
  options.repeats = 2;
  options.probing = plain();
  options.gauge.u_m = options.gauge.u_per_m = 0.0;
  options.gauge.u_temperature_K = options.gauge.alignment_rad = 0.0;
  const TruthMachine machine = measuring_machine(2e-6, 0.55, 1);
  const auto run = run_reversal(machine, kBar, options);
  ASSERT_TRUE(run) << run.error().text;
  ASSERT_EQ(run->plan.size(), 4u);
  EXPECT_EQ(run->plan[1].name, "R1");
  EXPECT_EQ(run->plan[1].bar_z, -run->plan[0].bar_z);
  EXPECT_NEAR(shift_of_hole_m(run->probed, 2), 1e-3, 0.1e-3);

  TruthMachine with_tool = machine;
  with_tool.target_offset_m = Vector3d(0, 0, -0.15);
  const Vector3d first_q_m = reading_at_m(with_tool, run->gauge_origin_m);
  const double E_first_m = error_m(with_tool, first_q_m).x();
  for (std::size_t i = 0; i < run->distances_m.size(); ++i) {
    const Vector3d face_m = run->gauge_origin_m + run->distances_m[i] * Vector3d::UnitX();
    const double E_m = error_m(with_tool, reading_at_m(with_tool, face_m)).x();
    const double measured_m =
        run->distances_m[i] - (run->readings_m[i][0] - run->readings_m[0][0]).x();
    EXPECT_NEAR(measured_m, E_m - E_first_m, 1e-12);
  }
}

}  // namespace
}  // namespace abbe::sim::mfb
