/// Planning of an on-the-fly path against the plain way: one walk over a 3 x 3 x 3 lattice for the
/// reference machine (169 unknowns, 32.5 m), with its relaxed design, and for each of its steps a
/// dense inverse for each of the 26 legs that could follow. Then the whole plan: its bound
/// (asked: at most 0.083 um), and that of the base path of the same length. Processor time.
///     bench_plan_otf [--short]

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cstring>
#include <ctime>

#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/calib/otf/run/path_frame.hpp"
#include "abbe/calib/otf/run/polyline.hpp"

namespace {

using namespace abbe::calib;
using namespace abbe::calib::otf;

PlannedRun reference_run() {
  PlannedRun run;
  run.machine.chain = *KinematicChain::parse("[w X' b Y Z (C1) t]");
  run.machine.nodes = {*equidistant_nodes(-0.3, 0.3), *equidistant_nodes(-0.25, 0.25),
                       *equidistant_nodes(-0.4, 0.0)};
  run.machine.target_offset_m = {0.02, -0.015, -0.12};
  run.tracker_m = {-0.75, -0.62, -0.35};
  return run;
}

double seconds_of(auto work) {
  const std::clock_t start = std::clock();
  work();
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

/// trace(C) after one more leg: rows of the leg 12.5 mm apart as a dense matrix, and the inverse.
double dense_evaluation(const PlannedRun& run, const ParameterLayout& layout,
                        const Eigen::MatrixXd& H, const Vector3& from, const Vector3& to) {
  constexpr double kSpacing_m = 0.0125;
  const auto points = static_cast<Eigen::Index>((to - from).norm() / kSpacing_m);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * points, H.cols());
  for (Eigen::Index i = 0; i < points; ++i) {
    const Vector3 q =
        from + (static_cast<double>(i) + 0.5) / static_cast<double>(points) * (to - from);
    const Vector3 p = q + run.machine.target_offset_m;
    const PathFrame frame = path_frame(to - from, p - run.tracker_m, run.noise);
    const DesignColumns columns = design_columns_with_rigid(layout, q, run.machine.target_offset_m);
    for (const Column& c : columns.span()) {
      const auto k = static_cast<Eigen::Index>(c.parameter);
      A(2 * i, k) = frame.a2.dot(c.dV_dU) / frame.sigma2_m;
      A(2 * i + 1, k) = frame.a3.dot(c.dV_dU) / frame.sigma3_m;
    }
  }
  return Eigen::MatrixXd(H + A.transpose() * A)
      .llt()
      .solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()))
      .trace();
}

}  // namespace

int main(int argc, char** argv) {
  const bool brief = argc > 1 && std::strcmp(argv[1], "--short") == 0;
  const PlannedRun run = reference_run();
  const Path base = base_path(run.machine.nodes);
  const PathBudget budget{.length_m = lengths_to_vertices_m(base).back()};

  PlannedPath walk;
  const double walk_s =
      seconds_of([&] { walk = plan(run, budget, {.lattice = 3, .exchanges = 0}).value(); });
  const std::size_t legs = walk.path.vertices_m.size() - 1;

  const ParameterLayout layout =
      *ParameterLayout::observable_with_one_target(run.machine.chain, run.machine.nodes);
  const auto n = static_cast<Eigen::Index>(layout.fit_size());
  const Eigen::MatrixXd H = 1e10 * Eigen::MatrixXd::Identity(n, n);
  double sum = 0.0;
  constexpr int kEvaluated = 26;
  const double step_s = seconds_of([&] {
    for (int i = 0; i < kEvaluated; ++i) {
      sum += dense_evaluation(run, layout, H, base.vertices_m[0], base.vertices_m[1]);
    }
  });
  const double dense_s = step_s * static_cast<double>(legs);
  fmt::print("walk of {} legs: {:.2f} s; dense evaluation of every leg: {:.1f} s, ratio {:.3f}\n",
             legs, walk_s, dense_s, walk_s / dense_s);

  PlannedPath best = walk;
  const double plan_s = brief ? walk_s : seconds_of([&] { best = plan(run, budget).value(); });
  const auto predicted = predict(best.path, run), of_base = predict(base, run);
  fmt::print("{}: {:.4f} um rms, {:.2f} m, {:.1f} s; base path {:.4f} um (check {:.3g})\n",
             brief ? "walk" : "plan", 1e6 * predicted->rms_u_m, predicted->length_m, plan_s,
             1e6 * of_base->rms_u_m, sum);

  constexpr double kAsked_m = 0.083e-6;
  return walk_s < dense_s && (brief || predicted->rms_u_m <= kAsked_m) ? 0 : 1;
}
