#include "abbe/calib/evemu/observe.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "abbe/calib/evemu/design_rows.hpp"
#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kNanometre_mm = 1e-9;  // what the reference asks for, in mm

struct Case {
  const char *touches, *chain;
};

class EvemuChain : public testing::TestWithParam<Case> {};

TEST_P(EvemuChain, AgreesWithTheReferenceAtEveryStep) {
  const auto reference = reference_json(GetParam().chain);
  const auto o = observe(reference_touches(GetParam().touches), reference_calibrator(), reference_machine());
  ASSERT_TRUE(o) << o.error().text;
  ASSERT_EQ(o->seen.size(), 8u);
  for (std::size_t p = 0; p < 8; ++p) {
    const auto& position = reference["positions"][p];
    const SeenArtefact& seen = o->seen[p];
    for (std::size_t b = 0; b < 9; ++b) {
      EXPECT_LT((1000 * seen.balls[b].centre - vector3(position["centres"][b])).norm(), kNanometre_mm);
      EXPECT_NEAR(1000 * seen.balls[b].radius, position["radii"][b].get<double>(), kNanometre_mm);
      EXPECT_LT((1000 * seen.ideal_m[b] - vector3(position["ideal_self"][b])).norm(), kNanometre_mm);
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

/// What observe() says to touches that were changed by `change`.
template <class Change>
Error refusal(const Change& change) {
  auto touches = reference_touches("touched_sig3um.csv");
  auto calibrator = reference_calibrator();
  change(touches, calibrator);
  const auto o = observe(touches, calibrator, reference_machine());
  return o ? Error{ErrorCode::NotApplicable, "accepted"} : o.error();
}
using Touches = std::vector<Touch>;

TEST(EvemuInput, NamesABallWithTooFewPoints) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    int kept = 0;
    std::erase_if(touches, [&](const Touch& t) {
      return t.position == 3 && t.feature == Feature::Ball && t.number == 4 && ++kept > 4;
    });
  });
  EXPECT_EQ(e.code, ErrorCode::TooFewObservations);
  EXPECT_THAT(e.text, HasSubstr("position 3: ball 4 has too few points"));
}

TEST(EvemuInput, NamesPointsThatAreThereOnlyOnPaper) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    const Touch* first = nullptr;
    for (Touch& t : touches) {
      if (t.position == 3 && t.feature == Feature::Ball && t.number == 4) {
        first = first == nullptr ? &t : first;
        t.p_m = first->p_m;
      }
    }
  });
  EXPECT_EQ(e.code, ErrorCode::TooFewObservations);
  EXPECT_THAT(e.text, HasSubstr("position 3: ball 4"));
}

TEST(EvemuInput, NamesABallTouchedUnderTwoNumbers) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    Touches again;
    for (const Touch& t : touches) {
      if (t.position == 2 && t.feature == Feature::Ball && t.number == 4) {
        again.push_back(t);
        again.back().number = 5;
        again.back().p_m += Vector3(2e-6, -1e-6, 1e-6);
      }
    }
    std::erase_if(touches, [](const Touch& t) {
      return t.position == 2 && t.feature == Feature::Ball && t.number == 5;
    });
    touches.insert(touches.end(), again.begin(), again.end());
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, HasSubstr("position 2: one ball was touched twice, as ball 4 and as ball 5"));
}

TEST(EvemuInput, NamesSwappedBlocks) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {
      if (t.position == 6 && t.feature == Feature::Block) {
        t.number = 3 - t.number;
      }
    }
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, HasSubstr("position 6: blocks 1 and 2 are swapped"));
}

TEST(EvemuInput, NamesAPositionLeftOut) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    std::erase_if(touches, [](const Touch& t) { return t.position == 5; });
  });
  EXPECT_EQ(e.code, ErrorCode::TooFewObservations);
  EXPECT_THAT(e.text, HasSubstr("position 5: left out"));
}

TEST(EvemuInput, NamesABallLeftOut) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    std::erase_if(touches, [](const Touch& t) {
      return t.position == 5 && t.feature == Feature::Ball && t.number == 9;
    });
  });
  EXPECT_THAT(e.text, HasSubstr("position 5: ball 9 was left out"));
}

