#include "otf_run.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/sim/random_truth.hpp"
#include "model_against_truth.hpp"
#include "otf_reference.hpp"
#include "random_numbers.hpp"

namespace abbe::tests::never_worse {
namespace {

constexpr double kNode_m = 0.05;

/// The reference path, scaled to the travels of this machine.
std::vector<Vector3> stretched_path(const sim::TruthMachine& truth) {
  std::vector<Vector3> path = otf::case_a_path().vertices_m;
  Vector3 low = path.front(), high = path.front();
  for (const Vector3& q : path) {
    low = low.cwiseMin(q);
    high = high.cwiseMax(q);
  }

  for (Vector3& q : path) {
    for (const sim::Axis a : sim::kAxes) {
      const auto k = static_cast<Eigen::Index>(a);
      const auto& range = truth.axis(a).range;
      q(k) = range.min_m + (q(k) - low(k)) / (high(k) - low(k)) * (range.max_m - range.min_m);
    }
  }

  return path;
}

const std::array<const char*, 6> kPathChains{"[w X' b Y Z (C1) t]", "[w Y' b X Z t]",
                                             "[w X' Y' b Z t]",     "[w b Z Y X t]",
                                             "[w Z' b X Y t]",      "[w Y' b Z X t]"};

void make_machine(OtfRun& run, double spacing_m) {
  for (const sim::Axis a : sim::kAxes) {
    const auto& range = run.truth.axis(a).range;
    auto nodes = calib::equidistant_nodes(range.min_m, range.max_m, spacing_m);
    // The true errors are zero at this position, as datum G1 requires; so the intervals of the
    // model, which is in datum G1, can be compared with the truth.
    nodes->reference_m = range.reference_m;
    run.machine.nodes[static_cast<std::size_t>(a)] = *std::move(nodes);
  }
}

/// Range and two angles of unit variance, correlated over `correlation_s` (0: white).
class ReadingNoise {
 public:
  explicit ReadingNoise(double correlation_s) : correlation_s_(correlation_s) {}

  void start(std::mt19937_64& random) { value_ = fresh(random); }
  const Vector3& next(std::mt19937_64& random, double dt) {
    const double keep = correlation_s_ > 0.0 ? std::exp(-dt / correlation_s_) : 0.0;
    value_ = keep * value_ + std::sqrt(1.0 - keep * keep) * fresh(random);
    return value_;
  }

 private:
  static Vector3 fresh(std::mt19937_64& random) {
    return {normal(random), normal(random), normal(random)};
  }

  double correlation_s_;
  Vector3 value_ = Vector3::Zero();
};

Vector3 with_noise(const Vector3& p, const Vector3& noise, double range_m, double angle_rad) {
  const Vector3 er = p.normalized();
  const Vector3 e1 = er.unitOrthogonal(), e2 = er.cross(e1);
  return p + range_m * noise.x() * er + angle_rad * p.norm() * (noise.y() * e1 + noise.z() * e2);
}

/// V at the reference position due to squareness alone, which datum G2 sets to zero.
Vector3 of_squareness_at_reference(const sim::TruthMachine& truth) {
  const double y_m = truth.axes[1].range.reference_m, z_m = truth.axes[2].range.reference_m;
  const sim::Squareness& s = truth.squareness;
  return {-s.C0Y_rad * y_m + s.B0Z_rad * z_m, -s.A0Z_rad * z_m, 0.0};
}

void compare(Outcome& outcome, const OtfRun& run, const calib::VolumetricModel& model) {
  const Vector3 constant_m = of_squareness_at_reference(run.truth);
  Vector3 low_m, high_m;
  for (std::size_t k = 0; k < 3; ++k) {
    low_m(static_cast<Eigen::Index>(k)) = run.truth.axes[k].range.min_m;
    high_m(static_cast<Eigen::Index>(k)) = run.truth.axes[k].range.max_m;
  }
  compare_with_truth(outcome, model, {low_m, high_m}, run.truth.target_offset_m,
                     [&](const Vector3& q) { return Vector3(true_error_m(run, q) - constant_m); });
}

/// At random places of the travels.
void compare_with_U(Outcome& outcome, const OtfRun& run, const calib::VolumetricModel& model) {
  constexpr int kPlaces = 500;
  std::mt19937_64 random(kPlaces);
  std::vector<Vector3> points, difference;
  std::vector<double> U_m;
  for (int i = 0; i < kPlaces; ++i) {
    Vector3 q;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& range = run.truth.axes[k].range;
      q(static_cast<Eigen::Index>(k)) = uniform(random, range.min_m, range.max_m);
    }
    const calib::VolumetricError e = model.error_at(q, run.machine.target_offset_m);
    points.push_back(q + run.truth.target_offset_m);
    difference.push_back(e.V_m - true_error_m(run, q));
    U_m.push_back(2.0 * std::sqrt(std::max(0.0, e.cov_V_m2.trace())));
    outcome.misfit_m +=
        std::sqrt(model.misfit_cov_V_m2(q, run.machine.target_offset_m).trace()) / kPlaces;
  }
  const auto motion = calib::rigid_free(points, difference);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3 left_m = difference[i] - motion->rigid.head<3>() -
                           calib::rotation_effect(points[i]) * motion->rigid.tail<3>();
    ++outcome.places;
    outcome.below_U += left_m.norm() <= U_m[i] ? 1 : 0;
  }
}

