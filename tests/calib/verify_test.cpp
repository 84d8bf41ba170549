/// Verification with an independent instrument: the reference solutions of the ball array on their
/// own grid, and tracker points of a machine with known errors.

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <iostream>
#include <random>

#include "abbe/calib/verify/compare.hpp"
#include "abbe/calib/verify/expanded_uncertainty.hpp"
#include "evemu_study.hpp"

namespace abbe::calib::verify {
namespace {

using tests::evemu::Field;

RigidTransform tracker_station() {
  return {Eigen::AngleAxisd(2.1, Vector3(0.1, -0.2, 1.0).normalized()).toRotationMatrix(),
          Vector3(2.5, -1.4, 0.6)};
}

/// The tracker's measurement: the true position, in the tracker's frame.
std::vector<MeasuredPoint> measured(const Field& V, const std::vector<Vector3>& readings,
                                    const RigidTransform& T_tracker_machine = tracker_station()) {
  std::vector<MeasuredPoint> points;
  for (const Vector3& q : readings) points.push_back({q, T_tracker_machine * (q + V(q))});
  return points;
}

std::vector<Vector3> box_of(const Vector3& low, const Vector3& high,
                            const std::array<int, 3>& count) {
  std::vector<Vector3> points;
  for (int i = 0; i < count[0]; ++i)
    for (int j = 0; j < count[1]; ++j)
      for (int k = 0; k < count[2]; ++k)
        points.emplace_back(low +
                            (high - low)
                                .cwiseProduct(Vector3(i / (count[0] - 1.0), j / (count[1] - 1.0),
                                                      k / (count[2] - 1.0))));
  return points;
}

std::vector<Vector3> measured_box() {
  return box_of({-0.1, -0.1, -0.04}, {0.8, 0.4, 0.12}, {10, 6, 9});
}

/// The grid of the reference and Ball1: no interpolation when it is evaluated on the same grid.
std::vector<Vector3> measured_grid() {
  auto readings = tests::evemu::reference_grid();
  readings.emplace_back(-0.09, 0.14, 0.03);
  return readings;
}

Options paper_grid() {
  return {.step_m = Vector3(0.1 / 3, 0.05 / 3, 0.01 / 3), .least_distance_m = 0.17};
}

/// Every second point along every axis, for tests that do not need the numbers of the reference.
Options thin_grid() {
  Options options = paper_grid();
  options.step_m *= 2.0;
  return options;
}

std::vector<Vector3> measured_thinly() {
  auto readings = measured_grid();
  const Vector3 step_m = thin_grid().step_m, ball1 = readings.back();
  std::erase_if(readings, [&](const Vector3& q) {
    const Vector3 steps = q.cwiseQuotient(step_m);
    return q != ball1 && (steps - steps.array().round().matrix()).norm() > 1e-6;
  });
  return readings;
}

/// A model from coefficients of the reference; valid inside the balls of the reference layout.
VolumetricModel reference_model(const std::string& solution) {
  std::vector<Vector3> balls;
  for (const auto& position : tests::evemu::reference_layout().true_m)
    balls.insert(balls.end(), position.begin(), position.end());
  const auto design =
      *ScaledDesign::of(tests::evemu::reference_machine().chain, 3, bounding_box(balls));
  const Eigen::VectorXd named = tests::evemu::reference_coefficients(solution);
  const Eigen::VectorXd c = (1000.0 * design.named_from_scaled()).fullPivLu().solve(named);
  const auto n = static_cast<Eigen::Index>(design.size());
  return *VolumetricModel::from_polynomials(
      *PolynomialModel::of(design, balls[0], c, Eigen::MatrixXd::Zero(n, n)), ModelDatum::Ball1,
      Vector3::Zero(), *ValidityVolume::hull_of(balls));
}

Field field_of(const VolumetricModel& model) {
  return [model](const Vector3& q) { return model.V_at(q, Vector3::Zero()); };
}

Comparison verified(const Field& truth, const VolumetricModel& model,
                    const std::vector<Vector3>& readings, Frame frame,
                    const Options& options = {}) {
  const RigidTransform T = frame == Frame::Machine ? RigidTransform{} : tracker_station();
  return *compare(*observe(measured(truth, readings, T), frame), model, Vector3::Zero(), options);
}

TEST(Verification, GivesTheStatisticsOfTheReferenceOnItsGrid) {
  const auto all = tests::evemu::reference_json("solutions.json");
  for (const std::string solution : {"ols", "ncvreg_maxit1e6"}) {
    const auto c = verified(tests::evemu::table3_machine(), reference_model(solution),
                            measured_grid(), Frame::Machine, paper_grid());
    const auto& R = all["solutions"][solution]["R_resmag"];
    EXPECT_EQ(c.R_stated.count, all["n_grid"].get<std::size_t>());
    // the reference does not subtract the estimate's own V at Ball1
    constexpr double kShiftOfConstants = 2e-3;
    EXPECT_NEAR(c.R_stated.mean, R["mean"].get<double>(), kShiftOfConstants) << solution;
    EXPECT_NEAR(c.R_stated.median, R["p50"].get<double>(), kShiftOfConstants) << solution;
    EXPECT_EQ(c.R_stated.above_1, 0u);
  }
}

TEST(Verification, OfThePerfectModelLeavesNothing) {
  const auto model = reference_model("true");
  const auto c = verified(field_of(model), model, measured_thinly(), Frame::BestFit, thin_grid());
  EXPECT_GT(c.before.rms_m, 100e-6);
  EXPECT_LT(c.after.max_m, 1e-9);
  EXPECT_LT(c.interpolation_rms_m, 1e-9);
  EXPECT_LT(c.R_turned.max, 0.02);  // V in axes turned by some mrad
  EXPECT_EQ(c.R_turned.count, c.grid.size());
}

TEST(Verification, SaysWhatInterpolationCosts) {
  const auto model = reference_model("true");
  const auto c = verified(field_of(model), model, measured_box(), Frame::Machine, paper_grid());
  double squares = 0.0;
  for (const auto& g : c.grid)
    squares += (g.V_las_m - g.stated_m).squaredNorm() / static_cast<double>(c.grid.size());
  EXPECT_NEAR(c.interpolation_rms_m, std::sqrt(squares), 1e-9);
  EXPECT_GT(c.interpolation_rms_m, 1e-6);
}

VolumetricModel scaled_tables(double factor) {
  const auto nodes = *equidistant_nodes(0.0, 0.4, 0.05);
  const auto layout = *ParameterLayout::observable_with_one_target(
      *KinematicChain::parse("[w b Z X Y t]"), {nodes, nodes, nodes});
  const auto n = static_cast<Eigen::Index>(layout.model_size());
  Eigen::VectorXd U(n);
  for (Eigen::Index i = 0; i < n; ++i)
    U(i) = factor * 50e-6 * std::sin(2.0 * static_cast<double>(i));
  const auto hull = box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {2, 2, 2});
  const std::vector<Vector3> tools{Vector3::Zero()};
  return *VolumetricModel::from_vector(layout, ModelDatum::G1, tools, U,
                                       Eigen::MatrixXd::Zero(n, n), *ValidityVolume::hull_of(hull));
}

// Nodes every 50 mm, points every 200 mm: between the nodes the tables change by tens of um; the
// remaining error of a good model is 0.1 um.
TEST(Verification, GivesNoRatioWhereInterpolationCostsMoreThanIsLeft) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 0.05e-6);
  const auto model = scaled_tables(1.0);
  const Field truth = [&](const Vector3& q) -> Vector3 {
    return model.V_at(q, Vector3::Zero()) + Vector3(normal(random), normal(random), normal(random));
  };
  const auto c =
      verified(truth, model, box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {3, 3, 3}), Frame::BestFit);
  EXPECT_GT(c.R_turned.above_1, 0u);  // ratios above 1 although the model is good
  EXPECT_FALSE(ratios_hold(c));
  EXPECT_EQ(effect_at_points(c), Effect::Better);
}

