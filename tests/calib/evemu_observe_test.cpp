#include "abbe/calib/evemu/observe/observe.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/internal/evemu/solve/design_rows.hpp"
#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;
using testing::HasSubstr;

constexpr double kNanometre_mm = 1e-9;  // required agreement with the reference, mm

struct Case {
  const char *touches, *chain;
};

class EvemuChain : public testing::TestWithParam<Case> {};

TEST_P(EvemuChain, AgreesWithTheReferenceAtEveryStep) {
  const auto reference = reference_json(GetParam().chain);
  const auto o =
      observe(reference_touches(GetParam().touches), reference_calibrator(), reference_machine());
  ASSERT_TRUE(o) << o.error().text;
  ASSERT_EQ(o->seen.size(), 8u);

  for (std::size_t p = 0; p < 8; ++p) {
    const auto& position = reference["positions"][p];
    const TouchedArtefact& seen = o->seen[p];
    for (std::size_t b = 0; b < 9; ++b) {
      EXPECT_LT((1000 * seen.balls[b].centre - vector3(position["centres"][b])).norm(),
                kNanometre_mm);
      EXPECT_NEAR(1000 * seen.balls[b].radius, position["radii"][b].get<double>(), kNanometre_mm);
      EXPECT_LT((1000 * seen.ideal_m[b] - vector3(position["ideal_self"][b])).norm(),
                kNanometre_mm);
      EXPECT_LT((1000 * o->rows[9 * p + b].V_m - vector3(position["E"][b])).norm(), kNanometre_mm);
    }

    for (std::size_t b = 0; b < 2; ++b) {
      // 1e-9 mm at the far ball, 680 mm away.
      EXPECT_LT((seen.blocks[b].normal - vector3(position["normals"][b])).norm(), 1e-12);
    }

    for (Eigen::Index r = 0; r < 3; ++r) {
      for (Eigen::Index c = 0; c < 3; ++c) {
        EXPECT_NEAR(seen.T_self_uni.R(r, c), position["T_self_uni"][r][c].get<double>(), 1e-12);
      }
    }

    EXPECT_EQ(o->rows[9 * p].V_m, Vector3(Vector3::Zero()));
  }
}

INSTANTIATE_TEST_SUITE_P(Reference, EvemuChain,
                         testing::Values(Case{"touched_noiseless.csv", "chain_noiseless.json"},
                                         Case{"touched_sig3um.csv", "chain_sig3um.json"}));

/// Four touches of every ball, three of every block: as many as there are unknowns.
std::vector<Touch> fewest_touches() {
  const Calibrator truth = reference_calibrator();
  std::vector<Touch> touches;
  for (const auto& ball : truth.balls) {
    for (const Vector3& d :
         {Vector3(0, 0, 1), Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(-1, 0, 0)}) {
      touches.push_back(
          {1, Feature::Ball, ball.number, ball.centre_m + (ball.radius_m + 2e-3) * d});
    }
  }

  for (const auto& block : truth.blocks) {
    const Vector3 a = block.normal.unitOrthogonal(), b = block.normal.cross(a);
    for (const auto& [i, j] : {std::pair(-1, -1), {1, -1}, {0, 1}}) {
      touches.push_back({1, Feature::Block, block.number, 0.02 * i * a + 0.02 * j * b});
    }
  }

  return touches;
}

TEST(Calibrator, OfTouchesWithoutRedundancyHasTheUncertaintyOfATouch) {
  const auto c =
      precalibrated("few", fewest_touches(), 2e-3, {Vector3::UnitZ(), Vector3::UnitY()}, 1e-6);
  ASSERT_TRUE(c) << c.error().text;
  for (const auto& ball : c->balls) {
    EXPECT_GT(ball.u_m, 0.5e-6);
    EXPECT_LT(ball.u_m, 3e-6);  // four touches on one half do not average their errors
  }
  EXPECT_NEAR(c->blocks[0].u_rad, 1e-6 / 0.03, 0.5e-6 / 0.03);  // touches 20 to 40 mm apart
}

TEST(Calibrator, OfTouchesWithoutRedundancyIsNotExact) {
  for (const auto& u_touch_m : {std::optional<double>{}, std::optional{0.0}}) {
    const auto c = precalibrated("few", fewest_touches(), 2e-3,
                                 {Vector3::UnitZ(), Vector3::UnitY()}, u_touch_m);
    ASSERT_FALSE(c);
    EXPECT_EQ(c.error().code, ErrorCode::TooFewObservations);
    EXPECT_THAT(c.error().text, HasSubstr("ball 1: 4 touches do not show"));
  }
}

TEST(Calibrator, TakesTheTipOutOfItsPrecalibration) {
  // Touches of an array at its calibrated position, by a tip of 2 mm radius.
  const Calibrator truth = reference_calibrator();
  std::vector<Touch> touches;
  for (const auto& ball : truth.balls) {
    for (const Vector3& d : {Vector3(0, 0, 1), Vector3(1, 0, 0.2), Vector3(0, 1, 0.2),
                             Vector3(-1, 0, 0.2), Vector3(0, -1, 0.2), Vector3(1, 1, 1)}) {
      touches.push_back(
          {1, Feature::Ball, ball.number, ball.centre_m + (ball.radius_m + 2e-3) * d.normalized()});
    }
  }

  for (const auto& block : truth.blocks) {
    const Vector3 a = block.normal.unitOrthogonal(), b = block.normal.cross(a);
    for (const auto& [i, j] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
      touches.push_back(
          {1, Feature::Block, block.number, 2e-3 * block.normal + 0.02 * i * a + 0.01 * j * b});
    }
  }

  const auto c = precalibrated("again", touches, 2e-3, {Vector3(0, 0.1, 1), Vector3(0, 1, 0.1)});
  ASSERT_TRUE(c) << c.error().text;
  for (std::size_t i = 0; i < truth.balls.size(); ++i) {
    EXPECT_LT((c->balls[i].centre_m - truth.balls[i].centre_m).norm(), 1e-12);
    EXPECT_NEAR(c->balls[i].radius_m, truth.balls[i].radius_m, 1e-12);
  }

  EXPECT_LT((c->blocks[1].normal - truth.blocks[1].normal).norm(), 1e-12);
}