// Too few touches to test one of them against the sphere of the others alone.
TEST(EvemuInput, NamesAFalseTouchAmongFewByTheRadiusOfTheBall) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    int touch = 0;
    std::erase_if(touches, [&](const Touch& t) {
      return t.position == 2 && t.feature == Feature::Ball && t.number == 6 && ++touch % 2 == 0;
    });
    touch = 0;
    for (Touch& t : touches) {
      const bool there = t.position == 2 && t.feature == Feature::Ball && t.number == 6;
      if (there && ++touch == 13) t.p_m.y() += 1.6e-3;
    }
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, AllOf(HasSubstr("position 2: ball 6 has radius"), HasSubstr("without touch 13 of 13 it comes nearer"),
                            HasSubstr("a false trigger")));
}

TEST(EvemuInput, NamesTheCalibratorOfAnotherArtefact) {
  const Error shape = refusal([](Touches&, Calibrator& c) { c.balls[7].centre_m.y() -= 0.010; });
  EXPECT_EQ(shape.code, ErrorCode::BadInput);
  EXPECT_THAT(shape.text, HasSubstr("calibrator file of another artefact"));
  const Error radius = refusal([](Touches&, Calibrator& c) {
    for (auto& ball : c.balls) {
      ball.radius_m = 15e-3;
    }
  });
  EXPECT_THAT(radius.text, HasSubstr("calibrator file of another artefact, or another tip"));
}

TEST(EvemuInput, NamesAnotherUnitOfLength) {
  for (const double unit : {1000.0, 0.001, 1.0 / 25.4}) {
    const Error e = refusal([&](Touches& touches, Calibrator&) {
      for (Touch& t : touches) {
        t.p_m *= unit;
      }
    });
    EXPECT_EQ(e.code, ErrorCode::BadInput);
    EXPECT_THAT(e.text, HasSubstr("they fit with lengths in"));
  }
}

TEST(EvemuInput, NamesAFalseTrigger) {
  const Error on_ball = refusal([](Touches& touches, Calibrator&) {
    std::vector<Touch*> of_ball;
    Vector3 sum = Vector3::Zero();
    for (Touch& t : touches) {
      if (t.position == 3 && t.feature == Feature::Ball && t.number == 4) {
        of_ball.push_back(&t);
        sum += t.p_m;
      }
    }
    Vector3& p_m = of_ball.at(6)->p_m;
    p_m += 0.5e-3 * (p_m - sum / 25.0).normalized();
  });
  EXPECT_EQ(on_ball.code, ErrorCode::BadInput);
  EXPECT_THAT(on_ball.text, HasSubstr("position 3: ball 4: touch 7 of 25 lies"));
  const Error on_block = refusal([](Touches& touches, Calibrator&) {
    int touch = 0;
    for (Touch& t : touches) {
      if (t.position == 5 && t.feature == Feature::Block && t.number == 2 && ++touch == 3) {
        t.p_m += Vector3(0.0, 1e-3, 0.0);
      }
    }
  });
  EXPECT_THAT(on_block.text, HasSubstr("position 5: block 2: touch 3 of 25 lies"));
}

TEST(EvemuInput, NamesMirroredAndSwappedAxes) {
  const Error mirrored = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {
      t.p_m.x() = -t.p_m.x();
    }
  });
  EXPECT_EQ(mirrored.code, ErrorCode::BadInput);
  EXPECT_THAT(mirrored.text, HasSubstr("an axis is mirrored"));
  const Error swapped = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {
      std::swap(t.p_m.x(), t.p_m.y());
    }
  });
  EXPECT_THAT(swapped.text, HasSubstr("two axes are swapped"));
}

TEST(EvemuInput, NamesAPositionTouchedTwice) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    Touches again;
    for (const Touch& t : touches) {
      if (t.position == 3) {
        again.push_back(t);
        again.back().position = 7;
        again.back().p_m += Vector3(20e-6, 10e-6, 0.0);
      }
    }
    std::erase_if(touches, [](const Touch& t) { return t.position == 7; });
    touches.insert(touches.end(), again.begin(), again.end());
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, HasSubstr("the artefact stands as at position 3"));
}

