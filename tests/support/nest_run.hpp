#pragma once
/// A MadeRun with drift of the tracker, and visits of reference nests while the machine stands at a
/// vertex.

#include <cmath>
#include <cstddef>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace abbe::tests::otf {

struct NestRunOptions {
  unsigned seed = 1;                       ///< of machine, noise and nests
  Vector3 drift_m = Vector3::Zero();       ///< at the end of the run, tracker frame
  Vector3 rotation_rad = Vector3::Zero();  ///< the same, about the tracker
  double time_constant_s = 600.0;          ///< of its exponential course
  /// Share of the drift by time, instead of the exponential course.
  std::function<double(double time_s)> course{};
  bool visits = true;
  double every_s = 180.0;
  double stay_s = 4.0;     ///< at each nest
  double u_nest_m = 3e-6;  ///< true repeatability of a visit
  /// Positions of the nests, machine coordinates.
  std::vector<Vector3> nests_m{{-0.7, -0.45, -0.5}, {0.7, -0.45, -0.1}, {0.5, 0.6, -0.5}};
  /// Additional motion of a nest at one of its visits (counted from 0).
  std::function<Vector3(std::size_t nest, std::size_t visit)> moved{};
};

/// What the drift adds to the measured position of a point.
inline Vector3 drift_at(const NestRunOptions& wanted, double time_s, const Vector3& p_tracker_m) {
  constexpr double kRun_s = 1000.0;
  const Vector3 at_end_m = wanted.drift_m + wanted.rotation_rad.cross(p_tracker_m);
  if (wanted.course) {
    return wanted.course(time_s) * at_end_m;
  }
  const double share = (1.0 - std::exp(-time_s / wanted.time_constant_s)) /
                       (1.0 - std::exp(-kRun_s / wanted.time_constant_s));
  return share * at_end_m;
}

/// The visits of nests in a stream.
class NestVisitor {
 public:
  NestVisitor(const NestRunOptions& wanted, const calib::otf::Noise& noise,
              const calib::RigidTransform& T_machine_tracker, double period_s)
      : wanted_(wanted),
        noise_(noise),
        T_machine_tracker_(T_machine_tracker),
        period_s_(period_s),
        random_(1000 + wanted.seed) {}

  /// Appends the samples of a visit of all nests. Returns the time at which the tracker is back on
  /// the target of the machine.
  double visit_all(double time_s, std::vector<calib::otf::TrackerObservation>& samples) {
    constexpr double kSlew_s = 1.0;
    const auto count = static_cast<int>(wanted_.stay_s / period_s_);
    for (std::size_t nest = 0; nest < wanted_.nests_m.size(); ++nest) {
      time_s += kSlew_s;
      const Vector3 p = position_m(nest);
      for (int i = 0; i < count; ++i, time_s += period_s_) {
        const Vector3 seen = p + drift_at(wanted_, time_s, p);
        samples.push_back({time_s, with_noise(seen, noise_, 1.0, random_), true});
      }
    }
    ++visits_;
    return time_s + kSlew_s;
  }

 private:
  Vector3 position_m(std::size_t nest) {
    std::normal_distribution<double> normal(0.0, wanted_.u_nest_m);
    Vector3 p = T_machine_tracker_.R.transpose() * (wanted_.nests_m[nest] - T_machine_tracker_.t_m);
    for (Eigen::Index k = 0; k < 3; ++k) {
      p(k) += normal(random_);
    }
    return wanted_.moved ? Vector3(p + wanted_.moved(nest, visits_)) : p;
  }

  const NestRunOptions& wanted_;
  const calib::otf::Noise& noise_;
  const calib::RigidTransform& T_machine_tracker_;
  double period_s_;
  std::mt19937_64 random_;
  std::size_t visits_ = 0;
};

/// A stream with drift and, where the target stands, visits of the nests.
inline std::vector<calib::otf::TrackerObservation> with_drift_and_visits(
    const std::vector<calib::otf::TrackerObservation>& driven, const NestRunOptions& wanted,
    const calib::otf::Noise& noise, const calib::RigidTransform& T_machine_tracker) {
  constexpr std::size_t kAround = 10;
  constexpr double kStands_m = 0.1e-3;
  const double period_s = driven[1].time_s - driven[0].time_s;
  NestVisitor visitor(wanted, noise, T_machine_tracker, period_s);
  std::vector<calib::otf::TrackerObservation> all;
  double later_s = 0.0, next_s = 0.0;

  for (std::size_t i = 0; i < driven.size(); ++i) {
    const bool stands =
        i >= kAround && i + kAround < driven.size() &&
        (driven[i + kAround].p_tracker_m - driven[i - kAround].p_tracker_m).norm() < kStands_m;
    if (const double time_s = driven[i].time_s + later_s;
        wanted.visits && stands && time_s >= next_s) {
      next_s = time_s + wanted.every_s;
      later_s += visitor.visit_all(time_s, all) - time_s;
    }
    const Vector3& p = driven[i].p_tracker_m;
    const double time_s = driven[i].time_s + later_s;
    all.push_back({time_s, p + drift_at(wanted, time_s, p), driven[i].valid});
  }
  return all;
}

/// The nests as they are configured: 2.4 mm from where they are.
inline calib::otf::NestOptions nest_options(const NestRunOptions& wanted,
                                            const calib::RigidTransform& T_machine_tracker) {
  calib::otf::NestOptions options;
  for (std::size_t n = 0; wanted.visits && n < wanted.nests_m.size(); ++n) {
    const Vector3 p = T_machine_tracker.R.transpose() * (wanted.nests_m[n] - T_machine_tracker.t_m);
    options.nests.push_back({.name = std::string(1, static_cast<char>('A' + n)),
                             .position_tracker_m = p + Vector3(1e-3, -2e-3, 1e-3)});
  }
  return options;
}

/// A run of about 1000 s. Machine and noise along the path are those of the same seed without drift
/// and visits.
inline MadeRun make_nest_run(const NestRunOptions& wanted) {
  MadeRun run = make_run({.seed = wanted.seed,
                          .noise_seed = wanted.seed,
                          .error_scale_m = 10e-6,
                          .in_datum = true,
                          .speed_m_s = 0.04,
                          .rate_hz = 25.0});
  run.samples = with_drift_and_visits(run.samples, wanted, run.noise, run.T_machine_tracker);
  run.options.nests = nest_options(wanted, run.T_machine_tracker);
  return run;
}

inline calib::Result<calib::otf::Identification> identify_nest_run(const MadeRun& run) {
  return calib::otf::identify(run.samples, run.machine, run.path, run.noise, run.options);
}

/// Mean error of a model on the grid of the nodes, rigid motion removed.
inline double nest_error_m(const MadeRun& run, const calib::VolumetricModel& model) {
  std::vector<Vector3> points = calib::tensor_grid(run.machine.nodes);
  return calib::rigid_free(points, errors_left(run, model))->rigid_free.mean_m;
}

}  // namespace abbe::tests::otf