TEST(Verification, SeesThatAModelOfTheWrongSignIsWorse) {
  const auto c = verified(field_of(scaled_tables(-1.0)), scaled_tables(1.0),
                          box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {9, 9, 9}), Frame::BestFit);
  EXPECT_EQ(effect_at_points(c), Effect::Worse);
  EXPECT_TRUE(ratios_hold(c));  // the points are at the nodes
}

TEST(Verification, SeesNoEffectInNoise) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, 20e-6);
  const Field noise = [&](const Vector3&) {
    return Vector3(normal(random), normal(random), normal(random));
  };
  const auto c = verified(noise, scaled_tables(1e-4), box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {5, 5, 5}),
                          Frame::BestFit);
  EXPECT_EQ(effect_at_points(c), Effect::NotSeen);
}

/// Errors that all shots of a place share (20 um, drawn for each place), and noise of each shot (1
/// um).
std::vector<MeasuredPoint> shots_at(const std::vector<Vector3>& places,
                                    const std::vector<int>& shots, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1e-6);
  const auto vector = [&] {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Vector3(x, y, z);
  };
  std::vector<Vector3> common;
  for (std::size_t i = 0; i < places.size(); ++i) common.push_back(20.0 * vector());
  std::vector<MeasuredPoint> points;
  const RigidTransform T = tracker_station();
  for (std::size_t i = 0; i < places.size(); ++i)
    for (int k = 0; k < shots[i]; ++k)
      points.push_back({places[i] + 2.0 * vector(), T * (places[i] + common[i] + vector())});
  return points;
}