calib::RigidTransform about(const Vector3& centre, const Vector3& rotation_rad,
                            const Vector3& shift_m) {
  calib::RigidTransform T;
  const double angle = rotation_rad.norm();
  T.R = angle > 0.0 ? Eigen::AngleAxisd(angle, rotation_rad / angle).toRotationMatrix()
                    : calib::Matrix3::Identity();
  T.t_m = centre - T.R * centre + shift_m;
  return T;
}

/// From the fraction `share` of the run on, the tracker is rotated about its own position and
/// shifted.
void move_tracker(OtfRun& run, double share, double angle_rad, double shift_m) {
  const auto T = about(run.T_machine_tracker.t_m, angle_rad * direction(run.random),
                       shift_m * direction(run.random));
  run.moved = [T, share](double time) { return time > share ? T : calib::RigidTransform{}; };
}

/// Reverses signs in the path file.
void turn_path(OtfRun& run, const Vector3& signs) {
  for (Vector3& q : run.path_m) q = signs.cwiseProduct(q);
}

void displace_vertex(OtfRun& run, double by_m) {
  const std::size_t i = 3 + run.random() % (run.path_m.size() - 6);
  Vector3 by = by_m * direction(run.random);
  // The vertex is moved towards the middle of the travel, so that it stays inside and the path is
  // not refused.
  for (const sim::Axis a : sim::kAxes) {
    const auto& range = run.truth.axis(a).range;
    const auto k = static_cast<Eigen::Index>(a);
    by(k) = std::copysign(by(k), 0.5 * (range.min_m + range.max_m) - run.path_m[i](k));
  }
  run.path_m[i] += by;
}

}  // namespace

void set_up_again(OtfRun& run) {
  std::mt19937_64& random = run.random;
  const double azimuth = uniform(random, -M_PI, M_PI), away_m = uniform(random, 1.0, 2.5);
  run.T_machine_tracker.t_m =
      Vector3(away_m * std::cos(azimuth), away_m * std::sin(azimuth), uniform(random, -0.5, 0.3));
  run.T_machine_tracker.R = (Eigen::AngleAxisd(uniform(random, -M_PI, M_PI), Vector3::UnitZ()) *
                             Eigen::AngleAxisd(uniform(random, -0.1, 0.1), Vector3::UnitX()))
                                .toRotationMatrix();
  run.evidence.up = Vector3::UnitZ();
  run.evidence.tracker_m = run.T_machine_tracker.t_m + 0.15 * direction(random);

  // The true errors of ranges and scales are drawn with the uncertainties stated in `noise`.
  run.noise.u_scale = 0.45e-6;  // 0.3 ppm of the instrument, 0.33 ppm of the air
  run.range_scale = 1.0 + 0.45e-6 * normal(random);
  run.noise.u_range_offset_m = 6e-6;
  run.range_offset_m = 6e-6 * normal(random);

  for (Eigen::Index a = 0; a < 3; ++a) {
    run.noise.u_axis_scale[static_cast<std::size_t>(a)] = 2.3e-6;  // 0.2 K of steel
    run.scale(a) = 1.0 + 2.3e-6 * normal(random);
  }
}

