#include "solve/repeated_residuals.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::otf {
namespace {

/// Products of independent legs after subtraction of their expectation for noise alone, stored by
/// pair of legs.
class Products {
 public:
  Products(std::size_t components, std::size_t legs)
      : sums_(components, Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(legs),
                                                static_cast<Eigen::Index>(legs))) {}

  void add(std::size_t g, std::size_t h, const Eigen::VectorXd& products) {
    for (std::size_t c = 0; c < sums_.size(); ++c) {
      sums_[c](static_cast<Eigen::Index>(g), static_cast<Eigen::Index>(h)) +=
          products(static_cast<Eigen::Index>(c));
    }
  }
  /// Sum of the products divided by its standard deviation under the hypothesis that it is zero.
  /// The products of one pair of legs may be correlated; those of different pairs are not.
  [[nodiscard]] double deviations(std::size_t component) const {
    const double squares = sums_[component].squaredNorm();
    return squares > 0.0 ? sums_[component].sum() / std::sqrt(squares) : 0.0;
  }
  /// Natural logarithm of the probability of a larger sum by chance. Hypothesis: every leg has a
  /// random sign, common to all its sections. The sum has the standard deviation s of deviations()
  /// and the third moment tr(P^3), P: symmetric matrix of the products. Its distribution is
  /// approximately that of (chi-square - k) s / sqrt(2 k) with k = 8 s^6 / tr(P^3)^2 degrees of
  /// freedom. A few legs with equal residuals have k = 1, with much larger tails than a normal
  /// distribution.
  [[nodiscard]] double log_p(std::size_t component) const {
    constexpr double kNotRare = 3.0, kMostDegrees = 1e4;
    const double d = deviations(component);
    if (d < kNotRare) {
      return 0.0;
    }
    const Eigen::MatrixXd P = sums_[component] + sums_[component].transpose();
    const double third = (P * P).cwiseProduct(P).sum(), s = sums_[component].norm();
    const double k = third > 0.0 ? 8.0 * (s * s * s / third) * (s * s * s / third) : kMostDegrees;
    const double degrees = std::floor(std::clamp(k, 1.0, kMostDegrees));
    return log_chi2_tail(degrees + d * std::sqrt(2.0 * degrees), static_cast<std::size_t>(degrees));
  }
  Products& operator+=(const Products& other) {
    for (std::size_t c = 0; c < sums_.size(); ++c) {
      sums_[c] += other.sums_[c];
    }
    return *this;
  }

 private:
  std::vector<Eigen::MatrixXd> sums_;
};

/// Slow noise is independent after this many correlation times: its correlation is below 2 %.
constexpr double kCorrelationTimes = 4.0;

double time_of(const Observations& o, const Observation& row) {
  return row.segment < o.segment_s.size() ? o.segment_s[row.segment]
                                          : static_cast<double>(row.segment);
}

/// Index of the group of each leg. Consecutive legs form a group if they are within half of the
/// time after which slow noise is independent. Otherwise the products of a leg with each of them
/// would be nearly equal, and their sum would seem significant. On a long path further legs are
/// combined, because the products of all pairs need memory.
std::vector<std::size_t> groups_of_legs(const Observations& o, double correlation_time) {
  constexpr std::size_t kMostGroups = 200;
  const std::size_t legs = o.rows.empty() ? 0 : o.rows.back().leg + 1;
  std::vector<double> begin(legs, std::numeric_limits<double>::infinity());
  for (const Observation& row : o.rows) {
    begin[row.leg] = std::min(begin[row.leg], time_of(o, row));
  }

  const double least_time = 0.5 * kCorrelationTimes * correlation_time;
  const std::size_t least_legs = 1 + legs / kMostGroups;
  std::vector<std::size_t> group_of(legs, 0);
  std::size_t group = 0;
  std::optional<std::size_t> first;
  for (std::size_t leg = 0; leg < legs; ++leg) {
    if (!std::isfinite(begin[leg])) {
      continue;  // a leg without rows
    }
    if (!first) {
      first = leg;
    } else if (leg - *first >= least_legs && begin[leg] - begin[*first] >= least_time) {
      ++group;
      first = leg;
    }
    group_of[leg] = group;
  }
  return group_of;
}

/// Solves K x = q approximately with x >= 0: unknowns that become negative are set to zero.
Eigen::VectorXd not_negative(const Eigen::MatrixXd& K, const Eigen::VectorXd& q) {
  std::vector<Eigen::Index> kept;
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    if (K(i, i) > 0.0) {
      kept.push_back(i);
    }
  }
  Eigen::VectorXd x = Eigen::VectorXd::Zero(q.size());
  while (!kept.empty()) {
    const Eigen::VectorXd found =
        Eigen::MatrixXd(K(kept, kept)).completeOrthogonalDecomposition().solve(q(kept));
    Eigen::Index least = 0;
    if (found.minCoeff(&least) >= 0.0) {
      x(kept) = found;
      break;
    }
    kept.erase(kept.begin() + least);
  }
  return x;
}

}  // namespace

