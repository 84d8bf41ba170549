/// Time and accuracy of four ways to solve the least-squares problem of one on-the-fly run (9,200
/// rows of 169 unknowns, 38 entries each):
/// - Householder reflections in batches (estimation::Information),
/// - Householder reflections, first for the rows of each cell (estimation::information_of),
/// - sparse normal equations,
/// - Eigen's dense QR of all rows at once, with whose solution the others are compared,
/// - Ceres Solver (Debian's libceres-dev), if it was there when this program was built.
/// Then the information of four parts is merged, as in the held-out test. Build type Release.
///     bench_information [--short]

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#ifdef ABBE_WITH_CERES
#include <ceres/ceres.h>
#endif

#include "abbe/calib/estimation/datum.hpp"
#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/internal/estimation/sparse_information.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/model/model_datum.hpp"

namespace {

using namespace abbe::calib;
using estimation::Information;
using estimation::RowBatch;
using estimation::RowEntry;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kPoints = 4600;

struct Run {
  ParameterLayout layout;
  std::vector<std::vector<RowEntry>> rows;
  std::vector<double> y;
};

/// A simulated run: points on straight legs between random vertices, with one row for each of two
/// directions across the leg.
Run random_run() {
  MachineNodes nodes{*equidistant_nodes(-0.3, 0.3), *equidistant_nodes(-0.25, 0.25),
                     *equidistant_nodes(-0.4, 0.0)};
  Run run{*ParameterLayout::observable_with_one_target({}, nodes), {}, {}};
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vertex = [&] {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return Vector3(0.3 * x, 0.25 * y, 0.2 * z - 0.2);
  };

  constexpr std::size_t kPerLeg = 60;
  Vector3 from = vertex(), to = vertex();
  for (std::size_t i = 0; i < kPoints; ++i) {
    if (i % kPerLeg == 0) {
      from = to;
      to = vertex();
    }
    const Vector3 along = (to - from).normalized();
    const Vector3 q =
        from + (to - from) * (static_cast<double>(i % kPerLeg) / static_cast<double>(kPerLeg));
    const Vector3 a2 = along.cross(Vector3(0.3, 0.5, 0.8)).normalized();
    const DesignColumns columns = design_columns_with_rigid(run.layout, q, {0.02, -0.015, -0.12});
    for (const Vector3& a : {a2, Vector3(along.cross(a2))}) {
      std::vector<RowEntry> row;
      for (const Column& c : columns.span()) {
        row.push_back({c.parameter, a.dot(c.dV_dU)});
      }
      run.rows.push_back(std::move(row));
      run.y.push_back(uniform(random));
    }
  }

  return run;
}

Information information_of(const Run& run, std::size_t part, std::size_t parts) {
  Information data(run.layout.fit_size());
  RowBatch batch(run.layout.fit_size());
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    if ((i / 120) % parts != part) {
      continue;
    }
    batch.append(run.rows[i], run.y[i], 1.0);
    if (batch.full()) {
      data.add(batch);
    }
  }
  data.add(batch);
  return data;
}

Information information_by_cell(const Run& run) {
  std::vector<estimation::WeightedRow> rows;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    rows.push_back({run.rows[i], run.y[i], 1.0});
  }
  return estimation::information_of(run.layout.fit_size(), rows);
}

struct Squared {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
};

Squared normal_equations_of(const Run& run) {
  const auto n = static_cast<Eigen::Index>(run.layout.fit_size());
  Squared N{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const std::vector<RowEntry>& row = run.rows[i];
    for (std::size_t a = 0; a < row.size(); ++a) {
      const auto column = static_cast<Eigen::Index>(row[a].column);
      for (std::size_t b = a; b < row.size(); ++b) {
        N.H(static_cast<Eigen::Index>(row[b].column), column) += row[a].value * row[b].value;
      }
      N.g(column) += row[a].value * run.y[i];
    }
  }
  return N;
}

Eigen::MatrixXd dense_rows(const Run& run) {
  Eigen::MatrixXd A =
      Eigen::MatrixXd::Zero(std::ssize(run.rows), static_cast<Eigen::Index>(run.layout.fit_size()));
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    for (const RowEntry& e : run.rows[i]) {
      A(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(e.column)) = e.value;
    }
  }
  return A;
}

template <class Work>
double median_ms(int runs, Work work) {
  std::vector<double> ms;
  for (int i = 0; i < runs; ++i) {
    const auto begin = Clock::now();
    work();
    ms.push_back(1e3 * std::chrono::duration<double>(Clock::now() - begin).count());
  }
  std::sort(ms.begin(), ms.end());
  return ms[ms.size() / 2];
}

#ifdef ABBE_WITH_CERES
/// Residual of one row: sum of value * unknown - y. Each unknown is a parameter block of its own.
class RowCost : public ceres::CostFunction {
 public:
  RowCost(const std::vector<RowEntry>& row, double y) : row_(row), y_(y) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->assign(row.size(), 1);
  }
  bool Evaluate(double const* const* U, double* residual, double** jacobians) const override {
    *residual = -y_;
    for (std::size_t i = 0; i < row_.size(); ++i) {
      *residual += row_[i].value * *U[i];
      if (jacobians != nullptr && jacobians[i] != nullptr) {
        *jacobians[i] = row_[i].value;
      }
    }
    return true;
  }

 private:
  std::vector<RowEntry> row_;
  double y_;
};

