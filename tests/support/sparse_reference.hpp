#pragma once
/// The 216 x 45 problem of a ball array and the results of ncvreg 3.16.0.7 (tests/data/evemu).

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "abbe/calib/internal/sparse/cross_validation.hpp"

namespace abbe::tests::sparse {

/// Cells as text; the first line is the heading.
struct Table {
  std::vector<std::string> heading;
  std::vector<std::vector<std::string>> rows;
};

inline std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',') {
      cells.emplace_back();
    } else if (c != '"' && c != '\r') {
      cells.back() += c;
    }
  }
  return cells;
}

inline std::ifstream open_reference(const std::filesystem::path& folder, const std::string& name) {
  std::ifstream in(folder / name);
  if (!in) throw std::runtime_error("cannot read " + (folder / name).string());
  return in;
}

inline Table read_table(const std::filesystem::path& folder, const std::string& name) {
  std::ifstream in = open_reference(folder, name);
  Table table;
  std::string line;
  std::getline(in, line);
  table.heading = split(line);
  while (std::getline(in, line)) {
    table.rows.push_back(split(line));
  }
  return table;
}

/// An empty cell is a missing value: NaN.
inline double number(const std::string& cell) {
  return cell.empty() ? std::nan("") : std::strtod(cell.c_str(), nullptr);
}

inline Eigen::MatrixXd numbers(const Table& table) {
  Eigen::MatrixXd values(static_cast<Eigen::Index>(table.rows.size()),
                         static_cast<Eigen::Index>(table.heading.size()));
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    for (Eigen::Index j = 0; j < values.cols(); ++j) {
      values(i, j) = number(table.rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]);
    }
  }
  return values;
}

/// Root mean square of the columns about their means: standardised
/// coefficient = coefficient * scale.
inline Eigen::VectorXd column_scales(const Eigen::MatrixXd& X) {
  const Eigen::MatrixXd centred = X.rowwise() - X.colwise().mean();
  return (centred.colwise().squaredNorm() / static_cast<double>(X.rows())).cwiseSqrt().transpose();
}

struct BallArrayProblem {
  Eigen::MatrixXd X;
  Eigen::VectorXd y, scale;
};
inline BallArrayProblem ball_array_problem(const std::filesystem::path& folder) {
  BallArrayProblem problem{
      numbers(read_table(folder, "X216.csv")), numbers(read_table(folder, "y216.csv")).col(0), {}};
  problem.scale = column_scales(problem.X);
  return problem;
}

inline calib::sparse::Folds reference_folds(const std::filesystem::path& folder,
                                            const std::string& name) {
  std::ifstream in = open_reference(folder, name);
  std::ostringstream text;
  text << in.rdbuf();
  return calib::sparse::parse_folds(text.str()).value();
}

/// One call of ncvreg: its arguments and its results.
struct ReferencePath {
  calib::sparse::Penalty penalty;
  calib::sparse::PathOptions options;
  std::vector<long> sweeps;
  Eigen::MatrixXd coefficients;  ///< 46 x lambda, intercept first
};

/// Rows of equal penalty, gamma and tolerance are consecutive. With 1e6 sweeps no path ends early.
inline std::vector<ReferencePath> reference_paths(const std::filesystem::path& folder) {
  using calib::sparse::PenaltyKind;
  const Table table = read_table(folder, "ncvreg_paths.csv");
  std::vector<ReferencePath> paths;
  const std::vector<std::string>* before = nullptr;

  for (const std::vector<std::string>& row : table.rows) {
    if (before == nullptr || !std::equal(row.begin(), row.begin() + 3, before->begin())) {
      ReferencePath& path = paths.emplace_back();
      const PenaltyKind kind = row[0] == "SCAD"  ? PenaltyKind::Scad
                               : row[0] == "MCP" ? PenaltyKind::Mcp
                                                 : PenaltyKind::Lasso;
      path.penalty = {kind, number(row[1])};
      path.options.tolerance = number(row[2]);
      path.options.max_sweeps = 1000000;
      path.coefficients.resize(static_cast<Eigen::Index>(row.size()) - 5, 0);
    }
    before = &row;
    ReferencePath& path = paths.back();
    path.options.lambda.push_back(number(row[3]));
    path.sweeps.push_back(std::strtol(row[4].c_str(), nullptr, 10));
    path.coefficients.conservativeResize(Eigen::NoChange, path.coefficients.cols() + 1);
    for (std::size_t j = 5; j < row.size(); ++j) {
      path.coefficients(static_cast<Eigen::Index>(j) - 5, path.coefficients.cols() - 1) =
          number(row[j]);
    }
  }

  return paths;
}

/// cv.ncvreg at 50 gammas: SCAD, tolerance 1e-4, 10000 sweeps.
struct ReferenceGrid {
  std::vector<double> gamma;
  calib::sparse::PathOptions options;
  Eigen::MatrixXd error;  ///< lambda x gamma; NaN: missing
};
inline ReferenceGrid reference_grid(const std::filesystem::path& folder, const std::string& name) {
  const Table table = read_table(folder, name + "_cve.csv");
  const Eigen::MatrixXd cells = numbers(table);
  ReferenceGrid grid;
  for (std::size_t g = 1; g < table.heading.size(); ++g) {
    grid.gamma.push_back(number(table.heading[g]));
  }
  grid.options.lambda.assign(cells.col(0).begin(), cells.col(0).end());
  grid.error = cells.rightCols(cells.cols() - 1);
  return grid;
}

}  // namespace abbe::tests::sparse
