#include "abbe/calib/evemu/lack_of_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <ostream>
#include <string>

#include "abbe/calib/evemu/judge.hpp"
#include "evemu_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// The touches of the prototype, in the order of [Li OMM] section 3: Ball1, blocks, the other balls.
struct ArrayRun {
  std::vector<Touch> touches;
  Calibrator calibrator = reference_calibrator();
  Machine machine = reference_machine();

  ArrayRun() {
    for (int position = 1; position <= 8; ++position) {
      take(position, [](const Touch& t) { return t.feature == Feature::Ball && t.number == 1; });
      take(position, [](const Touch& t) { return t.feature == Feature::Block; });
      take(position, [](const Touch& t) { return t.feature == Feature::Ball && t.number > 1; });
    }
  }

 private:
  void take(int position, const std::function<bool(const Touch&)>& which) {
    for (const Touch& t : reference_touches("touched_sig3um.csv")) {
      if (t.position == position && which(t)) touches.push_back(t);
    }
  }
};

struct ArrayFault {
  Cause cause;
  std::string words;
  std::function<void(ArrayRun&)> put_in;
};
void PrintTo(const ArrayFault& f, std::ostream* out) {
  *out << name(f.cause);
}

std::vector<Alternative> found_in(const ArrayRun& run) {
  const Observations o = *observe(run.touches, run.calibrator, run.machine);
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

Verdict verdict_of(const ArrayRun& run) {
  const Observations o = *observe(run.touches, run.calibrator, run.machine);
  JudgeOptions options;
  options.accept_shape_only = true;
  options.limits.max_error_m = 0.01;
  options.limits.max_gradient = 0.5;
  return *judge(o, *solve(o), nullptr, options);
}

// What the uncertainty covers, on a machine of 3 mm, is a note.
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
    if (t.position == position && t.feature == Feature::Ball && t.number >= from_ball) t.p_m += by_m;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Faults, EvemuLackOfFit,
    testing::Values(ArrayFault{Cause::Ball, "position 3, ball 9",
                               [](ArrayRun& r) {
                                 move(r, 3, 9, {0.0, 80e-6, 60e-6});
                               }},
                    ArrayFault{Cause::ArrayFile, "calibrator file's place of ball 5",
                               [](ArrayRun& r) { r.calibrator.balls[4].centre_m.y() += 0.2e-3; }},
                    ArrayFault{Cause::Moved, "position 6: the array moved before ball 4",
                               [](ArrayRun& r) {
                                 move(r, 6, 4, {90e-6, -60e-6, 120e-6});
                               }},
                    ArrayFault{Cause::Touch, "touch 7 of 25",
                               [](ArrayRun& r) {
                                 int number = 0;
                                 for (Touch& one : r.touches) {
                                   const bool there =
                                       one.position == 2 && one.feature == Feature::Block && one.number == 1;
                                   if (there && ++number == 7) one.p_m.z() += 0.12e-3;
                                 }
                               }},
                    ArrayFault{Cause::Drift, "drifts", [](ArrayRun& r) {
                                 double at = 0.0;
                                 for (Touch& one : r.touches) {
                                   const double share = ++at / static_cast<double>(r.touches.size());
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
  EXPECT_THAT(verdict.reasons.front(), HasSubstr("it moves the model by"));
}

}  // namespace
