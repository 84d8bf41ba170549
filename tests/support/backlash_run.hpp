#pragma once
/// Adds backlash to the samples of a synthetic run.

#include <span>

#include "abbe/calib/geometry/table_basis.hpp"
#include "otf_run.hpp"

namespace abbe::tests::otf {

struct BacklashOfRun {
  /// Differences between both directions in the order of the unknowns; their number gives the form:
  /// one per table, or one per node.
  Eigen::VectorXd values;
  /// Of all axes before their first motion.
  calib::Travel start = calib::Travel::Backward;
};

inline calib::TableBasis basis_with(const calib::ParameterLayout& layout,
                                    const BacklashOfRun& backlash) {
  using enum calib::TravelDependence;
  const bool per_table = backlash.values.size() == std::ssize(layout.tables());
  return *calib::TableBasis::of(layout, {.travel = per_table ? Backlash : Tables});
}

/// `driven_m`: axis position of each sample.
inline void add_backlash(std::span<calib::otf::TrackerObservation> samples,
                         std::span<const Vector3> driven_m, const calib::ParameterLayout& layout,
                         const Vector3& target_m, const calib::RigidTransform& T_machine_tracker,
                         const BacklashOfRun& backlash) {
  using calib::Travel;
  const auto basis = basis_with(layout, backlash);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(basis.size()));
  U.tail(backlash.values.size()) = backlash.values;
  std::array<Travel, 3> travel{backlash.start, backlash.start, backlash.start};

  for (std::size_t i = 0; i < samples.size(); ++i) {
    for (Eigen::Index a = 0; i > 0 && a < 3; ++a) {
      const double step_m = driven_m[i](a) - driven_m[i - 1](a);
      if (std::abs(step_m) > 1e-9) {
        travel[static_cast<std::size_t>(a)] = step_m > 0.0 ? Travel::Forward : Travel::Backward;
      }
    }
    const Vector3 V = basis.V_m({.q_m = driven_m[i], .tool_offset_m = target_m, .travel = travel},
                                {U.data(), basis.size()});
    samples[i].p_tracker_m += T_machine_tracker.R.transpose() * V;
  }
}

/// make_run() of a machine with backlash, along another path if it is not empty.
inline MadeRun make_backlash_run(const MadeRunOptions& wanted, const BacklashOfRun& backlash,
                                 const std::vector<Vector3>& path_m = {}) {
  MadeRun run = make_run(wanted);
  if (!path_m.empty()) {
    run.path.vertices_m = path_m;
    measure_run(run, wanted);
  }
  add_backlash(run.samples, drive(run.path, wanted.speed_m_s, wanted.rate_hz),
               layout_of(run.machine), run.machine.target_offset_m, run.T_machine_tracker,
               backlash);
  return run;
}

}  // namespace abbe::tests::otf
