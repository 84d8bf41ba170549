// Inputs that observe() refuses, and how its message names the cause.
#include "abbe/calib/evemu/observe/observe.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;
using testing::AllOf;
using testing::HasSubstr;

/// The error of observe() for touches modified by `change`.
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

// Too few touches to test one of them against the sphere through the others.
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
  EXPECT_THAT(e.text, AllOf(HasSubstr("position 2: ball 6 has radius"),
                            HasSubstr("without touch 13 of 13 it comes nearer"),
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
  EXPECT_THAT(e.text, HasSubstr("the same orientation as at position 3"));
}

TEST(EvemuInput, NamesCoplanarPositions) {
  const Error e = refusal([](Touches& touches, Calibrator&) {
    for (Touch& t : touches) {  // eight times the first position, rotated about z only
      t = touches[static_cast<std::size_t>(&t - touches.data()) % 275];
    }
    for (std::size_t i = 0; i < touches.size(); ++i) {
      const int position = static_cast<int>(i / 275) + 1;
      const Vector3 ball1(-90.0427e-3, 139.9988e-3, 30.0979e-3);
      // About the normal of the artefact: all balls stay in its plane.
      const Vector3 normal = Vector3(-0.05012844983, 0.05514618827, 0.99721915166).normalized();
      touches[i].position = position;
      touches[i].p_m =
          ball1 + Eigen::AngleAxisd(0.03 * position, normal) * (touches[i].p_m - ball1);
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

/// Two wrong touches on a face: no single touch explains the residuals.
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

/// Five touches of every ball, four of every block, in the calibrator's own axes. Ball 5 is out of
/// the plane of the others: with coplanar balls a mirror image equals the array turned over.
std::string seen_through(const Matrix3& M) {
  Calibrator c = reference_calibrator();
  c.balls[4].centre_m.z() += 0.020;
  std::vector<Touch> touches;

  for (const auto& ball : c.balls) {
    for (const Vector3& d : {Vector3(0, 0, 1), Vector3(1, 0, 0), Vector3(0, 1, 0),
                             Vector3(-1, 0, 0), Vector3(0, -1, 0)})
      touches.push_back({1, Feature::Ball, ball.number,
                         M * (ball.centre_m + (ball.radius_m + c.tip_radius_m) * d)});
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

/// The error of observe_errors() for errors whose V was mapped by `L`.
std::string refusal_of_errors(const Matrix3& L) {
  auto errors = reference_errors();
  for (BallError& e : errors) e.V_m = L * e.V_m;
  const auto o = observe_errors(errors, reference_machine());
  return o ? "accepted" : o.error().text;
}

TEST(EvemuInput, NamesWhatWasDoneToErrors) {
  EXPECT_EQ(refusal_of_errors(Matrix3::Identity()), "accepted");
  EXPECT_THAT(refusal_of_errors(-Matrix3::Identity()), HasSubstr("with all signs reversed"));
  EXPECT_THAT(refusal_of_errors(1e-3 * Matrix3::Identity()),
              HasSubstr("with errors in mm instead of um"));
  EXPECT_THAT(refusal_of_errors(Vector3(1, -1, 1).asDiagonal()),
              HasSubstr("with Y reversed in errors"));
  EXPECT_THAT(refusal_of_errors(Matrix3{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}),
              HasSubstr("with X and Y swapped"));
}

}  // namespace
