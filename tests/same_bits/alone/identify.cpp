/// Identifies from the reference data and prints a hash of every result: the same lines on every
/// processor. Part of the test suite natively, under another processor's instructions and for
/// another architecture.
#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <span>
#include <string>

#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "evemu_run.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;

/// FNV-1a over the bits of doubles.
class Hash {
 public:
  void add(double value) {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    for (int byte = 0; byte < 8; ++byte) {
      hash_ = (hash_ ^ (bits >> (8 * byte) & 0xff)) * 0x100000001b3u;
    }
  }
  void add(const Eigen::MatrixXd& values) {
    for (const double value : values.reshaped()) add(value);
  }
  void print(const char* name) const {
    std::printf("%s %016llx\n", name, static_cast<unsigned long long>(hash_));
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

template <class T>
const T& must(const Result<T>& result, const char* what) {
  if (!result) {
    std::fprintf(stderr, "%s: %s\n", what, result.error().text.c_str());
    std::exit(1);
  }
  return *result;
}

void print_elementary() {
  Hash hash;
  for (int i = -4000; i <= 4000; ++i) {
    const SinCos s = sin_cos(0.01 * i);
    hash.add(s.sin);
    hash.add(s.cos);
    hash.add(exponential(0.1 * i));
    hash.add(natural_logarithm(exponential(0.1 * i)));
  }
  NormalDeviates deviates(1);
  for (int i = 0; i < 10000; ++i) hash.add(deviates.next());
  hash.print("elementary");
}

void print_model(const char* name, const VolumetricModel& model) {
  Hash hash;
  hash.add(model.U());
  hash.add(model.covariance());
  hash.print(name);
}

/// Case A of the reference data: 4663 segments of 40 m, 149 unknowns.
void print_on_the_fly_from_segments() {
  using namespace abbe::tests::otf;
  const RigidTransform T = case_a_alignment(true);
  const otf::Path path = case_a_path();
  const otf::Machine machine = case_a_machine();

  const auto seen_at = [&](const Vector3& vertex) {
    return Vector3(T.R.transpose() * (vertex + machine.target_offset_m - T.t_m));
  };

  const auto series =
      otf::segments_from_means(case_a_segments().means_tracker_m, seen_at(path.vertices_m.front()),
                               seen_at(path.vertices_m.back()), {});
  const auto observations = otf::observe_segments(must(series, "segments"), machine, path, {});
  const auto solution = otf::solve(must(observations, "observe"));
  print_model("on-the-fly, segments", must(solution, "solve").model);
}

/// A tracker 2.5 m away with noise of 6 um, and with `slow_m` also a noise correlated over 50
/// samples; a machine with errors of 30 um.
void print_on_the_fly_from_samples(const char* name, double slow_m) {
  using namespace abbe::tests::otf;
  const otf::Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  const otf::Path path = case_a_path();
  const ParameterLayout layout = layout_of(machine);
  NormalDeviates normal(7);
  Eigen::VectorXd U(static_cast<Eigen::Index>(layout.model_size()));
  for (double& u : U) u = 30e-6 * normal.next();
  std::vector<otf::TrackerObservation> samples;
  Vector3 slow = Vector3::Zero();

  for (const Vector3& q : drive(path, 0.4, 250.0)) {
    const Vector3& t = machine.target_offset_m;
    const Vector3 p = q + t + volumetric_error(layout, {U.data(), layout.model_size()}, q, t);
    const std::array noise{normal.next(), normal.next(), normal.next()};  // braces: in this order
    samples.push_back({static_cast<double>(samples.size()) / 250.0,
                       p - Vector3(2.0, 1.0, -1.2) + 6e-6 * Vector3(noise.data()) + slow_m * slow,
                       true});
    slow = 0.98 * slow + 0.2 * Vector3(noise.data());
  }

  const otf::Options options{.segment_samples = 10, .orientation = {.scales_agree = true}};
  const auto run = otf::identify(samples, machine, path, {}, options);
  print_model(name, must(run, "identify").solution.model);
  if (slow_m > 0.0) {
    return;
  }
  const auto verdict = otf::judge(run->observations, run->solution, nullptr, {}, options);
  Hash hash;
  hash.add(must(verdict, "judge").held_out.candidate_rms_m);
  hash.print("on-the-fly, verdict");
}

void print_spherical() {
  Hash hash;
  for (int i = 0; i < 10000; ++i) {
    hash.add(Eigen::MatrixXd(
        from_spherical(1.0 + 1e-3 * i, -std::numbers::pi + 6e-4 * i, -1.5 + 3e-4 * i)));
  }
  hash.print("spherical");
}

void print_ball_array(const char* name, evemu::Estimator estimator) {
  using namespace abbe::tests::evemu;
  const auto observations = evemu::observe_errors(reference_errors(), reference_machine(),
                                                  evemu::RotationOrigin::Independent);
  evemu::SolveOptions options{.estimator = estimator};
  options.sparse.lambda = sparse::log_spaced(1e-1, 1e-6, 16);
  options.sparse.gamma = {2.5, 20.0};
  options.sparse.bootstrap_runs = 4;
  const auto solution = evemu::solve(must(observations, name), options);
  Hash hash;
  hash.add(must(solution, name).raw_c_m);
  hash.add(solution->model.error_at(Vector3(0.1, 0.2, -0.1), Vector3::Zero()).cov_V_m2);
  hash.print(name);
}

}  // namespace

int main() {
  print_elementary();
  print_spherical();
  print_on_the_fly_from_segments();
  print_on_the_fly_from_samples("on-the-fly, samples", 0.0);
  print_on_the_fly_from_samples("on-the-fly, correlated noise", 3e-6);
  print_ball_array("ball array, bayes-pose", evemu::Estimator::BayesPose);
  print_ball_array("ball array, scad", evemu::Estimator::Scad);
}
