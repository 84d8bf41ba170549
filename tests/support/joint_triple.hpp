#pragma once
/// An on-the-fly run, a ball array and a Multi-Feature Bar of one simulated machine, as parts of a
/// joint identification. Axes of 0 to 550 mm, 18 random tables with nodes every 110 mm, white noise
/// of the tracker, 1 um of the ball centres, the bar as in [Viprey 2016]. Deterministic from the
/// seed.

#include <utility>

#include "joint_parts.hpp"
#include "mfb_simulation.hpp"

namespace abbe::tests::joint {

inline constexpr double kTripleTravel_m = 0.55, kTripleNodes_m = 0.11;

/// The machine, and its on-the-fly run.
struct TripleMachine {
  unsigned seed = 1;
  calib::TableBasis all;  ///< 18 tables
  Eigen::VectorXd truth;  ///< of these
  otf::MadeRun run;

  [[nodiscard]] Field field() const {
    return [this](const Vector3& q_m, const Vector3& tool_m) {
      return all.V_m({.q_m = q_m, .tool_offset_m = tool_m}, {truth.data(), all.size()});
    };
  }
};

/// The path of the reference case, on other axes.
inline calib::otf::Path scaled_path() {
  calib::otf::Path path = otf::case_a_path();
  const calib::otf::Machine given = otf::case_a_machine();
  for (Vector3& q_m : path.vertices_m) {
    for (std::size_t a = 0; a < 3; ++a) {
      const std::vector<double>& nodes_m = given.nodes[a].nodes_m;
      double& of_axis = q_m(static_cast<Eigen::Index>(a));
      of_axis = kTripleTravel_m * (of_axis - nodes_m.front()) / (nodes_m.back() - nodes_m.front());
    }
  }
  return path;
}

inline TripleMachine triple_machine(unsigned seed) {
  constexpr double kSpeed_m_s = 0.4, kRate_hz = 250.0, kErrors_m = 20e-6;
  std::mt19937_64 random(seed);
  otf::MadeRun run;
  run.machine = otf::coarse_machine("[w X' b Y Z (C1) t]");
  const auto nodes = *calib::equidistant_nodes(0.0, kTripleTravel_m, kTripleNodes_m);
  run.machine.nodes = {nodes, nodes, nodes};
  run.path = scaled_path();
  run.options.segment_samples = 10;
  run.options.orientation.scales_agree = true;
  run.T_machine_tracker = otf::case_a_alignment(true);

  const auto layout = *calib::ParameterLayout::all_tables(run.machine.chain, run.machine.nodes);
  TripleMachine made{seed, *calib::TableBasis::of(layout),
                     otf::random_tables(layout, kErrors_m, random), std::move(run)};
  const Field V_m = made.field();
  const Vector3& t = made.run.machine.target_offset_m;
  const calib::RigidTransform& T = made.run.T_machine_tracker;
  for (const Vector3& q : otf::drive(made.run.path, kSpeed_m_s, kRate_hz)) {
    const Vector3 p = T.R.transpose() * (q + t + V_m(q, t) - T.t_m);
    made.run.samples.push_back({static_cast<double>(made.run.samples.size()) / kRate_hz,
                                otf::with_noise(p, made.run.noise, 1.0, random), true});
  }
  return made;
}

/// The array in the middle of the volume.
inline calib::evemu::Observations triple_array(const TripleMachine& m, double length_error) {
  const Vector3 shift_m(0.27, 0.29, 0.47);  // observed_array() places Ball1 at (10, -20, -200) mm
  const Field V_m = m.field();
  auto o = observed_array(
      m.run, [&](const Vector3& q, const Vector3& tool) { return V_m(q + shift_m, tool); },
      {.seed = m.seed, .length_error = length_error, .tool_m = Vector3(0.0, 0.0, -0.15)});
  for (auto& row : o.rows) {
    row.reading_m += shift_m;
  }
  for (auto& seen : o.seen) {
    seen.T_self_uni.t_m += shift_m;
    for (auto& ball : seen.balls) {
      ball.centre += shift_m;
    }
    for (Vector3& ideal_m : seen.ideal_m) {
      ideal_m += shift_m;
    }
  }
  o.ball1_m += shift_m;
  return o;
}

/// The bar in all positions of a plan.
inline mfb::ProbedBar probed_bar(const TripleMachine& m, const calib::mfb::Plan& plan) {
  const Field V_m = m.field();
  std::mt19937_64 random(m.seed);
  return mfb::probe(
      [&](const Vector3& p_m, const Vector3& tool_m) {
        Vector3 q_m = p_m - tool_m;
        for (int i = 0; i < 5; ++i) {
          q_m = p_m - tool_m - V_m(q_m, tool_m);
        }
        return q_m;
      },
      plan, random);
}

inline calib::mfb::Observations triple_bar(const TripleMachine& m,
                                           const calib::joint::CommonTables& common,
                                           const calib::mfb::Plan& plan) {
  const mfb::ProbedBar probed = probed_bar(m, plan);
  return *calib::mfb::observe(probed.bar, plan, probed.touches, calib::joint::bar_machine(common));
}

struct Triple {
  calib::joint::CommonTables common;
  std::vector<calib::joint::Part> parts;  ///< run, array, bar
};

inline Triple triple(const TripleMachine& m, const calib::mfb::Plan& plan,
                     double length_error_of_array = 0.0) {
  const calib::VolumetricModel of_run = model_of(m.run);
  Triple made{*calib::joint::tables_of(of_run), {}};
  made.parts.push_back(*calib::joint::part_of_run("run", of_run, made.common));
  made.parts.push_back(*calib::joint::part_of_array("array", triple_array(m, length_error_of_array),
                                                    made.common, {.linearised_at = of_run.U()}));
  made.parts.push_back(
      *calib::joint::part_of_bar("bar", triple_bar(m, made.common, plan), made.common));
  return made;
}

}  // namespace abbe::tests::joint