void add_row(ceres::Problem& problem, const std::vector<RowEntry>& row, double y,
             Eigen::VectorXd& U) {
  std::vector<double*> blocks;
  for (const RowEntry& e : row) {
    blocks.push_back(U.data() + e.column);
  }
  problem.AddResidualBlock(new RowCost(row, y), nullptr, blocks);
}

/// Solves the rows and the conditions of the datum with one thread.
Eigen::VectorXd solve_with_ceres(const Run& run, const Eigen::MatrixXd& conditions,
                                 ceres::LinearSolverType type) {
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(run.layout.fit_size()));
  ceres::Problem problem;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    add_row(problem, run.rows[i], run.y[i], U);
  }
  for (const auto& condition : conditions.rowwise()) {
    std::vector<RowEntry> row;
    for (Eigen::Index k = 0; k < condition.size(); ++k) {
      if (condition(k) != 0.0) {
        row.push_back({static_cast<std::size_t>(k), condition(k)});
      }
    }
    add_row(problem, row, 0.0, U);
  }

  ceres::Solver::Options options;
  options.linear_solver_type = type;
  options.num_threads = 1;
  options.function_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return U;
}
#endif

}  // namespace

int main(int argc, char** argv) {
  const int runs = argc > 1 && std::strcmp(argv[1], "--short") == 0 ? 3 : 11;
  const Run run = random_run();
  const std::size_t unknowns = run.layout.fit_size();
  const estimation::Datum datum(datum_conditions(ModelDatum::G1, run.layout));

  Information data(unknowns);
  Squared squared;
  estimation::DatumSolution solution;
  Eigen::VectorXd U;
  const double householder_ms = median_ms(runs, [&] { data = information_of(run, 0, 1); });
  const double by_cell_ms = median_ms(runs, [&] { data = information_by_cell(run); });
  const double normal_ms = median_ms(runs, [&] { squared = normal_equations_of(run); });
  const double solve_ms = median_ms(runs, [&] { solution = datum.solve(data).value(); });

  const double estimate_ms = median_ms(runs, [&] { U = datum.estimate(data).value(); });

  std::vector<Information> parts;
  for (std::size_t part = 0; part < 5; ++part) {
    parts.push_back(information_of(run, part, 5));
  }
  const double merge_ms = median_ms(runs, [&] {
    Information sum(unknowns);
    for (std::size_t part = 1; part < 5; ++part) {
      sum += parts[part];
    }
  });

  const Eigen::MatrixXd A = dense_rows(run);
  Eigen::MatrixXd bordered(A.rows() + datum.conditions().rows(), A.cols());
  bordered << A, datum.conditions();
  Eigen::VectorXd y = Eigen::VectorXd::Zero(bordered.rows());
  y.head(A.rows()) = Eigen::Map<const Eigen::VectorXd>(run.y.data(), A.rows());
  Eigen::VectorXd dense;
  const double dense_ms = median_ms(1, [&] { dense = bordered.householderQr().solve(y); });

  fmt::print("{} rows, {} unknowns, condition {:.0f}, rank {}\n", run.rows.size(), unknowns,
             solution.condition, solution.rank);
  fmt::print("  Householder in batches {:7.1f} ms, {:.0f} ns per row\n", householder_ms,
             1e6 * householder_ms / static_cast<double>(run.rows.size()));
  fmt::print("  the same, by cells     {:7.1f} ms\n", by_cell_ms);
  fmt::print("  normal equations       {:7.1f} ms\n", normal_ms);
  fmt::print("  dense QR (Eigen)       {:7.1f} ms\n", dense_ms);
  fmt::print("  merge of four parts    {:7.1f} ms\n", merge_ms);
  fmt::print("  solution and covariance{:7.1f} ms\n", solve_ms);
  fmt::print("  solution alone         {:7.1f} ms\n", estimate_ms);
  const double ours_ms = by_cell_ms + solve_ms;
  fmt::print("  by cells with solution and covariance / dense QR without: {:.3f}\n",
             ours_ms / dense_ms);
#ifdef ABBE_WITH_CERES
  for (const auto& [type, what] : {std::pair{ceres::SPARSE_NORMAL_CHOLESKY, "sparse"},
                                   std::pair{ceres::DENSE_NORMAL_CHOLESKY, "dense"}}) {
    Eigen::VectorXd of_ceres;
    const double ceres_ms = median_ms(
        runs, [&, type = type] { of_ceres = solve_with_ceres(run, datum.conditions(), type); });
    fmt::print(
        "  Ceres with set-up, {} normal equations, without covariance {:7.1f} ms, {:.1e} from "
        "dense QR; "
        "by cells / Ceres: {:.3f}\n",
        what, ceres_ms, (of_ceres - dense).norm() / dense.norm(), ours_ms / ceres_ms);
  }
#else
  fmt::print("  Ceres Solver: not measured, libceres-dev is not installed\n");
#endif

  const double difference = (solution.U - dense).norm() / dense.norm();
  fmt::print("  solution against dense QR: {:.1e} relative (asked 1e-12)\n", difference);

  return difference <= 1e-12 ? 0 : 1;
}