TEST(Verification, CountsManyShotsOfOnePlaceAsOnePlace) {
  const auto places = box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {3, 3, 3});
  std::vector<int> once(places.size(), 1), often = once;
  often[4] = 400;
  const auto model = scaled_tables(1e-6);
  const auto left_um = [&](const std::vector<int>& shots) {
    const auto o = *observe(shots_at(places, shots, 3));
    EXPECT_EQ(o.shots.size(), places.size());
    return 1e6 * compare_at_points(o, model, Vector3::Zero())->after.rms_m;
  };
  EXPECT_NEAR(left_um(often), left_um(once), 3.0);  // 400 points of 426 would leave 7 um of 31
  EXPECT_GT(left_um(once), 25.0);
}

TEST(Verification, GivesTheScatterOfTheShots) {
  const auto places = box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {3, 3, 3});
  const auto o = *observe(shots_at(places, std::vector<int>(places.size(), 20), 3));
  EXPECT_EQ(o.shot_count(), 540u);
  ASSERT_TRUE(o.repeatability_m);
  // a vector of three components of 1 um, and readings of 2 um: sqrt(3 (1 + 4)), 0.03 um of chance
  EXPECT_NEAR(1e6 * *o.repeatability_m, std::sqrt(15.0), 0.3);
  EXPECT_FALSE(observe(shots_at(places, std::vector<int>(places.size(), 1), 3))->repeatability_m);
}

// A model of 1 um beside errors of 20 um changes the mean square by 1 um^2 only, and the places
// scatter by 40 um^2: they show no effect, however often each was measured.
TEST(Verification, IsNotSurerWithManyShotsOfFewPlaces) {
  const auto places = box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {2, 2, 2});
  int seen = 0;
  constexpr int kRuns = 40;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    const auto o = *observe(shots_at(places, std::vector<int>(places.size(), 50), seed));
    const auto c = *compare_at_points(o, scaled_tables(0.02), Vector3::Zero());
    seen += effect_at_points(c) == Effect::NotSeen ? 0 : 1;
  }
  EXPECT_LE(seen, kRuns / 5);
}

TEST(Verification, DoesNotJoinPointsAtSmallDistances) {
  auto readings = box_of({0, 0, 0}, {0.4, 0.4, 0.4}, {2, 2, 2});
  for (int i = 1; i <= 10; ++i) readings.emplace_back(0.6e-3 * i, 0.0, 0.0);
  const auto o = *observe(measured(field_of(scaled_tables(1.0)), readings));
  EXPECT_EQ(o.shots.size(), 8u + 5u);  // 1.2 mm from place to place
  const auto small = box_of({0, 0, 0}, {4e-3, 4e-3, 4e-3}, {5, 5, 5});
  EXPECT_EQ(observe(measured(field_of(scaled_tables(0.1)), small))->shots.size(), 125u);
}

