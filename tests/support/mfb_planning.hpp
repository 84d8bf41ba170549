#pragma once
/// A bar, a machine and a star of five styli, to plan with.

#include <string_view>
#include <vector>

#include "abbe/calib/mfb/plan/plan.hpp"
#include "mfb_identification.hpp"

namespace abbe::tests::mfb {

/// Nominal bar with `holes` holes, 50 mm apart.
inline calib::mfb::Bar bar_to_plan(std::size_t holes) {
  calib::mfb::TouchPattern pattern = paper_pattern();
  pattern.hole_y_m.resize(holes);
  pattern.hole_x_m.clear();
  pattern.rod_x_m.clear();
  for (std::size_t i = 0; i < holes; ++i) {
    pattern.hole_x_m.push_back(0.05 * static_cast<double>(i));
    if (i > 0) {
      pattern.rod_x_m.push_back(pattern.hole_x_m.back() - 0.025);
    }
  }
  std::vector<Vector3> O_m;
  for (std::size_t i = 0; i < holes; ++i) {
    O_m.emplace_back(pattern.hole_x_m[i], pattern.hole_y_m[i], 0.0);
  }
  calib::mfb::Bar bar = bar_with(O_m);
  bar.pattern = pattern;
  return bar;
}

/// One pass for each stylus, tip radius 0 and noise as in the reference data. The travel begins at
/// 0; nodes every 50 mm.
inline calib::mfb::PlanTask task_for(std::size_t holes, const Vector3& travel_m,
                                     double arm_m = 0.1) {
  calib::mfb::PlanTask task;
  task.bar = bar_to_plan(holes);
  for (std::size_t k = 0; k < 3; ++k) {
    task.machine.nodes[k] = *calib::equidistant_nodes(0.0, travel_m(static_cast<Eigen::Index>(k)));
  }
  for (const Vector3& tip : {Vector3(0, 0, 0), Vector3(-arm_m, 0, 0), Vector3(arm_m, 0, 0),
                             Vector3(0, -arm_m, 0), Vector3(0, arm_m, 0)}) {
    task.styli.push_back(calib::mfb::stylus_of(tip - Vector3(0, 0, 0.15), task.machine.chain));
  }
  task.settings.noise = {.probe_m = 0.125e-6, .machine_m = 0.25e-6};
  task.backward = false;
  return task;
}

/// The machine, bar and styli of the reference data.
inline calib::mfb::PlanTask paper_task() {
  return task_for(12, Vector3::Constant(0.55));
}

}  // namespace abbe::tests::mfb
