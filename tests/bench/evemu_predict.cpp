// Question: does a model of a ball array (45 polynomials) compute V with its covariance, including
// the tests for validity volume and tool, at a million points within one second on one core? The
// processor time, which excludes other processes, is measured; median of 7 runs. The ratio to the
// limit must be below 1.
//
//   bench_evemu_predict [points = 1000000]

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>
#include <vector>

#include "evemu_study.hpp"

int main(int argc, char** argv) {
  using namespace abbe::calib;
  using namespace abbe::tests::evemu;
  const auto points = static_cast<std::size_t>(argc > 1 ? std::atol(argv[1]) : 1'000'000);
  const auto solution =
      *evemu::solve(simulated(reference_layout(), table3_machine(), {8e-6, 0.15e-3}, 1));
  std::mt19937 random(1);
  std::uniform_real_distribution<double> x(0.0, 0.55), y(-0.05, 0.35), z(0.0, 0.1);
  std::vector<Vector3> q(points);

  for (Vector3& p : q) {
    p = Vector3(x(random), y(random), z(random));
  }

  std::array<double, 7> seconds{};
  double sum = 0.0;
  std::size_t inside = 0;

  for (double& s : seconds) {
    const std::clock_t start = std::clock();
    for (const Vector3& p : q) {
      const VolumetricError e = solution.model.error_at(p, Vector3::Zero());
      sum += e.V_m.x() + e.cov_V_m2(1, 1);
      inside += e.inside ? 1 : 0;
    }
    s = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  }

  std::nth_element(seconds.begin(), seconds.begin() + 3, seconds.end());
  const double limit_s = 1e-6 * static_cast<double>(points);
  std::printf(
      "%zu points with covariance: %.3f s, limit %.3f s, ratio %.2f (%zu inside, check %.3g)\n",
      points, seconds[3], limit_s, seconds[3] / limit_s, inside / seconds.size(), sum);

  return seconds[3] <= limit_s ? 0 : 1;
}