TEST(Verification, SeesTheRotationOnlyInTheMachinesAxes) {
  const auto model = reference_model("true");
  const Vector3 omega(2e-4, -3e-4, 5e-4), ball1(-0.09, 0.14, 0.03);
  const Field V = field_of(model);
  const Field turned = [&](const Vector3& q) -> Vector3 { return V(q) + omega.cross(q - ball1); };
  const auto seen = verified(turned, model, measured_thinly(), Frame::Machine, thin_grid());
  EXPECT_LT((seen.turned.tail<3>() - omega).norm(), 1e-9);
  EXPECT_LT(seen.R_turned.max, 1e-6);
  EXPECT_GT(seen.R_stated.median, 0.05);
  const auto fitted = verified(turned, model, measured_thinly(), Frame::BestFit, thin_grid()),
             plain = verified(V, model, measured_thinly(), Frame::BestFit, thin_grid());
  EXPECT_LT((fitted.turned - plain.turned).norm(), 2e-6);  // to first order
}

TEST(Verification, DoesNotMindWhereTheTrackerStands) {
  const auto model = reference_model("ols");
  const Field V = tests::evemu::table3_machine();
  const auto a = *compare(*observe(measured(V, measured_box())), model, Vector3::Zero());
  const auto b =
      *compare(*observe(measured(V, measured_box(), RigidTransform{})), model, Vector3::Zero());
  EXPECT_NEAR(a.before.rms_m, b.before.rms_m, 1e-12);
  EXPECT_NEAR(a.R_turned.mean, b.R_turned.mean, 1e-9);
}

TEST(Verification, SetsVToZeroAtBall1) {
  const auto model = reference_model("ols");
  const Field V = tests::evemu::table3_machine();
  const Field shifted = [&](const Vector3& q) -> Vector3 {
    return V(q) + Vector3(1e-3, -2e-3, 5e-4);
  };
  const auto a = verified(V, model, measured_thinly(), Frame::Machine, thin_grid()),
             b = verified(shifted, model, measured_thinly(), Frame::Machine, thin_grid());
  EXPECT_LT((*a.origin_m - Vector3(-0.09, 0.14, 0.03)).norm(), 1e-12);
  for (std::size_t i = 0; i < a.grid.size(); ++i)
    ASSERT_LT((a.grid[i].V_las_m - b.grid[i].V_las_m).norm(), 1e-12);
}

TEST(Verification, TakesModelsOfTables) {
  const auto side = *equidistant_nodes(0.0, 0.3, 0.1), height = *equidistant_nodes(0.0, 0.1, 0.05);
  const auto layout = *ParameterLayout::observable_with_one_target(
      *KinematicChain::parse("[w b Z X Y t]"), {side, side, height});
  Eigen::VectorXd U =
      Eigen::VectorXd::LinSpaced(static_cast<Eigen::Index>(layout.model_size()), -1e-4, 1e-4);
  const auto n = U.size();
  const auto hull = box_of({0, 0, 0}, {0.3, 0.3, 0.1}, {2, 2, 2});
  const std::vector<Vector3> tools{Vector3::Zero()};
  const auto model =
      *VolumetricModel::from_vector(layout, ModelDatum::G1, tools, U, Eigen::MatrixXd::Zero(n, n),
                                    *ValidityVolume::hull_of(hull));
  const auto c = verified(field_of(model), model, box_of({0, 0, 0}, {0.3, 0.3, 0.1}, {7, 7, 5}),
                          Frame::BestFit);

  EXPECT_FALSE(c.origin_m);
  EXPECT_LT(c.after.rms_m, 1e-3 * c.before.rms_m);
  EXPECT_LT(c.R_turned.median, 0.02);
}

TEST(Verification, SaysWhatTheDataDoNotAllow) {
  const auto model = reference_model("ols");
  const Field large = tests::evemu::table3_machine();
  const Field V = [&](const Vector3& q) -> Vector3 { return 0.1 * large(q); };

  const auto code = [&](const std::vector<Vector3>& readings, const Options& options = {}) {
    const auto o = observe(measured(V, readings));
    if (!o) return o.error().code;
    return compare(*o, model, Vector3::Zero(), options).error().code;
  };

  EXPECT_EQ(code(box_of({0, 0, 0}, {0.8, 0.4, 0.0}, {5, 5, 2})), ErrorCode::DegenerateGeometry);
  EXPECT_EQ(code(box_of({0.1, 0, 0}, {0.5, 0.3, 0.1}, {9, 7, 5})),
            ErrorCode::DegenerateGeometry);  // Ball1 is missing
  EXPECT_EQ(code(box_of({-0.1, -0.1, -0.05}, {0.8, 0.4, 0.15}, {2, 2, 2})),
            ErrorCode::TooFewObservations);
  EXPECT_EQ(code(measured_box(), {.step_m = Vector3::Constant(1e-6)}), ErrorCode::BadInput);
  EXPECT_EQ(compare(*observe(measured(V, measured_box())), model, Vector3(0, 0, 0.1)).error().code,
            ErrorCode::NotApplicable);
}

