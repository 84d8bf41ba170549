/// All ranges too long or too short by the radius of the reflector.

#include <gmock/gmock.h>

#include <string>
#include <utility>

#include "abbe/calib/internal/otf/samples/standstill.hpp"
#include "abbe/calib/otf/observe/alignment.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;
using testing::Not;

std::string refusal_with_ranges(const MadeRun& run, double longer_m) {
  std::vector<TrackerObservation> samples = run.samples;
  for (TrackerObservation& s : samples) s.p_tracker_m *= 1.0 + longer_m / s.p_tracker_m.norm();
  const auto a = align(*make_segments(samples, run.options), run.machine, run.path, run.options);
  return a ? "accepted" : a.error().text;
}

/// The number after `words`; 0 if the text does not have them.
double mm_after(const std::string& text, const std::string& words) {
  const auto at = text.find(words);
  EXPECT_NE(at, std::string::npos) << text;
  return at == std::string::npos ? 0.0 : std::stod(text.substr(at + words.size()));
}

/// Errors of 30 um act as a scale error, which 0.3 mm of range at 2 to 3 m make, too.
TEST(RangeChange, IsNamedWithItsSizeAndDirection) {
  for (const auto& [error_scale_m, tolerance_mm] : {std::pair{0.0, 0.05}, {30e-6, 0.3}}) {
    const MadeRun run = make_run({.error_scale_m = error_scale_m});
    const auto longer = refusal_with_ranges(run, 19.05e-3);
    EXPECT_NEAR(mm_after(longer, "they fit with ranges shorter by "), 19.05, tolerance_mm);
    EXPECT_THAT(longer, HasSubstr(" mm (radius of the reflector"));
    EXPECT_NEAR(mm_after(refusal_with_ranges(run, -12.7e-3), "they fit with ranges longer by "),
                12.7, tolerance_mm);
  }
}

TEST(RangeChange, IsNotNamedForAnotherShape) {
  const MadeRun run = make_run({});
  Path other = run.path;
  for (std::size_t i = 0; i < other.vertices_m.size(); i += 3) other.vertices_m[i].x() += 0.02;
  const auto a = align(*make_segments(run.samples, run.options), run.machine, other, run.options);
  ASSERT_FALSE(a);
  EXPECT_THAT(a.error().text, Not(HasSubstr("ranges")));
}

TEST(Standstills, OneRowForEachIsNamed) {
  std::vector<TrackerObservation> means;
  for (int i = 0; i < 200; ++i)
    means.push_back(
        {5.0 * i, Vector3(1.0 + 0.05 * (i % 7), 0.04 * (i % 5), 0.03 * (i % 11)), true});
  const auto found = find_standstills(means, {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, HasSubstr("one row each 5 s"));
  EXPECT_THAT(found.error().text, HasSubstr("means are not read"));
}

TEST(Standstills, ThatAreMissingInDenseSamplesAreNotCalledMeans) {
  std::vector<TrackerObservation> moving;
  for (int i = 0; i < 2000; ++i) moving.push_back({0.002 * i, Vector3(1.0 + 0.01 * i, 0, 0), true});
  const auto found = find_standstills(moving, {});
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, Not(HasSubstr("mean")));
}

}  // namespace