TEST(EvemuInput, NamesCoplanarPositions) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {  // eight times the first position, turned about z only
      t = touches[static_cast<std::size_t>(&t - touches.data()) % 275];
    }
    for (std::size_t i = 0; i < touches.size(); ++i) {
      const int position = static_cast<int>(i / 275) + 1;
      const Vector3 ball1(-90.0427e-3, 139.9988e-3, 30.0979e-3);
      // About the artefact's own normal: all balls stay in its plane.
      const Vector3 normal = Vector3(-0.05012844983, 0.05514618827, 0.99721915166).normalized();
      touches[i].position = position;
      touches[i].p_m = ball1 + Eigen::AngleAxisd(0.03 * position, normal) * (touches[i].p_m - ball1);
    }
  });
  EXPECT_EQ(e.code, ErrorCode::DegenerateGeometry);
  EXPECT_THAT(e.text, HasSubstr("coplanar"));
}

TEST(EvemuInput, NamesTwoBallsUnderEachOthersNumber) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {
      const bool ball = t.position == 4 && t.feature == Feature::Ball;
      if (ball && (t.number == 2 || t.number == 6)) t.number = 8 - t.number;
    }
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, HasSubstr("position 4: the balls do not have the shape"));
  EXPECT_THAT(e.text, HasSubstr("they fit with balls 2 and 6 swapped"));
}

TEST(EvemuInput, NamesATouchBesideItsSurface) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    const auto on_block = std::ranges::find_if(touches, [](const Touch& t) {
      return t.position == 3 && t.feature == Feature::Block && t.number == 2;
    });
    on_block->p_m += Vector3::Constant(5e-3);
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, HasSubstr("mm off the surface of the others"));
}

/// Two of a face: no single touch explains it.
TEST(EvemuInput, NamesAFaceWithSeveralFalseTouches) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    int moved = 0;
    for (Touch& t : touches)
      if (t.position == 3 && t.feature == Feature::Block && t.number == 2 && moved++ < 2)
        t.p_m += Vector3::Constant(5e-3);
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, AllOf(HasSubstr("position 3: block 2"), HasSubstr("mm off one surface")));
}

TEST(EvemuInput, NamesABall1ThatMoved) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {
      if (t.position == 8) {
        t.p_m.x() += 0.004;
      }
    }
  });
  EXPECT_EQ(e.code, ErrorCode::BadInput);
  EXPECT_THAT(e.text, HasSubstr("Ball1"));
}

TEST(EvemuInput, RefusesNumbersThatAreNone) {
  const Error e = refusal([](Touches& touches, Calibrator&) { touches[7].p_m.x() = NAN; });
  EXPECT_EQ(e.code, ErrorCode::NotFinite);
}

TEST(EvemuInput, TakesErrorsThatWereComputedElsewhere) {
  const auto o = observe_errors(reference_errors(), reference_machine());
  ASSERT_TRUE(o) << o.error().text;
  EXPECT_EQ(o->rows.size(), 72u);
  EXPECT_EQ(o->positions(), 8u);
  auto twice = reference_errors();
  twice.push_back(twice[20]);
  EXPECT_THAT(observe_errors(twice, reference_machine()).error().text, HasSubstr("twice"));
  auto without = reference_errors();
  std::erase_if(without, [](const BallError& e) { return e.position == 2 && e.ball == 1; });
  EXPECT_THAT(observe_errors(without, reference_machine()).error().text,
              HasSubstr("position 2: Ball1 was left out"));
}