/// The means of places mix rows that are in the opposite order.
TEST(Verification, NamesTheOppositeOrderAlsoOfRepeatedShots) {
  auto points = measured(tests::evemu::table3_machine(), measured_box());
  for (std::size_t i = 0; i < 20; ++i) points.push_back(points[7 * i]);
  for (std::size_t i = 0, j = points.size() - 1; i < j; ++i, --j)
    std::swap(points[i].measured_m, points[j].measured_m);
  const auto wrong = observe(points);
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().text, testing::HasSubstr("the measured points in the opposite order"));
}

/// V of the model tells mirror images and rotations of the readings from each other.
TEST(Verification, NamesTheAxesOfTheReadingsThatTheModelShows) {
  const auto V = tests::evemu::table3_machine();
  const ErrorsAt errors_at = [&](const Vector3& q_m) { return std::optional(Vector3(V(q_m))); };
  const auto points = measured(V, measured_box());
  EXPECT_THAT(likely_mistakes(points, Frame::BestFit, errors_at), testing::IsEmpty());

  auto swapped = points, turned = points;
  for (auto& p : swapped) std::swap(p.reading_m.x(), p.reading_m.y());
  for (auto& p : turned) p.reading_m.head<2>() *= -1.0;
  EXPECT_THAT(observe(swapped, Frame::BestFit, errors_at).error().text,
              testing::EndsWith("; they fit with X and Y swapped (readings)"));
  ASSERT_TRUE(observe(turned, Frame::BestFit, errors_at));
  EXPECT_THAT(likely_mistakes(turned, Frame::BestFit, errors_at),
              testing::ElementsAre(testing::StartsWith("X and Y reversed (readings): ")));
}

/// Errors of a machine, of the order of 30 um per metre, quadratic in the position.
ErrorsAt random_errors(std::mt19937& random) {
  std::normal_distribution<double> size(0.0, 30e-6);
  Eigen::Matrix<double, 3, 9> c;
  for (double& x : c.reshaped()) x = size(random);
  return [c](const Vector3& q) {
    Eigen::Vector<double, 9> terms;
    terms << q, q.cwiseAbs2(), q.x() * q.y(), q.y() * q.z(), q.z() * q.x();
    return std::optional(Vector3(c * terms));
  };
}

/// The machine is not any more as the model: some years older, or another one. 4 to 60 places.
TEST(Verification, NamesNoMistakeInSoundPointsOfAMachineThatChanged) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 2e-6);
  std::size_t named = 0;
  for (const int places : {4, 5, 6, 8, 12, 20, 60})
    for (const Frame frame : {Frame::BestFit, Frame::Machine})
      for (int machine = 0; machine < 40; ++machine) {
        const ErrorsAt model = random_errors(random), change = random_errors(random);
        const double kept = 1.2 * part(random), changed = 1.2 * part(random);
        const Eigen::Matrix3d R =
            frame == Frame::Machine
                ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                : Eigen::AngleAxisd(6.0 * part(random),
                                    Vector3(0.2, part(random), 1.0).normalized())
                      .toRotationMatrix();
        std::vector<MeasuredPoint> points;
        for (int i = 0; i < places; ++i) {
          const Vector3 q(part(random), 0.7 * part(random), -0.5 * part(random)),
              scatter(noise(random), noise(random), noise(random));
          const Vector3 V = kept * *model(q) + changed * *change(q);
          points.push_back({q, R * (q + V) + Vector3(2.0, -1.0, 0.4) + scatter});
        }
        const auto mistakes = likely_mistakes(points, frame, model);
        named += mistakes.empty() ? 0 : 1;
        if (!mistakes.empty())
          std::cout << places << " places, frame " << int(frame) << ": " << mistakes.front()
                    << '\n';
      }
  EXPECT_EQ(named, 0u) << "of 560";
}