TEST(Calibrator, IsRefusedWhenItCannotDefineAFrame) {
  Calibrator c = reference_calibrator();
  c.blocks[1].normal = c.blocks[0].normal;
  EXPECT_EQ(check(c).error().code, ErrorCode::DegenerateGeometry);
  c = reference_calibrator();
  c.balls[2].number = 7;
  EXPECT_EQ(check(c).error().code, ErrorCode::BadInput);
  c = reference_calibrator();
  c.balls[2].centre_m = c.balls[1].centre_m;
  EXPECT_THAT(check(c).error().text, HasSubstr("overlap"));
}

TEST(BlockRotation, IsWhatRefittingTheMovedBlocksGives) {
  const auto o = observe(reference_touches("touched_noiseless.csv"), reference_calibrator(),
                         reference_machine());
  ASSERT_TRUE(o);
  std::vector<Vector3> readings;

  for (const BallError& row : o->rows) {
    readings.push_back(row.reading_m);
  }

  const ScaledDesign design = *ScaledDesign::of(o->machine.chain, 3, bounding_box(readings));
  const TouchedArtefact& seen = o->seen[4];
  const Eigen::Matrix3Xd theta = block_rotation(seen, design);
  constexpr double kSmall_m = 1e-8;

  for (std::size_t j = 0; j < design.size(); ++j) {
    std::array<fit::Plane, 2> moved;
    for (std::size_t b = 0; b < 2; ++b) {
      auto points = seen.block_points_m[b];
      for (Vector3& p : points) {
        p += kSmall_m * design.B(p).col(static_cast<Eigen::Index>(j));
      }
      moved[b] = *fit::fit_plane(points, seen.blocks[b].normal);
    }

    const Matrix3 turned = uniform_frame(Vector3::Zero(), moved[0].normal, moved[1].normal)->R *
                           seen.T_self_uni.R.transpose();
    const Vector3 exact(turned(2, 1) - turned(1, 2), turned(0, 2) - turned(2, 0),
                        turned(1, 0) - turned(0, 1));

    // Second-order terms: 1e-8 m over 0.02 m of block give 5e-7 rad; rounding,
    // 1e-16 m / 1e-8 m / 0.02 m, is of the same size.
    EXPECT_LT((0.5 * exact / kSmall_m - theta.col(static_cast<Eigen::Index>(j))).norm(),
              1e-4 * (1 + theta.col(static_cast<Eigen::Index>(j)).norm()))
        << design.equivalent().names()[j];
  }
}

TEST(BallDisplacement, IsWhatRefittingTheMovedPointsGives) {
  const auto o = observe(reference_touches("touched_noiseless.csv"), reference_calibrator(),
                         reference_machine());
  ASSERT_TRUE(o);
  const ScaledDesign design =
      *ScaledDesign::of(o->machine.chain, 3, {{0.26, 0.14, 0.05}, {0.35, 0.2, 0.05}});
  const TouchedArtefact& seen = o->seen[2];
  const Eigen::Matrix3Xd D = ball_displacement(seen, 5, design);
  constexpr double kSmall_m = 1e-8;

  for (std::size_t j = 0; j < design.size(); ++j) {
    auto points = seen.ball_points_m[5];
    for (Vector3& p : points) {
      p += kSmall_m * design.B(p).col(static_cast<Eigen::Index>(j));
    }
    const Vector3 moved = fit::fit_sphere(points)->centre - seen.balls[5].centre;
    // The measured ball is not round (0.05 mm of 12.7): first order neglects this.
    EXPECT_LT((moved / kSmall_m - D.col(static_cast<Eigen::Index>(j))).norm(), 0.01);
  }
}

TEST(BlockRotation, CancelsARotationOfTheWholeVolume) {
  const auto o = observe(reference_touches("touched_noiseless.csv"), reference_calibrator(),
                         reference_machine());
  ASSERT_TRUE(o);
  std::vector<Vector3> readings;

  for (const BallError& row : o->rows) {
    readings.push_back(row.reading_m);
  }

  const ScaledDesign design = *ScaledDesign::of(o->machine.chain, 3, bounding_box(readings));
  const Eigen::MatrixX3d rotation = design.rotation_about(o->ball1_m);
  const Eigen::MatrixXd rows = design_rows(*o, design, RowsFrom::Touches);

  // With RowsFrom::Touches a rotation of a position leaves omega x (Ball1 reading of the position -
  // mean of the Ball1 readings): a lever arm below a micrometre here, compared with 0.7 m with
  // RowsFrom::Centres.
  EXPECT_LT((rows * rotation).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_GT((design_rows(*o, design, RowsFrom::Centres) * rotation).cwiseAbs().maxCoeff(), 0.5);
}

}  // namespace
