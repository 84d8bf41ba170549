#include "abbe/calib/evemu/judge/lack_of_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <ostream>
#include <string>

#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/calib/internal/evemu/judge/touch_residuals.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

struct ArrayRun {
  std::vector<Touch> touches = touches_in_order(reference_touches("touched_sig3um.csv"));
  Calibrator calibrator = reference_calibrator();
  Machine machine = reference_machine();
};

Observations observed(const ArrayRun& run, const ObserveOptions& options = {}) {
  return *observe(run.touches, run.calibrator, run.machine, options);
}

/// Of a sound run, solved once.
const Observations& sound_observations() {
  static const Observations o = observed({});
  return o;
}
const Solution& sound_solution() {
  static const Solution solution = *solve(sound_observations());
  return solution;
}

struct ArrayFault {
  Cause cause;
  std::string words;
  std::function<void(ArrayRun&)> put_in;
};
void PrintTo(const ArrayFault& f, std::ostream* out) {
  *out << name(f.cause);
}

std::vector<Alternative> found_in(const ArrayRun& run) {
  const Observations o = observed(run);
  return *alternatives(o, *solve(o));
}

TEST(EvemuLackOfFit, NothingInASoundRunMovesTheModel) {
  for (const Alternative& a : found_in({})) {
    EXPECT_LT(a.bias_m, 0.1 * a.u_m) << a.text;
  }
}

class EvemuLackOfFit : public testing::TestWithParam<ArrayFault> {};

TEST_P(EvemuLackOfFit, IsTheCauseNamedFirst) {
  ArrayRun run;
  GetParam().put_in(run);
  const auto found = found_in(run);
  ASSERT_THAT(found, Not(IsEmpty()));
  EXPECT_EQ(name(found.front().cause), name(GetParam().cause)) << found.front().text;
  EXPECT_THAT(found.front().text, HasSubstr(GetParam().words));
}

JudgeOptions wide_limits() {
  JudgeOptions options;
  options.accept_shape_only = true;
  options.limits.max_error_m = 0.01;
  options.limits.max_gradient = 0.5;
  return options;
}

Verdict verdict_of(const ArrayRun& run) {
  const Observations o = observed(run);
  return *judge(o, *solve(o), nullptr, wide_limits());
}

// A shift that is covered by the uncertainty, on a machine with errors of 3 mm, is a note.
TEST_P(EvemuLackOfFit, StandsInTheVerdict) {
  ArrayRun run;
  GetParam().put_in(run);
  const Verdict verdict = verdict_of(run);
  std::vector<std::string> all = verdict.reasons;
  all.insert(all.end(), verdict.notes.begin(), verdict.notes.end());
  EXPECT_THAT(all, Contains(HasSubstr(GetParam().words)));
}

