#include "abbe/sim/mfb/live_probing.hpp"

#include "abbe/result/try.hpp"
#include "abbe/sim/noise.hpp"
#include "crossing.hpp"

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

constexpr double kStrayAway_m = 40e-3;  // larger than every tolerance

/// One approach: a leg of the path, and the reading at which the probe triggers on it.
struct Approach {
  std::size_t leg = 0;
  Vector3d reading_m = Vector3d::Zero();
  Vector3d normal = Vector3d::UnitZ();
  bool triggers = true;
};

/// Builds the path and the list of its approaches.
class Programmer {
 public:
  explicit Programmer(const LiveProbing& options) : options_(options) {
    path_.feed_m_per_s = options.travel_m_per_s;
    path_.acceleration_m_per_s2 = options.acceleration_m_per_s2;
    path_.dwell_s = 0.0;
    path_.vertices.push_back({});  // reading 0, at which the counters are set up
  }

  void touch(const Touch& touch) {
    const std::size_t number = touches_++;
    if (options_.stray.contains(number))
      approach(touch.reading_m + kStrayAway_m * touch.normal, touch.normal, true);
    const bool triggers = !options_.missed.contains(number);
    approach(touch.reading_m, touch.normal, triggers);
    if (options_.doubled.contains(number)) approach(touch.reading_m, touch.normal, triggers);
  }

  [[nodiscard]] const PathPlan& path() const { return path_; }
  [[nodiscard]] const std::vector<Approach>& approaches() const { return approaches_; }

 private:
  void approach(const Vector3d& reading_m, const Vector3d& normal, bool triggers) {
    const Vector3d before_m = reading_m + options_.approach_m * normal;
    drive_to(before_m);
    drive_to(reading_m - options_.beyond_m * normal, options_.probing_m_per_s);
    approaches_.push_back({path_.vertices.size() - 2, reading_m, normal, triggers});
    drive_to(before_m, options_.retract_m_per_s);
  }

  /// Adds a leg to `q_m`; no leg if the machine is already there.
  void drive_to(const Vector3d& q_m, double feed_m_per_s = 0.0) {
    if (path_.vertices.back().q_m != q_m) path_.vertices.push_back({q_m, feed_m_per_s});
  }

  const LiveProbing& options_;
  PathPlan path_;
  std::vector<Approach> approaches_;
  std::size_t touches_ = 0;
};

double contact_s(const Approach& approach, const PathMotion& motion) {
  return crossing(motion.leg_begin_s(approach.leg), motion.leg_end_s(approach.leg), [&](double t) {
    return (motion.at(t).q_m - approach.reading_m).dot(approach.normal) <= 0.0;
  });
}

}  // namespace

Result<LiveProgram> live_program(const ProbedBar& probed, const LiveProbing& options) {
  Programmer programmer(options);
  for (const Touch& touch : probed.touches) programmer.touch(touch);
  const auto motion = PathMotion::plan(programmer.path());
  ABBE_TRY(motion);

  LiveProgram program{programmer.path(), {}};
  const std::vector<Approach>& approaches = programmer.approaches();
  for (std::size_t i = 0; i < approaches.size(); ++i) {
    if (!approaches[i].triggers) continue;
    const double late_s = options.jitter_s * gaussian(options.seed, NoiseStream::Probe, i);
    program.edges_s.push_back(contact_s(approaches[i], *motion) + options.delay_s + late_s);
  }
  return program;
}

}  // namespace abbe::sim::mfb
