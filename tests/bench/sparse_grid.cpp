/// Requirement: sparse::grid_search() over 50 gammas x 100 lambdas with 10-fold cross-validation on
/// the 216 x 45 problem of a ball array (50,000 held-out fits and 5,000 fits of all rows) is, in
/// the same run, >= 35 times as fast as a reference with one thread each, and >= 65 times as fast
/// with two threads against one of the reference. The reference is coordinate descent that updates
/// the residual (residual_descent.hpp), with the same rules. It runs the whole grid once; with
/// --short both run every tenth gamma. Every sweep count of the paths of all rows and every
/// cross-validation error is compared with the reference and with ncvreg.

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>
#include <thread>
#include <vector>

#include "abbe/calib/internal/sparse/cross_validation.hpp"
#include "abbe/calib/internal/sparse/standardise.hpp"
#include "abbe/calib/internal/sparse/sweep.hpp"
#include "residual_descent.hpp"
#include "sparse_reference.hpp"

namespace {

using namespace abbe;
using namespace abbe::calib::sparse;
using Clock = std::chrono::steady_clock;

constexpr double kAskedOneThread = 35.0;
constexpr double kAskedTwoThreads = 65.0;
constexpr int kRuns = 5;

double seconds_of(const std::function<void()>& work) {
  const auto begin = Clock::now();
  work();
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

double median_seconds(const std::function<void()>& work) {
  std::vector<double> seconds;
  for (int i = 0; i < kRuns; ++i) {
    seconds.push_back(seconds_of(work));
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[kRuns / 2];
}

void two_threads(std::size_t count, const std::function<void(std::size_t)>& task) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      task(i);
    }
  };
  std::thread other(work);
  work();
  other.join();
}

struct Case {
  Eigen::MatrixXd X;
  Eigen::VectorXd y;
  Folds folds;
  PathOptions options;
  std::vector<double> gamma;
  Eigen::MatrixXd ncvreg;  ///< lambda x gamma
};

Case read_case(bool every_tenth_gamma) {
  const std::filesystem::path folder = ABBE_TEST_DATA "/evemu";
  const auto problem = tests::sparse::ball_array_problem(folder);
  const auto grid = tests::sparse::reference_grid(folder, "ncvreg_default");
  Case c{problem.X,    problem.y, tests::sparse::reference_folds(folder, "fold216.csv"),
         grid.options, {},        {}};
  const Eigen::Index step = every_tenth_gamma ? 10 : 1;
  c.ncvreg = grid.error(Eigen::all, Eigen::seq(0, grid.error.cols() - 1, step));
  for (std::size_t g = 0; g < grid.gamma.size(); g += static_cast<std::size_t>(step)) {
    c.gamma.push_back(grid.gamma[g]);
  }
  return c;
}

struct PeerResult {
  Eigen::MatrixXd error;                  ///< lambda x gamma; NaN: missing
  std::vector<std::vector<long>> sweeps;  ///< of the paths of all rows, per gamma
};

/// Adds the squared errors of the rows of one fold to `error`; NaN for every lambda that the path
/// of the fold did not reach.
void hold_out(const Case& c, const Standardised& all, int fold, Eigen::MatrixXd& error) {
  std::vector<Eigen::Index> train, test;
  for (std::size_t i = 0; i < c.folds.of_row.size(); ++i) {
    (c.folds.of_row[i] == fold ? test : train).push_back(static_cast<Eigen::Index>(i));
  }

  const Standardised design = standardise(all.X(train, Eigen::all)).value();
  const Eigen::VectorXd y = c.y(train);
  const Eigen::MatrixXd X_test = (all.X(test, design.kept).rowwise() - design.mean.transpose()) *
                                 design.scale.cwiseInverse().asDiagonal();
  const Eigen::VectorXd y_test = c.y(test).array() - y.mean();
  bench::ResidualDescent descent(design.X, y.array() - y.mean());

  for (std::size_t g = 0; g < c.gamma.size(); ++g) {
    const auto path =
        descent.scad(c.gamma[g], c.options.lambda, c.options.tolerance, c.options.max_sweeps);
    auto column = error.col(static_cast<Eigen::Index>(g));
    for (std::size_t l = 0; l < path.b.size(); ++l) {
      const auto b = Eigen::VectorXd::Map(path.b[l].data(), X_test.cols());
      column(static_cast<Eigen::Index>(l)) += (y_test - X_test * b).squaredNorm();
    }
    column.tail(column.size() - static_cast<Eigen::Index>(path.b.size())).setConstant(std::nan(""));
  }
}