/// Five touches of every ball, four of every block, in the calibrator's own axes; ball 5 is out of the plane
/// of the others: without it a mirror image is the array turned over.
std::string seen_through(const Matrix3& M) {
  Calibrator c = reference_calibrator();
  c.balls[4].centre_m.z() += 0.020;
  std::vector<Touch> touches;
  for (const auto& ball : c.balls) {
    for (const Vector3& d :
         {Vector3(0, 0, 1), Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(-1, 0, 0), Vector3(0, -1, 0)})
      touches.push_back(
          {1, Feature::Ball, ball.number, M * (ball.centre_m + (ball.radius_m + c.tip_radius_m) * d)});
  }
  for (const auto& block : c.blocks) {
    const Vector3 a = block.normal.unitOrthogonal(), b = block.normal.cross(a);
    for (const auto& [i, j] : {std::pair(-1, -1), {1, -1}, {-1, 1}, {1, 1}})
      touches.push_back({1, Feature::Block, block.number, M * (0.02 * i * a + 0.02 * j * b)});
  }
  const auto seen = see_artefact(1, touches, c);
  return seen ? "accepted" : seen.error().text;
}

TEST(EvemuInput, NamesMirroredTouches) {
  EXPECT_EQ(seen_through(Matrix3::Identity()), "accepted");
  EXPECT_THAT(seen_through(Vector3(1, -1, 1).asDiagonal()),
              HasSubstr("they fit with one axis reversed or two axes"));
  EXPECT_THAT(seen_through(Matrix3{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}),
              HasSubstr("they fit with one axis reversed"));
}

/// What observe_errors() says to errors whose V was mapped by `L`.
std::string refusal_of_errors(const Matrix3& L) {
  auto errors = reference_errors();
  for (BallError& e : errors) e.V_m = L * e.V_m;
  const auto o = observe_errors(errors, reference_machine());
  return o ? "accepted" : o.error().text;
}

TEST(EvemuInput, NamesWhatWasDoneToErrors) {
  EXPECT_EQ(refusal_of_errors(Matrix3::Identity()), "accepted");
  EXPECT_THAT(refusal_of_errors(-Matrix3::Identity()), HasSubstr("with all signs reversed"));
  EXPECT_THAT(refusal_of_errors(1e-3 * Matrix3::Identity()), HasSubstr("with errors in mm where um belong"));
  EXPECT_THAT(refusal_of_errors(Vector3(1, -1, 1).asDiagonal()), HasSubstr("with Y reversed in errors"));
  EXPECT_THAT(refusal_of_errors(Matrix3{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}), HasSubstr("with X and Y swapped"));
}

