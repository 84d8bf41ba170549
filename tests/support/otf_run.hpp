#pragma once
/// A small synthetic run of on-the-fly calibration: a machine with random tables, a path, a
/// tracker, samples. Deterministic from its seed. Constant speed on every leg, a stop at every
/// vertex.

#include <array>
#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/calib/otf/run/path_frame.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/calib/otf/run/run.hpp"
#include "otf_reference.hpp"

namespace abbe::tests::otf {

struct MadeRun {
  calib::otf::Machine machine;
  calib::otf::Path path;
  calib::otf::Noise noise;
  calib::otf::Options options;
  calib::RigidTransform T_machine_tracker;
  Eigen::VectorXd truth;  ///< model_size() parameters of the 14 tables and squareness
  std::vector<calib::otf::TrackerObservation> samples;
};

struct MadeRunOptions {
  unsigned seed = 1;          ///< of the machine
  unsigned noise_seed = 1;    ///< of the tracker's noise: same machine, another run
  double noise_factor = 1.0;  ///< of the default noise model; 0: exact
  double error_scale_m = 30e-6;
  /// Tables of datum G1: no rotation r of their own, which would be r^2 / 2 of strain in a pose
  /// that is not linear.
  bool in_datum = false;
  double speed_m_s = 0.4;
  double rate_hz = 250.0;
  std::string chain = "[w X' b Y Z (C1) t]";
  calib::Interpolation interpolation = calib::Interpolation::Linear;
};

inline calib::otf::Machine coarse_machine(const std::string& chain) {
  calib::otf::Machine machine = case_a_machine();
  machine.chain = *calib::KinematicChain::parse(chain);
  machine.nodes = {*calib::equidistant_nodes(-0.3, 0.3, 0.2),
                   *calib::equidistant_nodes(-0.25, 0.25, 0.25),
                   *calib::equidistant_nodes(-0.4, 0.0, 0.2)};
  return machine;
}

/// The parameter layout of all machines in these tests.
inline calib::ParameterLayout layout_of(const calib::otf::Machine& machine) {
  return *calib::ParameterLayout::observable_with_one_target(machine.chain, machine.nodes);
}

inline Eigen::VectorXd random_tables(const calib::ParameterLayout& layout, double scale_m,
                                     std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd U(static_cast<Eigen::Index>(layout.model_size()));
  for (Eigen::Index i = 0; i < U.size(); ++i) {
    U(i) = scale_m * normal(random);
  }
  return U;
}

/// Axis positions of a motion along the path.
inline std::vector<Vector3> drive(const calib::otf::Path& path, double speed_m_s, double rate_hz) {
  std::vector<Vector3> q;
  const auto stand = [&](const Vector3& at) { q.insert(q.end(), 25, at); };
  stand(path.vertices_m.front());

  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    const Vector3 &from = path.vertices_m[i], &to = path.vertices_m[i + 1];
    const auto steps =
        static_cast<std::size_t>(std::ceil((to - from).norm() / speed_m_s * rate_hz));
    for (std::size_t k = 1; k <= steps; ++k) {
      q.emplace_back(from + (to - from) * (static_cast<double>(k) / static_cast<double>(steps)));
    }
    stand(to);
  }

  return q;
}

/// Standard deviation sigma_range along the beam, sigma_angle * range across it.
inline Vector3 with_noise(const Vector3& p, const calib::otf::Noise& noise, double factor,
                          std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double along = normal(random);
  const Vector3 any(normal(random), normal(random), normal(random));
  const Vector3 er = p.normalized();
  const Vector3 across = any - any.dot(er) * er;
  return p +
         factor * (noise.sigma_range_m * along * er + noise.sigma_angle_rad * p.norm() * across);
}

/// The samples of a drive along the path of the run.
inline void measure_run(MadeRun& run, const MadeRunOptions& wanted) {
  std::mt19937_64 noise(wanted.noise_seed);
  const calib::ParameterLayout layout = layout_of(run.machine);
  const Vector3& t = run.machine.target_offset_m;
  run.samples.clear();
  const auto basis =
      *calib::TableBasis::of(layout, calib::TableOptions::all_axes(wanted.interpolation));
  for (const Vector3& q : drive(run.path, wanted.speed_m_s, wanted.rate_hz)) {
    const Vector3 V =
        basis.V_m({.q_m = q, .tool_offset_m = t}, {run.truth.data(), layout.model_size()});
    const Vector3 p = run.T_machine_tracker.R.transpose() * (q + t + V - run.T_machine_tracker.t_m);
    run.samples.push_back({static_cast<double>(run.samples.size()) / wanted.rate_hz,
                           with_noise(p, run.noise, wanted.noise_factor, noise), true});
  }
}

inline MadeRun make_run(const MadeRunOptions& wanted) {
  std::mt19937_64 random(wanted.seed);
  MadeRun run;
  run.machine = coarse_machine(wanted.chain);
  run.path = case_a_path();
  run.machine.interpolation = wanted.interpolation;
  run.options.segment_samples = 10;  // 16 mm
  run.options.orientation.scales_agree = true;
  const calib::ParameterLayout layout = layout_of(run.machine);
  run.truth = random_tables(layout, wanted.error_scale_m, random);
  run.T_machine_tracker = case_a_alignment(true);
  const Vector3& t = run.machine.target_offset_m;
  if (wanted.in_datum) {
    Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.fit_size()));
    U.head(run.truth.size()) = run.truth;
    run.truth =
        calib::to_datum(calib::ModelDatum::G1, layout, std::array{t}, U)->head(run.truth.size());
  }

  measure_run(run, wanted);
  return run;
}

/// Every sample of a leg as two rows, with weights per sample; without the samples within 10 mm of
/// the ends.
inline void append_samples(calib::otf::Observations& o,
                           std::span<const calib::otf::TrackerObservation> samples,
                           const Vector3& from, const Vector3& to, const calib::RigidTransform& T,
                           const calib::otf::Noise& noise) {
  for (const calib::otf::TrackerObservation& sample : samples) {
    const Vector3 q = T * sample.p_tracker_m - o.target_offset_m;
    const calib::otf::LegPoint c = calib::otf::closest_on_leg(from, to, q);
    if (c.along_m >= 0.010 && (to - from).norm() - c.along_m >= 0.010) {
      const auto frame = calib::otf::path_frame(to - from, T.R * sample.p_tracker_m, noise);
      calib::otf::append_rows(o, {0, 0, q - c.closest_m, c.closest_m, frame, 1.0},
                              std::array{c.closest_m});
    }
  }
}

/// V of the truth minus V of a model on the grid of the nodes, rigid motion removed.
template <class Model>
std::vector<Vector3> errors_left(const MadeRun& run, const Model& model) {
  const calib::ParameterLayout layout = layout_of(run.machine);
  std::vector<Vector3> left;
  for (const double x : run.machine.nodes[0].nodes_m) {
    for (const double y : run.machine.nodes[1].nodes_m) {
      for (const double z : run.machine.nodes[2].nodes_m) {
        const Vector3 q(x, y, z);
        left.push_back(model.V_at(q, run.machine.target_offset_m) -
                       calib::volumetric_error(layout, {run.truth.data(), layout.model_size()}, q,
                                               run.machine.target_offset_m));
      }
    }
  }

  return left;
}

}  // namespace abbe::tests::otf