RepeatedResiduals::RepeatedResiduals(const Places& places, std::span<const ResidualsOfRun> runs,
                                     std::size_t unknowns)
    : components_(places.components),
      cells_(places.cells),
      sections_(places.sections),
      cell_of_(places.sections, 0) {
  for (std::size_t k = 0; k < runs.size(); ++k) {
    add_run(places, runs[k], k, unknowns);
  }
}

void RepeatedResiduals::add_run(const Places& places, const ResidualsOfRun& run, std::size_t number,
                                std::size_t unknowns) {
  const Observations& o = run.o;
  const std::size_t first = legs_.size();
  const auto n = static_cast<Eigen::Index>(components_);
  const std::vector<std::size_t> group_of_leg = groups_of_legs(o, run.correlation_time);

  Eigen::VectorXd x(n);
  std::vector<double> rows_of_leg;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    const std::size_t leg = first + group_of_leg[row.leg];
    while (legs_.size() <= leg) {
      legs_.push_back({.run = number, .far = kCorrelationTimes * run.correlation_time});
      rows_of_leg.push_back(0.0);
    }
    legs_[leg].time += time_of(o, row);
    rows_of_leg[leg - first] += 1.0;

    const Section at = places.section_of(row);
    places.effect(o, i, x);
    cell_of_[at.index] = at.cell;
    std::vector<OfLeg>& legs = sections_[at.index];
    if (legs.empty() || legs.back().leg != leg) {
      if (!legs.empty()) {
        legs.back().column_of = {};  // no longer needed; it takes most of the memory
      }
      legs.push_back({.leg = leg,
                      .b = Eigen::VectorXd::Zero(n),
                      .n = Eigen::MatrixXd::Zero(n, n),
                      .unknowns = {},
                      .B = {},
                      .column_of = std::vector<std::size_t>(unknowns, 0)});
    }
    OfLeg& sums = legs.back();
    const double weight = 1.0 / (row.sigma_m * row.sigma_m);
    sums.b += weight * run.residual_m[i] * x;
    sums.n += weight * x * x.transpose();
    for (const SparseRows::Entry& e : o.A.row(i)) {
      double* const column = sums.column(run.at[e.column]);
      for (Eigen::Index k = 0; k < n; ++k) {
        column[k] += weight * e.value * x(k);
      }
    }
  }
  for (std::size_t k = 0; k < rows_of_leg.size(); ++k) {
    legs_[first + k].time /= std::max(1.0, rows_of_leg[k]);
  }
}

double* RepeatedResiduals::OfLeg::column(std::size_t unknown) {
  const auto components = static_cast<std::size_t>(b.size());
  if (column_of[unknown] == 0) {
    unknowns.push_back(unknown);
    B.resize(B.size() + components, 0.0);
    column_of[unknown] = unknowns.size();
  }
  return B.data() + components * (column_of[unknown] - 1);
}

Eigen::MatrixXd RepeatedResiduals::times(const Eigen::MatrixXd& C, const OfLeg& leg) {
  Eigen::MatrixXd CB = Eigen::MatrixXd::Zero(C.rows(), leg.b.size());
  const double* value = leg.B.data();
  for (const std::size_t unknown : leg.unknowns) {
    for (Eigen::Index k = 0; k < CB.cols(); ++k) {
      CB.col(k) += *value++ * C.col(static_cast<Eigen::Index>(unknown));
    }
  }
  return CB;
}

Eigen::VectorXd RepeatedResiduals::with_other(const Eigen::MatrixXd& CB, const OfLeg& other) {
  Eigen::VectorXd products = Eigen::VectorXd::Zero(CB.cols());
  const double* value = other.B.data();
  for (const std::size_t unknown : other.unknowns) {
    for (Eigen::Index k = 0; k < CB.cols(); ++k) {
      products(k) += *value++ * CB(static_cast<Eigen::Index>(unknown), k);
    }
  }
  return products;
}

bool RepeatedResiduals::are_independent(const OfLeg& a, const OfLeg& b) const {
  const Leg &g = legs_[a.leg], &h = legs_[b.leg];
  return g.run != h.run || (a.leg != b.leg && std::abs(g.time - h.time) > g.far);
}

