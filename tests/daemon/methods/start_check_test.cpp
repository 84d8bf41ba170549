#include "abbe/methods/otf/start_check.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace abbe::daemon {
namespace {

using calib::Vector3;
using protocol::HostTime;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr auto kInterval = milliseconds{2};  // 500 points a second

/// A machine whose first leg runs along X from (100, 0, 0) mm.
class AStart : public ::testing::Test {
 protected:
  void take(nanoseconds duration, const Vector3& from_m,
            const Vector3& velocity_m_per_s = {0, 0, 0}) {
    const HostTime begin = now_;
    const bool stands = velocity_m_per_s.norm() == 0.0 && (from_m - kFirst).norm() < 2e-3;
    if (!stands) stands_since_.reset();
    if (stands && !stands_since_) stands_since_ = begin;
    for (; now_ - begin < duration; now_ += kInterval, ++count_) {
      const double s = std::chrono::duration<double>(now_ - begin).count();
      const bool known =
          std::fmod(0.505 + static_cast<double>(count_) * axes_share_, 1.0) < axes_share_;
      check_.take(
          {.time = now_,
           .usable = usable_,
           .settled = settled_,
           .q_m = known ? std::optional<Vector3>(from_m + s * velocity_m_per_s) : std::nullopt,
           .stood = stands ? now_ - *stands_since_ : nanoseconds{}});
    }
  }
  [[nodiscard]] std::string unmet() const {
    std::string names;
    for (const StartCondition& c : check_.state().conditions)
      if (!c.met) names += c.name + " ";
    return names;
  }

  static inline const Vector3 kFirst{0.1, 0, 0}, kSecond{0.4, 0, 0};
  StartCheck check_{{.first_m = kFirst, .second_m = kSecond, .stand_before = milliseconds{200}}};
  HostTime now_{std::chrono::seconds{100}};
  std::optional<HostTime> stands_since_;  // at the first vertex
  std::size_t count_ = 0;
  double axes_share_ = 1.0;
  bool usable_ = true, settled_ = true;
};

TEST_F(AStart, IsReadyOnceTheMachineStandsAtTheFirstVertexLongEnough) {
  EXPECT_EQ(unmet(), "tracker axes position standstill ");
  take(milliseconds{500}, {0.2, 0.1, 0});
  EXPECT_EQ(unmet(), "position standstill ");
  EXPECT_THAT(check_.text(),
              StartsWith("waiting for the machine to stand at (100.000, 0.000, 0.000)"));
  take(milliseconds{150}, kFirst);
  EXPECT_FALSE(check_.ready());
  EXPECT_EQ(unmet(), "standstill ");
  take(milliseconds{200}, kFirst);
  EXPECT_TRUE(check_.ready());
  EXPECT_EQ(unmet(), "");
  EXPECT_EQ(check_.text(), "READY: drive the path now");
}

TEST_F(AStart, IsNotReadyBeforeTheClockIsSettledAndThePointsAreUsable) {
  settled_ = false;
  take(milliseconds{1000}, kFirst);
  EXPECT_EQ(unmet(), "tracker ");
  EXPECT_THAT(check_.state().conditions.front().text,
              HasSubstr("clock of the tracker is not settled"));
  settled_ = true;
  usable_ = false;
  take(milliseconds{3000}, kFirst);
  EXPECT_THAT(check_.state().conditions.front().text,
              HasSubstr("0 % of the tracker points are usable"));
  usable_ = true;
  take(milliseconds{3000}, kFirst);
  EXPECT_TRUE(check_.ready());
}

TEST_F(AStart, ThatWasMissedIsReportedWithWhatWasMissing) {
  axes_share_ = 0.47;
  settled_ = false;
  take(milliseconds{5000}, kFirst);
  EXPECT_FALSE(check_.ready());
  const HostTime left = now_;
  take(milliseconds{1500}, kFirst, {0.02, 0, 0});  // 30 mm along the first leg
  ASSERT_TRUE(check_.missed());
  EXPECT_LT(now_ - left, std::chrono::seconds{2});
  EXPECT_THAT(check_.text(),
              AllOf(StartsWith("start missed: the machine has left (100.000, 0.000"),
                    HasSubstr("47 % of the tracker points have axis positions"),
                    HasSubstr("clock of the tracker is not settled"), HasSubstr("wait for READY")));

  // Back again, with all axis positions.
  axes_share_ = 1.0;
  settled_ = true;
  take(milliseconds{1500}, {0.13, 0, 0}, {-0.02, 0, 0});
  EXPECT_TRUE(check_.missed());
  take(milliseconds{3000}, kFirst);
  EXPECT_FALSE(check_.missed());
  EXPECT_TRUE(check_.ready());
}

TEST_F(AStart, IsNotMissedByAMachineThatComesToItOrJogsElsewhere) {
  take(milliseconds{3000}, {0.3, 0, 0}, {-0.05, 0, 0});  // towards it along the first leg
  EXPECT_FALSE(check_.missed());
  take(milliseconds{100}, kFirst);
  take(milliseconds{1000}, kFirst, {0, 0.05, 0});  // away from it, not along the first leg
  EXPECT_FALSE(check_.missed());
  take(milliseconds{1000}, {0.15, 0.02, 0}, {0, -0.02, 0});  // and back onto the first leg
  take(milliseconds{500}, {0.15, 0, 0}, {-0.05, 0, 0});
  EXPECT_FALSE(check_.missed());
}

TEST_F(AStart, IsNotReadyWhenTheTrackerFallsSilent) {
  take(milliseconds{1000}, kFirst);
  ASSERT_TRUE(check_.ready());
  check_.tick(now_ + milliseconds{500});  // the next burst is not late
  EXPECT_TRUE(check_.ready());
  check_.tick(now_ + milliseconds{2000});
  EXPECT_FALSE(check_.ready());
  EXPECT_THAT(check_.state().conditions.front().text, HasSubstr("no points from the tracker"));
}

}  // namespace
}  // namespace abbe::daemon