void move(ArrayRun& run, int position, int from_ball, const Vector3& by_m) {
  for (Touch& t : run.touches) {
    if (t.position == position && t.feature == Feature::Ball && t.number >= from_ball)
      t.p_m += by_m;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Faults, EvemuLackOfFit,
    testing::Values(ArrayFault{Cause::Ball, "position 3, ball 9",
                               [](ArrayRun& r) {
                                 move(r, 3, 9, {0.0, 80e-6, 60e-6});
                               }},
                    ArrayFault{Cause::ArrayFile, "position of ball 5 in the calibrator file",
                               [](ArrayRun& r) { r.calibrator.balls[4].centre_m.y() += 0.2e-3; }},
                    ArrayFault{Cause::Moved, "position 6: the array moved before ball 4",
                               [](ArrayRun& r) {
                                 move(r, 6, 4, {90e-6, -60e-6, 120e-6});
                               }},
                    ArrayFault{Cause::Touch, "touch 7 of 25",
                               [](ArrayRun& r) {
                                 int number = 0;
                                 for (Touch& one : r.touches) {
                                   const bool there = one.position == 2 &&
                                                      one.feature == Feature::Block &&
                                                      one.number == 1;
                                   if (there && ++number == 7) one.p_m.z() += 0.12e-3;
                                 }
                               }},
                    ArrayFault{Cause::Drift, "drifts", [](ArrayRun& r) {
                                 double at = 0.0;
                                 for (Touch& one : r.touches) {
                                   const double share =
                                       ++at / static_cast<double>(r.touches.size());
                                   one.p_m.x() -= 0.3e-3 * share * one.p_m.x();
                                 }
                               }}));

TEST(EvemuJudge, RefusesWhatAFaultMovesByMoreThanItsUncertainty) {
  EXPECT_TRUE(verdict_of({}).accepted);
  ArrayRun run;
  move(run, 3, 9, {0.0, 80e-6, 60e-6});
  const Verdict verdict = verdict_of(run);
  ASSERT_FALSE(verdict.accepted);
  EXPECT_THAT(verdict.reasons.front(), HasSubstr("position 3, ball 9"));
  EXPECT_THAT(verdict.reasons.front(), HasSubstr("it changes the model by"));
  EXPECT_EQ(verdict.causes.front(), "ball");
  EXPECT_EQ(verdict.causes.size(), verdict.reasons.size());
}

// A ball whose touches have no position in the order: alternatives that depend on time have no
// columns.
TEST(EvemuJudge, RefusesARunThatCannotBeComparedWithAnAlternative) {
  const Solution& solution = sound_solution();
  Observations broken = sound_observations();
  broken.seen[2].ball_index[4] = std::numeric_limits<double>::quiet_NaN();
  const Verdict verdict = *judge(broken, solution, nullptr, wide_limits());
  EXPECT_FALSE(verdict.accepted);
  EXPECT_THAT(verdict.reasons, Contains(HasSubstr("the comparison with cause \"creep\" failed")));
  EXPECT_THAT(verdict.causes, Contains("creep"));
}

TEST(EvemuLackOfFit, NamesTouchesThatNoSurfaceFits) {
  Observations o = sound_observations();
  const Solution& solution = sound_solution();
  o.seen[1].ball_points_m[2][0].x() = std::numeric_limits<double>::quiet_NaN();
  const TouchResiduals residuals = touch_residuals(o, solution.model, 1e-5);
  EXPECT_THAT(residuals.failed, testing::ElementsAre("position 2, ball 3"));
}

TEST(EvemuJudge, NotesADesignThatDoesNotExist) {
  ObserveOptions options;
  options.order = kMostOrder;
  const Observations o = observed({}, options);
  const Verdict verdict = *judge(o, *solve(o), nullptr, wide_limits());
  EXPECT_THAT(verdict.notes, Contains(HasSubstr("not compared with polynomials of order")));
  EXPECT_THAT(verdict.causes, Not(Contains("order")));
}

TEST(EvemuJudge, StopsBetweenAlternatives) {
  JudgeOptions options = wide_limits();
  int asked = 0;
  options.watch.stopped = [&] { return ++asked == 20; };
  const auto verdict = judge(sound_observations(), sound_solution(), nullptr, options);
  ASSERT_FALSE(verdict);
  EXPECT_EQ(verdict.error().code, ErrorCode::NotConverged);
  EXPECT_EQ(asked, 20);
}

TEST(EvemuJudge, ReportsProgressUpToTheEnd) {
  JudgeOptions options = wide_limits();
  std::vector<double> fractions;
  options.watch.progress = [&](double fraction) { fractions.push_back(fraction); };
  ASSERT_TRUE(judge(sound_observations(), sound_solution(), nullptr, options));
  ASSERT_THAT(fractions, Not(IsEmpty()));
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_DOUBLE_EQ(fractions.back(), 1.0);
}

/// Ball1 is touched last, its blocks before it.
ArrayRun touched_backwards() {
  ArrayRun run;
  std::reverse(run.touches.begin(), run.touches.end());
  return run;
}

TEST(EvemuLackOfFit, CountsFromTheFirstTouchOfAPosition) {
  ArrayRun run = touched_backwards();
  for (Touch& t : run.touches) {
    const bool after = t.feature == Feature::Block || t.number <= 4;
    if (t.position == 6 && after) t.p_m += Vector3(90e-6, -60e-6, 120e-6);
  }
  const auto found = found_in(run);
  ASSERT_THAT(found, Not(IsEmpty()));
  EXPECT_THAT(found.front().text, HasSubstr("position 6: the array moved before ball 4"));
}

TEST(EvemuLackOfFit, FindsNothingWhereBall1IsTouchedLast) {
  for (const Alternative& a : found_in(touched_backwards())) {
    EXPECT_LT(a.bias_m, 0.1 * a.u_m) << a.text;
  }
}

// Two balls at every position, none of which scatters enough to be found by itself.
TEST(EvemuLackOfFit, FindsBallsThatMovedALittleWhileTheyWereTouched) {
  ArrayRun run;
  std::map<std::pair<int, int>, int> count;
  for (Touch& t : run.touches) {
    const bool chosen = t.number == 1 + t.position || t.number == 1 + (t.position + 4) % 9;
    if (t.feature == Feature::Ball && chosen && ++count[{t.position, t.number}] % 2 == 0) {
      t.p_m += Vector3::Constant(8e-6);
    }
  }
  EXPECT_THAT(found_in(run),
              Contains(testing::Field(&Alternative::text, HasSubstr(" balls scatter by"))));
}

/// When axis a reverses, the tip shifts by column a of `b_m`.
ArrayRun with_backlash(const Matrix3& b_m) {
  ArrayRun run;
  const Observations o = observed(run);
  for (Touch& t : run.touches) {
    if (t.feature == Feature::Ball) {
      const auto position = static_cast<std::size_t>(t.position) - 1;
      const auto& ball = o.seen[position].balls[static_cast<std::size_t>(t.number) - 1];
      const Vector3 n = (t.p_m - ball.centre).normalized();
      const Vector3 side = (n.array().abs() > 0.1).select(n.array().sign(), 0.0);
      t.p_m += 0.5 * n.dot(b_m * side) * n;
    }
  }
  return run;
}

Alternative backlash_found_in(const ArrayRun& run) {
  for (Alternative& a : found_in(run)) {
    if (a.cause == Cause::Backlash) return std::move(a);
  }
  return {Cause::Backlash, "none found"};
}

Vector3 backlash_along_um(const ArrayRun& run) {
  const std::string text = backlash_found_in(run).text;
  const auto at = std::min(text.find("backlash of X"), text.size());
  Vector3 b = Vector3::Zero();
  EXPECT_EQ(
      std::sscanf(text.c_str() + at, "backlash of X %lf, Y %lf, Z %lf", &b.x(), &b.y(), &b.z()), 3)
      << text;
  return b;
}

// Errors of 3 mm deform the measured ball: the run without a fault shows some backlash too.
TEST(EvemuLackOfFit, FindsBacklashAlongOneAxis) {
  Matrix3 b_m = Matrix3::Zero();
  b_m(0, 0) = 40e-6;
  const Vector3 more_um = backlash_along_um(with_backlash(b_m)) - backlash_along_um({});
  EXPECT_LT((more_um - Vector3(40.0, 0.0, 0.0)).norm(), 2.0) << more_um.transpose();
}

TEST(EvemuLackOfFit, FindsBacklashAcrossTheAxisThatTurnsRound) {
  Matrix3 b_m = Matrix3::Zero();
  b_m(1, 0) = 40e-6;
  const Alternative found = backlash_found_in(with_backlash(b_m));
  EXPECT_THAT(found.text, HasSubstr("across them"));
  EXPECT_GT(found.log_likelihood, 500.0);
}

// The model is the mean of both directions: this is not a scatter without a known cause.
TEST(EvemuJudge, NotesBacklashThatItFound) {
  const Verdict verdict = verdict_of(with_backlash(Vector3::Constant(30e-6).asDiagonal()));
  EXPECT_TRUE(verdict.accepted) << (verdict.reasons.empty() ? "" : verdict.reasons.front());
  EXPECT_THAT(verdict.notes, Contains(HasSubstr("depend on the direction of approach")));
}

/// Adds slow noise: a random shift whose correlation decays by 1/e over a quarter of the touches of
/// a position.
ArrayRun with_slow_noise(double sd_m) {
  ArrayRun run;
  NormalDeviates random(11);
  const double keep = std::exp(-4.0 * 8.0 / static_cast<double>(run.touches.size()));
  Vector3 shift = Vector3::Zero();
  for (Touch& t : run.touches) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      shift(k) = keep * shift(k) + std::sqrt(1.0 - keep * keep) * sd_m * random.next();
    }
    t.p_m += shift;
  }
  return run;
}

TEST(EvemuLackOfFit, FindsTheSizeOfSlowNoise) {
  const Solution& plain = sound_solution();
  EXPECT_EQ(plain.slow_noise, 0.0);
  const Solution slow = *solve(observed(with_slow_noise(20e-6)));
  // 64 balls and the share that the estimation absorbs: accuracy one third.
  EXPECT_NEAR(slow.statistics.slow_noise_m, 20e-6, 7e-6);
  EXPECT_GT(correction_size(sound_observations(), slow).u_m,
            1.5 * correction_size(sound_observations(), plain).u_m);
}

TEST(EvemuJudge, NotesSlowNoise) {
  const Verdict verdict = verdict_of(with_slow_noise(20e-6));
  std::vector<std::string> all = verdict.reasons;
  all.insert(all.end(), verdict.notes.begin(), verdict.notes.end());
  EXPECT_THAT(all, Contains(HasSubstr("slow noise: within positions")));
}

}  // namespace