Eigen::MatrixXd RepeatedResiduals::variances(const Eigen::MatrixXd& of_noise) const {
  // Limits of the probability by chance: of a component in all cells together, and in one of many
  // cells.
  constexpr double kChanceOfAll = 1e-4, kChanceOfCell = 1e-5;
  constexpr double kLikely = 2.0;  // in standard deviations
  const double log_all = natural_logarithm(kChanceOfAll),
               log_cell = natural_logarithm(kChanceOfCell);
  const auto n = static_cast<Eigen::Index>(components_);
  const auto cells = static_cast<Eigen::Index>(cells_);
  Products all(components_, legs_.size());
  std::vector<Eigen::MatrixXd> K(cells_, Eigen::MatrixXd::Zero(n, n));
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(n, cells), log_p = q;

  for (std::size_t cell = 0; cell < cells_; ++cell) {
    Products products(components_, legs_.size());
    for (std::size_t s = 0; s < sections_.size(); ++s) {
      if (cell_of_[s] != cell) {
        continue;
      }
      const std::vector<OfLeg>& legs = sections_[s];
      for (std::size_t g = 0; g < legs.size(); ++g) {
        Eigen::MatrixXd CB;
        for (std::size_t h = g + 1; h < legs.size(); ++h) {
          if (!are_independent(legs[g], legs[h])) {
            continue;
          }
          if (CB.size() == 0) {
            CB = times(of_noise, legs[g]);
          }
          const Eigen::VectorXd product =
              legs[g].b.cwiseProduct(legs[h].b) + with_other(CB, legs[h]);
          products.add(legs[g].leg, legs[h].leg, product);
          q.col(static_cast<Eigen::Index>(cell)) += product;
          K[cell] += legs[g].n.cwiseProduct(legs[h].n);
        }
      }
    }
    for (std::size_t c = 0; c < components_; ++c) {
      log_p(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(cell)) = products.log_p(c);
    }
    all += products;
  }

  Eigen::MatrixXd variances = Eigen::MatrixXd::Zero(n, cells);
  bool beyond_chance = (log_p.array() < log_cell).any();
  for (std::size_t c = 0; c < components_; ++c) {
    beyond_chance = beyond_chance || all.log_p(c) < log_all;
  }
  if (!beyond_chance) {
    return variances;
  }
  for (Eigen::Index cell = 0; cell < cells; ++cell) {
    const Eigen::VectorXd found = not_negative(K[static_cast<std::size_t>(cell)], q.col(cell));
    for (std::size_t c = 0; c < components_; ++c) {
      const auto k = static_cast<Eigen::Index>(c);
      if (all.deviations(c) > kLikely || log_p(k, cell) < log_cell) {
        variances(k, cell) = found(k);
      }
    }
  }
  return variances;
}

Eigen::MatrixXd RepeatedResiduals::root_of_covariance(const Eigen::MatrixXd& variances,
                                                      const Eigen::MatrixXd& Q) const {
  std::vector<Eigen::VectorXd> columns;
  for (std::size_t s = 0; s < sections_.size(); ++s) {
    for (std::size_t c = 0; c < components_; ++c) {
      const auto k = static_cast<Eigen::Index>(c);
      const double variance = variances(k, static_cast<Eigen::Index>(cell_of_[s]));
      if (variance <= 0.0 || sections_[s].empty()) {
        continue;
      }
      Eigen::VectorXd g = Eigen::VectorXd::Zero(Q.rows());
      for (const OfLeg& leg : sections_[s]) {
        for (std::size_t j = 0; j < leg.unknowns.size(); ++j) {
          g(static_cast<Eigen::Index>(leg.unknowns[j])) += leg.B[components_ * j + c];
        }
      }
      columns.emplace_back(std::sqrt(variance) * (Q * g));
    }
  }
  Eigen::MatrixXd root(Q.rows(), std::ssize(columns));
  for (Eigen::Index i = 0; i < root.cols(); ++i) {
    root.col(i) = columns[static_cast<std::size_t>(i)];
  }
  return root;
}

double RepeatedResiduals::length_in_sections(const Eigen::MatrixXd& variances,
                                             std::size_t component) const {
  const auto k = static_cast<Eigen::Index>(component);
  std::vector<double> value(sections_.size(), 0.0);
  double sum = 0.0, used = 0.0;
  for (std::size_t s = 0; s < sections_.size(); ++s) {
    double b = 0.0, n = 0.0;
    for (const OfLeg& leg : sections_[s]) {
      b += leg.b(k);
      n += leg.n(k, k);
    }
    value[s] = n > 0.0 ? b / n : 0.0;
    if (n > 0.0) {
      sum += variances(k, static_cast<Eigen::Index>(cell_of_[s]));
      used += 1.0;
    }
  }
  const double variance = sum / std::max(1.0, used);
  double before = 1.0;
  for (std::size_t lag = 1; lag < sections_.size(); ++lag) {
    double products = 0.0;
    for (std::size_t s = 0; s + lag < sections_.size(); ++s) {
      products += value[s] * value[s + lag];
    }
    const double correlation =
        variance > 0.0 ? products / static_cast<double>(sections_.size() - lag) / variance : 0.0;
    constexpr double kHalf = 0.5;
    if (correlation < kHalf) {
      const double into = before > correlation ? (before - kHalf) / (before - correlation) : 1.0;
      return static_cast<double>(lag) - 1.0 + std::clamp(into, 0.0, 1.0);
    }
    before = correlation;
  }
  return static_cast<double>(sections_.size());
}

}  // namespace abbe::calib::otf
