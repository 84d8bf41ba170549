/// Requirement: the information of every tracker sample is accumulated in at most 80 ns per sample
/// (488,664 samples in 0.04 s) and 5 MB. The samples follow the path of reference case A at 500 Hz
/// and 2500 mm/min with the noise of a tracker. Peers in the same run: the rows of the segment
/// means of the same samples, which the identification uses, and Eigen's dense QR of those rows.
/// Build type Release.
///     bench_otf_moments [--short]

#include <fmt/format.h>

#include <malloc.h>

#include <Eigen/QR>
#include <algorithm>
#include <chrono>
#include <cstring>
#include <vector>

#include "abbe/calib/otf/live/moments.hpp"
#include "abbe/calib/otf/solve/solve.hpp"
#include "otf_run.hpp"

namespace {

using namespace abbe::calib;
using namespace abbe::calib::otf;
namespace ref = abbe::tests::otf;
using Clock = std::chrono::steady_clock;

constexpr double kAsked_ns = 80.0, kAskedMegabytes = 5.0;
constexpr double kSpeed_m_s = 2.5 / 60.0, kRate_hz = 500.0;

/// Tracker points of each leg.
std::vector<std::vector<Vector3>> points_by_leg(const Path& path, const Vector3& target_m) {
  const RigidTransform T = ref::case_a_alignment(true);
  std::mt19937_64 random(1);
  std::vector<std::vector<Vector3>> legs;
  for (std::size_t leg = 0; leg + 1 < path.vertices_m.size(); ++leg) {
    const Vector3 &from = path.vertices_m[leg], &to = path.vertices_m[leg + 1];
    const auto count = static_cast<std::size_t>((to - from).norm() / kSpeed_m_s * kRate_hz);
    std::vector<Vector3>& points = legs.emplace_back();
    for (std::size_t i = 0; i < count; ++i) {
      const double s = static_cast<double>(i) / static_cast<double>(count);
      const Vector3 p = T.R.transpose() * (from + s * (to - from) + target_m - T.t_m);
      points.push_back(ref::with_noise(p, {}, 1.0, random));
    }
  }
  return legs;
}

void accumulate(MomentAccumulator& moments, const Path& path,
                const std::vector<std::vector<Vector3>>& legs) {
  for (std::size_t leg = 0; leg < legs.size(); ++leg) {
    moments.begin_leg(path.vertices_m[leg], path.vertices_m[leg + 1]);
    for (const Vector3& p : legs[leg]) {
      moments.add(p);
    }
  }
}

/// Two rows per 100 samples.
Observations segment_rows(const calib::TableBasis& basis, const Path& path, const Vector3& target_m,
                          const std::vector<std::vector<Vector3>>& legs) {
  Observations o{.basis = basis, .target_offset_m = target_m};
  for (std::size_t leg = 0; leg < legs.size(); ++leg) {
    std::vector<TrackerObservation> means;
    for (std::size_t i = 0; i + 100 <= legs[leg].size(); i += 100) {
      means.push_back({0.0, legs[leg][i + 50]});
    }
    ref::append_samples(o, means, path.vertices_m[leg], path.vertices_m[leg + 1],
                        ref::case_a_alignment(true), {});
  }
  return o;
}

Eigen::MatrixXd dense_of(const Observations& o) {
  Eigen::MatrixXd A =
      Eigen::MatrixXd::Zero(std::ssize(o.rows), static_cast<Eigen::Index>(o.unknowns()));
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    for (const SparseRows::Entry& e : o.A.row(i)) {
      A(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(e.column)) = e.value;
    }
  }
  return A;
}

template <class Work>
double median_s(int runs, Work work) {
  std::vector<double> seconds;
  for (int i = 0; i < runs; ++i) {
    const auto begin = Clock::now();
    work();
    seconds.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[seconds.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 && std::strcmp(argv[1], "--short") == 0 ? 3 : 11;
  const Machine machine = ref::case_a_machine();
  const Path path = ref::case_a_path();
  const auto basis = *calib::TableBasis::of(ref::layout_of(machine));
  const auto legs = points_by_leg(path, machine.target_offset_m);
  const MomentAccumulator empty = *MomentAccumulator::of(
      {basis, machine.target_offset_m, ref::case_a_alignment(true), Noise{}});

  MomentAccumulator moments = empty;
  const double accumulate_s = median_s(runs, [&] {
    moments = empty;
    accumulate(moments, path, legs);
  });
  const double information_s = median_s(runs, [&] { (void)moments.information(); });

  const auto used_bytes = mallinfo2().uordblks;
  const MomentAccumulator copy = moments;
  const double megabytes = static_cast<double>(mallinfo2().uordblks - used_bytes) / 1e6;

  const Observations o = segment_rows(basis, path, machine.target_offset_m, legs);
  const double segments_s = median_s(runs, [&] { (void)information_of(o); });
  const Eigen::MatrixXd dense = dense_of(o);
  const double dense_s =
      median_s(1, [&] { (void)Eigen::MatrixXd(dense.householderQr().matrixQR()); });

  const double each_ns = 1e9 * accumulate_s / static_cast<double>(moments.samples());
  fmt::print("{} samples on {} legs\n", moments.samples(), legs.size());
  fmt::print("  accumulation         {:7.1f} ms, {:.0f} ns per sample (asked {:.0f})\n",
             1e3 * accumulate_s, each_ns, kAsked_ns);
  fmt::print(
      "  R of all samples     {:7.1f} ms, {:.2f} x R of {} rows of segment means ({:.1f} ms)\n",
      1e3 * information_s, information_s / segments_s, o.rows.size(), 1e3 * segments_s);
  fmt::print("  dense QR of the rows {:7.1f} ms, {:.1f} x R of all samples\n", 1e3 * dense_s,
             dense_s / information_s);
  fmt::print("  memory {:.2f} MB (asked {:.0f})\n", megabytes, kAskedMegabytes);

  return each_ns <= kAsked_ns && megabytes <= kAskedMegabytes ? 0 : 1;
}