/// All ranges contain the radius of the reflector.
TEST(Verification, NamesAConstantOfTheRanges) {
  const auto V = tests::evemu::table3_machine();
  const ErrorsAt errors_at = [&](const Vector3& q_m) { return std::optional(Vector3(V(q_m))); };
  auto points = measured(V, measured_box());
  for (auto& p : points) p.measured_m += 19.05e-3 * p.measured_m.normalized();
  EXPECT_THAT(likely_mistakes(points, Frame::BestFit, errors_at),
              testing::ElementsAre(testing::StartsWith("ranges shorter by 19.05 mm")));
}

TEST(Verification, RefusesMixedUpRowsAndMirroredFrames) {
  auto points = measured(tests::evemu::table3_machine(), measured_box());
  auto mirrored = points;
  for (auto& p : mirrored) p.measured_m.y() = -p.measured_m.y();
  EXPECT_EQ(observe(mirrored).error().code, ErrorCode::AlignmentFailed);
  EXPECT_THAT(observe(mirrored).error().text,
              testing::HasSubstr("they fit with one axis reversed"));
  std::mt19937 random(1);
  for (std::size_t i = 1; i < points.size(); ++i)
    std::swap(points[i].measured_m, points[random() % i].measured_m);
  EXPECT_EQ(observe(points).error().code, ErrorCode::AlignmentFailed);
  points[3].reading_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(observe(points).error().code, ErrorCode::NotFinite);
}

TEST(RatioStatistics, AreThoseOfTheSample) {
  const auto s = ratio_statistics({0.4, 0.1, 1.5, 0.2, 0.3});
  EXPECT_EQ(s.count, 5u);
  EXPECT_DOUBLE_EQ(s.mean, 0.5);
  EXPECT_DOUBLE_EQ(s.median, 0.3);
  EXPECT_DOUBLE_EQ(s.p25, 0.2);
  EXPECT_DOUBLE_EQ(s.p75, 0.4);
  EXPECT_DOUBLE_EQ(s.max, 1.5);
  EXPECT_EQ(s.above_1, 1u);
  EXPECT_NEAR(s.standard_deviation, 0.570087712549569, 1e-12);
}

enum class NoiseKind { Independent, OneErrorEverywhere, OneCauseOfAllCoordinates };

/// The share of campaigns of `places` in which noise changes the largest residual, or the rms, by
/// more than U.
std::array<double, 2> share_beyond_U(std::size_t places, NoiseKind kind) {
  constexpr int kCampaigns = 4000;
  const auto U = expanded_uncertainty(1e-6, places);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, 1e-6);
  std::array<double, 2> beyond{};

  for (int i = 0; i < kCampaigns; ++i) {
    double largest_m = 0.0, sum_m2 = 0.0;
    Vector3 e = Vector3::Zero();
    for (std::size_t place = 0; place < places; ++place) {
      if (kind == NoiseKind::Independent || place == 0) {
        e = {normal(random), normal(random), normal(random)};
      }
      if (kind == NoiseKind::OneCauseOfAllCoordinates) {
        e.setConstant(e.x());
      }
      largest_m = std::max(largest_m, e.norm());
      sum_m2 += e.squaredNorm();
    }
    beyond[0] += largest_m > U.max_m ? 1.0 / kCampaigns : 0.0;
    beyond[1] += std::sqrt(sum_m2 / static_cast<double>(places)) > U.rms_m ? 1.0 / kCampaigns : 0.0;
  }
  return beyond;
}

TEST(ExpandedUncertainty, IsExceededInFivePercentOrFewer) {
  for (const auto kind : {NoiseKind::Independent, NoiseKind::OneErrorEverywhere,
                          NoiseKind::OneCauseOfAllCoordinates}) {
    for (const std::size_t places : {std::size_t{1}, std::size_t{20}, std::size_t{200}}) {
      const auto [of_largest, of_rms] = share_beyond_U(places, kind);
      EXPECT_LT(of_largest, 0.06) << places << " places";
      EXPECT_LT(of_rms, 0.06) << places << " places";
    }
  }
  const auto [of_one, rms_of_one] = share_beyond_U(1, NoiseKind::OneCauseOfAllCoordinates);
  EXPECT_GT(of_one, 0.04);
  EXPECT_GT(rms_of_one, 0.04);
}

}  // namespace
}  // namespace abbe::calib::verify