OtfRun random_otf_run(std::uint64_t seed, double least_cells, double most_cells) {
  OtfRun run;
  run.random.seed(seed);
  std::mt19937_64& random = run.random;
  const std::string chain = kPathChains[random() % kPathChains.size()];
  run.truth.order = *sim::parse_chain(chain);
  run.machine.chain = *calib::KinematicChain::parse(chain);

  for (sim::AxisTruth& axis : run.truth.axes) {
    const double half_m = kNode_m * std::round(uniform(random, least_cells, most_cells));
    const double centre_m = kNode_m * std::round(uniform(random, -4.0, 4.0));
    axis.range = {centre_m - half_m, centre_m + half_m, centre_m};
  }

  run.truth.target_offset_m = Vector3(uniform(random, -0.05, 0.05), uniform(random, -0.05, 0.05),
                                      uniform(random, -0.2, -0.05));
  run.machine.target_offset_m = run.truth.target_offset_m;
  const double mean_error_m = 10e-6 * std::pow(20.0, uniform(random, 0.0, 1.0));
  run.truth = sim::random_truth(run.truth, {.seed = random(), .mean_error_m = mean_error_m});
  make_machine(run, kNode_m);
  run.path_m = run.driven_m = stretched_path(run.truth);
  set_up_again(run);

  return run;
}

