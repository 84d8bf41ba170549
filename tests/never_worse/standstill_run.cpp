#include <algorithm>
#include <cmath>

#include "otf_run.hpp"
#include "random_numbers.hpp"

namespace abbe::tests::never_worse {
namespace {

constexpr std::size_t kPositions = 200, kCorners = 8;

/// The corners of the travel, then random positions.
std::vector<Vector3> positions_of(OtfRun& run, std::size_t count) {
  std::vector<Vector3> positions;
  for (std::size_t i = 0; i < count; ++i) {
    Vector3 q;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto& range = run.truth.axes[a].range;
      const double share =
          i < kCorners ? static_cast<double>(i >> a & 1U) : uniform(run.random, 0.0, 1.0);
      q(static_cast<Eigen::Index>(a)) = range.min_m + share * (range.max_m - range.min_m);
    }
    positions.push_back(q);
  }
  return positions;
}

/// Index of a position that is neither near the beginning nor near the end.
std::ptrdiff_t some(OtfRun& run) {
  constexpr std::size_t kRim = 10;
  return static_cast<std::ptrdiff_t>(kRim + run.random() % (run.driven_m.size() - 2 * kRim));
}

void miss(OtfRun& run, int count) {
  for (int i = 0; i < count; ++i) run.driven_m.erase(run.driven_m.begin() + some(run));
}

void stop_elsewhere(OtfRun& run, int count) {
  for (int i = 0; i < count; ++i) {
    const Vector3 q = positions_of(run, kCorners + 1).back();
    run.driven_m.insert(run.driven_m.begin() + some(run), q);
  }
}

/// The last `count` positions before a random one are driven once more.
void visit_again(OtfRun& run, std::ptrdiff_t count) {
  const auto at = run.driven_m.begin() + some(run);
  const std::vector<Vector3> again(at - count, at);
  run.driven_m.insert(at, again.begin(), again.end());
}

/// All faults of the on-the-fly method whose meaning does not depend on the motion, with the names
/// that this mode gives them.
std::vector<Fault<OtfRun>> faults_of_both_modes() {
  std::vector<Fault<OtfRun>> faults;
  for (Fault<OtfRun>& fault : otf_faults()) {
    const auto begins_with = [&](std::string_view text) { return fault.name.starts_with(text); };
    if (begins_with("beam lost") || begins_with("two vertices")) {
      continue;  // below, with another size
    }
    if (begins_with("vertex off")) fault.names = {{"leg"}};
    if (begins_with("last third") || begins_with("path mirrored")) {
      fault.names.words = {"standstills", "path"};
    }
    faults.push_back(std::move(fault));
  }
  return faults;
}

}  // namespace

OtfRun random_standstill_run(std::uint64_t seed) {
  OtfRun run = random_otf_run(seed);
  run.mode = calib::otf::Mode::Standstill;
  run.path_m = run.driven_m = positions_of(run, kPositions);
  run.dwell_s = 1.0;
  run.feed_m_per_s = 10.0 / 60.0;
  return run;
}

std::vector<Fault<OtfRun>> standstill_faults() {
  const Names shape{{}, {"standstills"}};
  std::vector<Fault<OtfRun>> faults = faults_of_both_modes();
  const std::vector<Fault<OtfRun>> of_standstills{
      {"three positions missed", [](OtfRun& r) { miss(r, 3); }, {}},
      {"forty positions missed", [](OtfRun& r) { miss(r, 40); }, shape},
      {"three stops at no position", [](OtfRun& r) { stop_elsewhere(r, 3); }, {}},
      {"five positions visited twice", [](OtfRun& r) { visit_again(r, 5); }, {}},
      {"missed, elsewhere and twice",
       [](OtfRun& r) { miss(r, 2), stop_elsewhere(r, 2), visit_again(r, 2); },
       {}},
      {"positions of another run", [](OtfRun& r) { r.path_m = positions_of(r, kPositions); },
       shape},
      {"two positions swapped",
       [](OtfRun& r) {
         const auto i = static_cast<std::size_t>(some(r));
         std::swap(r.path_m[i], r.path_m[i + 3]);
       },
       {}},
      {"beam breaks of 0.3 s, one in 10 s", [](OtfRun& r) { r.breaks_per_s = 0.1; }, {}},
      {"beam breaks of 4 s, one in 60 s",
       [](OtfRun& r) { r.breaks_per_s = 1.0 / 60.0, r.break_s = 4.0; },
       {}},
      {"drift of 16 um",
       [](OtfRun& r) {
         const Vector3 by = 16e-6 * direction(r.random);
         r.moved = [by](double time) {
           return calib::RigidTransform{calib::Matrix3::Identity(), time * by};
         };
       },
       {{"drift", "moved"}}},
      {"vibration of 5 um at 30 Hz", [](OtfRun& r) { r.vibration_m = 5e-6; }, {}},
      {"vibration of 20 um at 3 Hz",
       [](OtfRun& r) { r.vibration_m = 20e-6, r.vibration_hz = 3.0; },
       {}},
      {"one position off by 0.2 mm",
       [](OtfRun& r) {
         const auto i = static_cast<std::size_t>(some(r));
         r.driven_m[i] += 0.2e-3 * direction(r.random);
       },
       {{"leg"}}},
      {"path in inches",
       [](OtfRun& r) {
         for (Vector3& q : r.path_m) q /= 25.4;
       },
       shape},
  };
  faults.insert(faults.end(), of_standstills.begin(), of_standstills.end());
  return faults;
}

}  // namespace abbe::tests::never_worse