PeerResult run_peer(const Case& c) {
  const Standardised all = standardise(c.X).value();
  PeerResult out{Eigen::MatrixXd::Zero(c.ncvreg.rows(), c.ncvreg.cols()), {}};
  for (int fold = 0; fold < c.folds.count; ++fold) {
    hold_out(c, all, fold, out.error);
  }

  out.error /= static_cast<double>(c.y.size());
  bench::ResidualDescent descent(all.X, c.y.array() - c.y.mean());
  for (std::size_t g = 0; g < c.gamma.size(); ++g) {
    out.sweeps.push_back(
        descent.scad(c.gamma[g], c.options.lambda, c.options.tolerance, c.options.max_sweeps)
            .sweeps);
    const auto missing = out.error.rows() - static_cast<Eigen::Index>(out.sweeps[g].size());
    out.error.col(static_cast<Eigen::Index>(g)).tail(missing).setConstant(std::nan(""));
  }

  return out;
}

struct Agreement {
  long cells = 0, missing_differs = 0;
  double largest = 0.0;
};
Agreement compare(const Eigen::MatrixXd& ours, const Eigen::MatrixXd& theirs) {
  Agreement a;
  for (Eigen::Index i = 0; i < ours.size(); ++i) {
    const double u = ours.data()[i], v = theirs.data()[i];
    if (std::isnan(u) != std::isnan(v)) ++a.missing_differs;
    if (std::isnan(u) || std::isnan(v)) continue;
    ++a.cells;
    a.largest = std::max(a.largest, std::abs(u - v));
  }
  return a;
}

void print(std::string_view peer, const Agreement& a) {
  fmt::print(
      "  against {}: {} cells, largest difference of a CV error {:.1e}, missing in one only {}\n",
      peer, a.cells, a.largest, a.missing_differs);
}

std::size_t differing_paths(const GridSearch& ours, const PeerResult& peer) {
  std::size_t differing = 0;
  for (std::size_t g = 0; g < ours.paths.size(); ++g) {
    differing += ours.paths[g].sweeps == peer.sweeps[g] ? 0 : 1;
  }
  return differing;
}

}  // namespace

int main(int argc, char** argv) {
  const bool few = argc > 1 && std::string_view(argv[1]) == "--short";
  const Case c = read_case(few);
  const auto run = [&](const ParallelFor& parallel_for) {
    return grid_search(c.X, c.y, PenaltyKind::Scad, c.gamma, c.folds, c.options, parallel_for)
        .value();
  };
  const GridSearch ours = run(serial_for);
  const double one_s = median_seconds([&] { run(serial_for); });
  const double two_s = median_seconds([&] { run(two_threads); });
  PeerResult peer;
  const double peer_s = seconds_of([&] { peer = run_peer(c); });

  fmt::print(
      "SCAD, {} gammas x {} lambdas, {} folds, 216 x 45, {:.1f} million sweeps, {} registers{}\n",
      c.gamma.size(), c.options.lambda.size(), c.folds.count,
      static_cast<double>(ours.sweeps) * 1e-6, sweep_variants().front().instructions,
      few ? " (--short: both sides every tenth gamma only)" : "");
  fmt::print("  residual form, one thread    {:8.3f} s\n", peer_s);
  fmt::print("  abbe, one thread             {:8.3f} s  {:6.1f} x  (asked {:.0f})\n", one_s,
             peer_s / one_s, kAskedOneThread);
  fmt::print("  abbe, two threads            {:8.3f} s  {:6.1f} x  (asked {:.0f}, whole grid)\n",
             two_s, peer_s / two_s, kAskedTwoThreads);
  const Agreement with_peer = compare(ours.error, peer.error),
                  with_ncvreg = compare(ours.error, c.ncvreg);
  print("the residual form", with_peer);
  print("ncvreg 3.16", with_ncvreg);
  const std::size_t differing = differing_paths(ours, peer);
  fmt::print("  paths of all rows whose sweep counts differ from the residual form: {} of {}\n",
             differing, ours.paths.size());
  const bool agrees = differing == 0 &&
                      with_peer.missing_differs + with_ncvreg.missing_differs == 0 &&
                      with_peer.largest <= 1e-10 && with_ncvreg.largest <= 1e-10;
  const bool fast =
      few || (peer_s / one_s >= kAskedOneThread && peer_s / two_s >= kAskedTwoThreads);
  return agrees && fast ? 0 : 1;
}