/// Four touches of every ball, three of every block: as many as unknowns.
std::vector<Touch> fewest_touches() {
  const Calibrator truth = reference_calibrator();
  std::vector<Touch> touches;
  for (const auto& ball : truth.balls) {
    for (const Vector3& d : {Vector3(0, 0, 1), Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(-1, 0, 0)}) {
      touches.push_back({1, Feature::Ball, ball.number, ball.centre_m + (ball.radius_m + 2e-3) * d});
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
  const auto c = precalibrated("few", fewest_touches(), 2e-3, {Vector3::UnitZ(), Vector3::UnitY()}, 1e-6);
  ASSERT_TRUE(c) << c.error().text;
  for (const auto& ball : c->balls) {
    EXPECT_GT(ball.u_m, 0.5e-6);
    EXPECT_LT(ball.u_m, 3e-6);  // four touches on one half do not average
  }
  EXPECT_NEAR(c->blocks[0].u_rad, 1e-6 / 0.03, 0.5e-6 / 0.03);  // touches 20 to 40 mm apart
}

TEST(Calibrator, OfTouchesWithoutRedundancyIsNotExact) {
  for (const auto& u_touch_m : {std::optional<double>{}, std::optional{0.0}}) {
    const auto c =
        precalibrated("few", fewest_touches(), 2e-3, {Vector3::UnitZ(), Vector3::UnitY()}, u_touch_m);
    ASSERT_FALSE(c);
    EXPECT_EQ(c.error().code, ErrorCode::TooFewObservations);
    EXPECT_THAT(c.error().text, HasSubstr("ball 1: 4 touches do not show"));
  }
}

TEST(Calibrator, TakesTheTipOutOfItsPrecalibration) {
  // Touches of an array at its calibrated place, by a tip of 2 mm radius.
  const Calibrator truth = reference_calibrator();
  std::vector<Touch> touches;
  for (const auto& ball : truth.balls) {
    for (const Vector3& d : {Vector3(0, 0, 1), Vector3(1, 0, 0.2), Vector3(0, 1, 0.2), Vector3(-1, 0, 0.2),
                             Vector3(0, -1, 0.2), Vector3(1, 1, 1)}) {
      touches.push_back(
          {1, Feature::Ball, ball.number, ball.centre_m + (ball.radius_m + 2e-3) * d.normalized()});
    }
  }
  for (const auto& block : truth.blocks) {
    const Vector3 a = block.normal.unitOrthogonal(), b = block.normal.cross(a);
    for (const auto& [i, j] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
      touches.push_back({1, Feature::Block, block.number, 2e-3 * block.normal + 0.02 * i * a + 0.01 * j * b});
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
  const auto o =
      observe(reference_touches("touched_noiseless.csv"), reference_calibrator(), reference_machine());
  ASSERT_TRUE(o);
  std::vector<Vector3> readings;
  for (const BallError& row : o->rows) {
    readings.push_back(row.reading_m);
  }
  const ScaledDesign design = *ScaledDesign::of(o->machine.chain, 3, bounding_box(readings));
  const SeenArtefact& seen = o->seen[4];
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
    const Matrix3 turned =
        uniform_frame(Vector3::Zero(), moved[0].normal, moved[1].normal)->R * seen.T_self_uni.R.transpose();
    const Vector3 exact(turned(2, 1) - turned(1, 2), turned(0, 2) - turned(2, 0),
                        turned(1, 0) - turned(0, 1));
    // Second order: 1e-8 m over 0.02 m of block is 5e-7 rad; rounding 1e-16 m / 1e-8 m / 0.02 m as much.
    EXPECT_LT((0.5 * exact / kSmall_m - theta.col(static_cast<Eigen::Index>(j))).norm(),
              1e-4 * (1 + theta.col(static_cast<Eigen::Index>(j)).norm()))
        << design.equivalent().names()[j];
  }
}

TEST(BallDisplacement, IsWhatRefittingTheMovedPointsGives) {
  const auto o =
      observe(reference_touches("touched_noiseless.csv"), reference_calibrator(), reference_machine());
  ASSERT_TRUE(o);
  const ScaledDesign design = *ScaledDesign::of(o->machine.chain, 3, {{0.26, 0.14, 0.05}, {0.35, 0.2, 0.05}});
  const SeenArtefact& seen = o->seen[2];
  const Eigen::Matrix3Xd D = ball_displacement(seen, 5, design);
  constexpr double kSmall_m = 1e-8;
  for (std::size_t j = 0; j < design.size(); ++j) {
    auto points = seen.ball_points_m[5];
    for (Vector3& p : points) {
      p += kSmall_m * design.B(p).col(static_cast<Eigen::Index>(j));
    }
    const Vector3 moved = fit::fit_sphere(points)->centre - seen.balls[5].centre;
    // The ball is not round as read (0.05 mm of 12.7): that is what first order leaves out.
    EXPECT_LT((moved / kSmall_m - D.col(static_cast<Eigen::Index>(j))).norm(), 0.01);
  }
}

TEST(BlockRotation, CancelsARotationOfTheWholeVolume) {
  const auto o =
      observe(reference_touches("touched_noiseless.csv"), reference_calibrator(), reference_machine());
  ASSERT_TRUE(o);
  std::vector<Vector3> readings;
  for (const BallError& row : o->rows) {
    readings.push_back(row.reading_m);
  }
  const ScaledDesign design = *ScaledDesign::of(o->machine.chain, 3, bounding_box(readings));
  const Eigen::MatrixX3d rotation = design.rotation_about(o->ball1_m);
  const Eigen::MatrixXd rows = design_rows(*o, design, RowsFrom::Touches);
  // Per position a rotation leaves omega x (Ball1 of the position - mean Ball1), as read: below a micrometre
  // of lever here, against 0.7 m in the plain design.
  EXPECT_LT((rows * rotation).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_GT((design_rows(*o, design, RowsFrom::Centres) * rotation).cwiseAbs().maxCoeff(), 0.5);
}

}  // namespace
