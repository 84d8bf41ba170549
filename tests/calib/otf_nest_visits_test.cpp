/// Visits of reference nests in the stream of the tracker.
#include "abbe/calib/otf/samples/nest_visits.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kPeriod_s = 0.02;
const Vector3 kA_m(2.0, 0.5, 0.3), kB_m(1.5, -1.0, 0.2);

/// Appends samples of a target, one per period.
class StreamOfTargets {
 public:
  StreamOfTargets& stand(const Vector3& at_m, double duration_s) {
    return move(at_m, at_m, duration_s);
  }
  StreamOfTargets& move(const Vector3& from_m, const Vector3& to_m, double duration_s) {
    for (double t = 0.0; t < duration_s - 0.5 * kPeriod_s; t += kPeriod_s) {
      const Vector3 p = from_m + (to_m - from_m) * (t / duration_s);
      samples.push_back({time_s_, abbe::tests::otf::with_noise(p, {}, 1.0, random_), true});
      time_s_ += kPeriod_s;
    }
    return *this;
  }
  StreamOfTargets& lose(double duration_s) {
    time_s_ += duration_s;
    return *this;
  }

  std::vector<TrackerObservation> samples;

 private:
  double time_s_ = 0.0;
  std::mt19937_64 random_{1};
};

NestOptions nests() {
  return {.nests = {{.name = "A", .position_tracker_m = kA_m},
                    {.name = "B", .position_tracker_m = kB_m + Vector3(0.0, 4e-3, 0.0)}}};
}

TEST(NestVisits, AreFoundWithMeanAndUncertainty) {
  const Vector3 path(1.0, 0.0, 0.0);
  StreamOfTargets stream;
  stream.stand(path, 2.0).lose(1.0).stand(kA_m, 4.0).lose(1.0).stand(kB_m, 2.0).stand(path, 2.0);
  const auto visits = find_nest_visits(stream.samples, nests(), {});
  ASSERT_TRUE(visits);
  ASSERT_THAT(visits->found, SizeIs(2));
  EXPECT_THAT(visits->samples, SizeIs(300));
  EXPECT_THAT(visits->notes, IsEmpty());
  EXPECT_EQ(visits->found[1].nest, 1u);
  EXPECT_NEAR(visits->found[0].time_s, 5.0, kPeriod_s);
  const NestVisit& a = visits->found[0];
  EXPECT_EQ(a.samples, 200u);
  const Vector3 error_m = a.mean_tracker_m - kA_m;
  EXPECT_LT(error_m.dot(a.cov_tracker_m2.inverse() * error_m), 16.3);  // 99.9 %, three components
}

TEST(NestVisits, ATargetThatPassesIsNotInTheNest) {
  StreamOfTargets stream;
  stream.move(kA_m - Vector3(0.1, 0.0, 0.0), kA_m + Vector3(0.1, 0.0, 0.0), 4.0);
  const auto visits = find_nest_visits(stream.samples, nests(), {});
  ASSERT_TRUE(visits);
  EXPECT_THAT(visits->samples, IsEmpty());
}

TEST(NestVisits, ShortVisitsAndNestsNeverSeenAreNamed) {
  StreamOfTargets stream;
  stream.stand(Vector3(1.0, 0.0, 0.0), 2.0).stand(kA_m, 0.2).stand(Vector3(1.0, 0.0, 0.0), 2.0);
  const auto visits = find_nest_visits(stream.samples, nests(), {});
  ASSERT_TRUE(visits);
  EXPECT_THAT(visits->found, IsEmpty());
  EXPECT_THAT(visits->samples, SizeIs(10));
  EXPECT_THAT(visits->notes, ElementsAre(HasSubstr("A: 1 visit shorter than 0.5 s"),
                                         HasSubstr("nest B was never measured")));
}

TEST(NestVisits, SlowNoiseRaisesTheUncertainty) {
  StreamOfTargets still, moving;
  still.stand(kA_m, 8.0);
  moving.move(kA_m, kA_m + Vector3(30e-6, 0.0, 0.0), 8.0);
  const auto variance = [](const StreamOfTargets& stream) {
    return find_nest_visits(stream.samples, nests(), {})->found.front().cov_tracker_m2.trace();
  };
  EXPECT_GT(variance(moving), 3.0 * variance(still));
}

TEST(NestVisits, RefusesNestsThatAreNotDefined) {
  const auto text_of = [](const NestOptions& options) {
    const auto visits = find_nest_visits({}, options, {});
    return visits ? std::string{} : visits.error().text;
  };
  EXPECT_THAT(text_of({.nests = {{.name = ""}}}), HasSubstr("no name"));
  EXPECT_THAT(text_of({.nests = {{.name = "A"}, {.name = "A"}}}), HasSubstr("two nests"));
  EXPECT_THAT(text_of({.nests = {{.name = "A"}, {.name = "B"}}}),
              AllOf(HasSubstr("A"), HasSubstr("B"), HasSubstr("apart")));
  EXPECT_THAT(text_of({.nests = {{.name = "A", .radius_m = -1e-3}}}), HasSubstr("radius"));
  EXPECT_THAT(text_of({.nests = {{.name = "A"}}, .u_repeatability_m = 0.0}),
              HasSubstr("repeatability"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(text_of({.nests = {{.name = "A", .position_tracker_m = {nan, 0.0, 0.0}}}}),
              HasSubstr("not a number"));
}

}  // namespace