std::vector<Fault<OtfRun>> otf_faults() {
  const Names moved{{"moved"}}, vertex{{"vertex"}}, chain{{"chain-order"}}, nodes{{"node-spacing"}},
      drift{{"drift", "moved"}}, backlash{{"backlash"}}, noise{{"correlated-noise", "uncertainty"}},
      align{{"orientation"}, {"alignment", "path", "travel", "adjustment"}},
      turned{{"orientation"}, {"orientation", "travel"}};

  return {
      {"none", [](OtfRun&) {}, {}},
      {"tracker turned by 200 urad at half", [](OtfRun& r) { move_tracker(r, 0.5, 200e-6, 0.0); },
       moved},
      {"tracker turned by 20 urad at 0.7", [](OtfRun& r) { move_tracker(r, 0.7, 20e-6, 0.0); },
       moved},
      {"tracker shifted by 50 um at 0.6", [](OtfRun& r) { move_tracker(r, 0.6, 0.0, 50e-6); },
       moved},
      {"tracker shifted by 10 um at 0.3", [](OtfRun& r) { move_tracker(r, 0.3, 0.0, 10e-6); },
       moved},
      {"vertex off by 0.4 mm", [](OtfRun& r) { displace_vertex(r, 0.4e-3); }, vertex},
      {"vertex off by 0.05 mm", [](OtfRun& r) { displace_vertex(r, 0.05e-3); }, vertex},
      {"another axis order",
       [](OtfRun& r) {
         std::string other;
         do {
           other = kPathChains[r.random() % kPathChains.size()];
         } while (calib::KinematicChain::parse(other)->order_w_to_t() ==
                  r.machine.chain.order_w_to_t());
         r.machine.chain = *calib::KinematicChain::parse(other);
       },
       chain},
      {"nodes 250 mm apart", [](OtfRun& r) { make_machine(r, 0.25); }, nodes},
      {"drift of 15 um",
       [](OtfRun& r) {
         const Vector3 by = 15e-6 * direction(r.random);
         r.moved = [by](double time) {
           return calib::RigidTransform{calib::Matrix3::Identity(), time * by};
         };
       },
       drift},
      {"expansion by 20 um/m",
       [](OtfRun& r) {
         r.truth.thermal = {.expansion_per_m = Vector3::Constant(20e-6),
                            .shift_m = Vector3::Zero(),
                            .time_constant_s = 900.0};
       },
       drift},
      {"backlash of 20 um",
       [](OtfRun& r) {
         for (sim::AxisTruth& axis : r.truth.axes) axis.backlash = {20e-6, 20e-6, 20e-6, 0, 0, 0};
       },
       backlash},
      {"backlash of 4 um in one axis",
       [](OtfRun& r) { r.truth.axes[r.random() % 3].backlash = {4e-6, 4e-6, 4e-6, 0, 0, 0}; },
       backlash},
      {"noise correlated over 1 s", [](OtfRun& r) { r.correlation_s = 1.0; }, noise},
      {"noise of 10 um over 1 s",
       [](OtfRun& r) { r.correlation_s = 1.0, r.sigma_range_m = 1e-6, r.sigma_angle_rad = 8e-6; },
       noise},
      {"noise of 8 um over 20 s",
       [](OtfRun& r) { r.correlation_s = 20.0, r.sigma_range_m = 1e-6, r.sigma_angle_rad = 6e-6; },
       noise},
      {"five times the noise", [](OtfRun& r) { r.sigma_range_m *= 5.0, r.sigma_angle_rad *= 5.0; },
       noise},
      {"one of 1000 samples off by 0.2 mm", [](OtfRun& r) { r.spikes = 1e-3; }, {}},
      {"one of 20 samples off by 0.2 mm", [](OtfRun& r) { r.spikes = 0.05; }, {}},
      {"outliers of 0.2 mm and six beam breaks",
       [](OtfRun& r) {
         r.spikes = 0.01;
         r.disturb = [](auto& samples, auto& random) {
           otf::add_breaks(samples, 6, 0.3, 3.0, random);
         };
       },
       {}},
      {"50 clusters of 0.2 mm over 50 ms",
       [](OtfRun& r) {
         r.disturb = [](auto& samples, auto& random) {
           otf::add_clusters(samples, 50, 0.05, 0.2e-3, random);
         };
       },
       {}},
      {"20 clusters of 0.2 mm over 0.5 s",
       [](OtfRun& r) {
         r.disturb = [](auto& samples, auto& random) {
           otf::add_clusters(samples, 20, 0.5, 0.2e-3, random);
         };
       },
       {}},
      {"another reflector for 5 s",
       [](OtfRun& r) {
         r.disturb = [](auto& samples, auto& random) {
           otf::add_other_target(samples, 5.0, 0.0, 0.3, random);
         };
       },
       {}},
      {"another reflector within reach of a break",
       [](OtfRun& r) {
         r.disturb = [](auto& samples, auto& random) {
           otf::add_other_target(samples, 5.0, 1.0, 0.1, random);
         };
       },
       {{}, {"alignment"}}},
      {"ranges change by 20 um at a break",
       [](OtfRun& r) {
         r.disturb = [](auto& samples, auto& random) {
           otf::add_range_step(samples, 1.0, 20e-6, random);
         };
       },
       {{"range-step", "moved"}}},
      {"beam lost for 5 %", [](OtfRun& r) { r.lost_from = 0.4, r.lost_to = 0.45; }, align},
      {"last third missing",
       [](OtfRun& r) { r.lost_from = 0.66, r.lost_to = 1.1; },
       {{}, {"alignment", "tracker", "standstill", "samples"}}},
      {"path mirrored",
       [](OtfRun& r) {
         for (Vector3& q : r.path_m) q.x() = -q.x();
         make_machine(r, kNode_m);
       },
       align},
      {"path turned by 180 degrees about X", [](OtfRun& r) { turn_path(r, Vector3(1, -1, -1)); },
       turned},
      {"path turned by 180 degrees about Y", [](OtfRun& r) { turn_path(r, Vector3(-1, 1, -1)); },
       turned},
      {"path turned by 180 degrees about Z", [](OtfRun& r) { turn_path(r, Vector3(-1, -1, 1)); },
       turned},
      {"two vertices swapped", [](OtfRun& r) { std::swap(r.path_m[10], r.path_m[13]); }, align},
      {"travel entered a fifth too small",
       [](OtfRun& r) {
         for (std::size_t a = 0; a < 3; ++a) {
           const auto& range = r.truth.axes[a].range;
           r.machine.nodes[a] =
               *calib::equidistant_nodes(0.8 * range.min_m, 0.8 * range.max_m, kNode_m);
         }
       },
       {{}, {"travel"}}},
      {"range offset of twice its stated uncertainty",
       [](OtfRun& r) { r.range_offset_m = 12e-6; },
       {}},
      {"range offset of 50 um", [](OtfRun& r) { r.range_offset_m = 50e-6; }, {{"range-offset"}}},
      {"ranges wrong by 100 ppm", [](OtfRun& r) { r.range_scale *= 1.0001; }, {}, false},
      {"path wrong by 0.1 %",
       [](OtfRun& r) {
         for (Vector3& q : r.path_m) q *= 0.999;
       },
       {{"growth"}},
       false},
  };
}

Vector3 true_error_m(const OtfRun& run, const Vector3& q_m) {
  const Vector3 V_m = sim::error_m(run.truth, q_m, {{}, 0.5 * run.truth.thermal.heat_after(900.0)});
  return run.more_error_m ? Vector3(V_m + run.more_error_m(q_m)) : V_m;
}

std::vector<calib::otf::TrackerObservation> measure(OtfRun& run) {
  sim::PathPlan plan{.feed_m_per_s = run.feed_m_per_s, .dwell_s = run.dwell_s};
  for (const Vector3& q : run.driven_m) {
    plan.vertices.push_back({q, 0.0});
  }

  const sim::PathMotion motion = *sim::PathMotion::plan(plan);
  const double stand_s = std::max(0.4, run.dwell_s);
  const double dt = 1.0 / run.rate_hz, end_s = motion.duration_s() + stand_s;
  std::vector<calib::otf::TrackerObservation> samples;
  ReadingNoise noise(run.correlation_s), slow(run.slow_s);
  noise.start(run.random);
  const bool has_slow = run.slow_range_m > 0.0 || run.slow_angle_rad > 0.0;
  if (has_slow) {
    slow.start(run.random);
  }
  const calib::Matrix3 R = run.T_machine_tracker.R.transpose();
  const Vector3 shaken_m = run.vibration_m > 0.0 ? Vector3(run.vibration_m * direction(run.random))
                                                 : Vector3(Vector3::Zero());
  double lost_until_s = -stand_s;

  for (double t = -stand_s; t < end_s; t += dt) {
    const double share = std::clamp(t / motion.duration_s(), 0.0, 1.0);
    const sim::AxisMotion m = motion.at(t);
    const sim::MachineCondition condition{m.direction, run.truth.thermal.heat_after(t)};
    Vector3 p = sim::position_m(run.truth, m.q_m, condition) +
                (run.scale - Vector3::Ones()).cwiseProduct(m.q_m);

    if (run.more_error_m) {
      p += run.more_error_m(m.q_m);
    }
    p += std::sin(2.0 * M_PI * run.vibration_hz * t) * shaken_m;
    if (run.moved) {
      p = run.moved(share) * p;
    }

    Vector3 seen = R * (p - run.T_machine_tracker.t_m);
    seen = with_noise(seen, noise.next(run.random, dt), run.sigma_range_m, run.sigma_angle_rad);
    if (has_slow) {
      seen = with_noise(seen, slow.next(run.random, dt), run.slow_range_m, run.slow_angle_rad);
    }
    seen *= run.range_scale + run.range_offset_m / seen.norm();

    if (run.spikes > 0.0 && uniform(run.random, 0.0, 1.0) < run.spikes) {
      seen += 2e-4 * Vector3(normal(run.random), normal(run.random), normal(run.random));
    }

    if (run.breaks_per_s > 0.0 && uniform(run.random, 0.0, 1.0) < run.breaks_per_s * dt) {
      lost_until_s = t + run.break_s;
    }
    const bool lost = t < lost_until_s || (share > run.lost_from && share < run.lost_to);
    samples.push_back({t + stand_s, seen, !lost});
  }

  if (run.disturb) {
    run.disturb(samples, run.random);
  }
  return samples;
}

void move_table(OtfRun& run, const std::string& table, double by) {
  if (table == "EC0Y") {
    run.truth.squareness.C0Y_rad += by;
    return;
  }
  const calib::ErrorMotion e = *calib::error_motion(table);
  sim::AxisTruth& axis = run.truth.axes[calib::index(e.axis)];
  sim::ErrorFunction& error = axis.error[static_cast<std::size_t>(e.motion)];
  std::vector<double> values(error.values().begin(), error.values().end());
  const double half_m = 0.5 * (axis.range.max_m - axis.range.min_m);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double way = (error.nodes_m()[i] - axis.range.reference_m) / half_m;
    values[i] += by * (calib::is_straightness(e) ? 1.0 - way * way : way);
  }
  error = error.with_values(std::move(values));
}

Outcome identify_and_compare(OtfRun run) {
  const auto samples = measure(run);
  const calib::otf::Path path{run.path_m};
  if (const auto checked = calib::otf::check(path, run.machine.nodes); !checked) {
    return refused(checked.error().text);
  }

  calib::otf::Options options;
  options.estimator = run.estimator;
  options.segment_samples = calib::otf::suitable_segment_samples(samples);
  options.orientation = run.evidence;
  options.mode = run.mode;
  options.standstill.u_repeatability_m = run.u_repeatability_m;
  const auto found = calib::otf::identify(samples, run.machine, path, run.noise, options);

  if (!found) {
    return refused(found.error().text);
  }

  const auto verdict =
      calib::otf::judge(found->observations, found->solution, nullptr, {}, options);
  if (!verdict) {
    return refused(verdict.error().text);
  }

  Outcome outcome;
  outcome.accepted = verdict->accepted;
  outcome.first_reason = verdict->accepted ? "" : verdict->reasons.front();
  outcome.first_cause = verdict->accepted ? "" : verdict->causes.front();
  outcome.sigma0 = found->solution.statistics.sigma0;
  compare(outcome, run, found->solution.model);
  compare_with_U(outcome, run, found->solution.model);

  return outcome;
}

}  // namespace abbe::tests::never_worse
