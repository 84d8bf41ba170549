#include "explanations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "directed.hpp"

namespace abbe::calib::joint {
namespace {

constexpr std::size_t kMostExplanations = 3, kMostTables = 3;

/// Limit of the probability of the disagreement that remains under an explanation. The probability
/// must be larger than kLikely, and larger than the limit of the test (no contradiction).
double least_likely(const PairTest& test) {
  constexpr double kLikely = 1e-3;
  return std::max(kLikely, test.all.limit);
}

bool agrees(const Disagreement& d, double least) {
  return d.dof == 0 || d.log_p > natural_logarithm(least);
}

/// Sorts the explanations so that the best one is first.
void sort_by_fit(std::vector<Explanation>& all) {
  std::stable_sort(all.begin(), all.end(),
                   [](const Explanation& a, const Explanation& b) { return a.log_p < b.log_p; });
}

DeterminingRows with_reversed_sign(DeterminingRows rows) {
  rows.z = -rows.z;
  return rows;
}

DeterminingRows with_reversed_table(DeterminingRows rows, const DatumGroup& group) {
  rows.A.middleCols(group.first, group.size) *= -1.0;
  return rows;
}

/// Rows for the hypothesis that true values = factor * given values; the noise is multiplied, too.
DeterminingRows with_unit(DeterminingRows rows, double factor) {
  rows.A /= factor;
  return rows;
}

/// Tests mistakes that no unknown describes, such as a wrong sign or unit.
class Hypotheses {
 public:
  Hypotheses(const PairProblem& pair, const Part& i, const Part& j, double least)
      : pair_(pair), i_(i), j_(j), least_(least) {}

  void add_signs(const DatumCoordinates& c) {
    test("the sign of V is reversed in " + i_.name + " or in " + j_.name, pair_.of_i(),
         with_reversed_sign(pair_.of_j()));
    for (const DatumGroup& group : c.groups) {
      if (group.size > 0) {
        test("the sign of " + group.name + " is reversed in " + i_.name + " or in " + j_.name,
             pair_.of_i(), with_reversed_table(pair_.of_j(), group));
      }
    }
  }

  void add_units() {
    constexpr std::array<double, 4> kFactors{1e3, 1e-3, 25.4, 1.0 / 25.4};
    for (const double factor : kFactors) {
      test(message("the errors of ", i_.name, " are too small by a factor of ", factor, " (unit)"),
           with_unit(pair_.of_i(), factor), pair_.of_j());
      test(message("the errors of ", j_.name, " are too small by a factor of ", factor, " (unit)"),
           pair_.of_i(), with_unit(pair_.of_j(), factor));
    }
  }

  void add_mistakes_of_methods() {
    for (const Mistake& m : i_.mistakes ? i_.mistakes() : std::vector<Mistake>{}) {
      const double given = pair_.squares(pair_.rows(i_, m.as_given), pair_.of_j());
      test(i_.name + ": " + m.text, pair_.rows(i_, m.information), pair_.of_j(), given);
    }
    for (const Mistake& m : j_.mistakes ? j_.mistakes() : std::vector<Mistake>{}) {
      const double given = pair_.squares(pair_.of_i(), pair_.rows(j_, m.as_given));
      test(j_.name + ": " + m.text, pair_.of_i(), pair_.rows(j_, m.information), given);
    }
  }

  /// The best explanations, at most kMostExplanations.
  [[nodiscard]] std::vector<Explanation> best() {
    sort_by_fit(found_);
    found_.resize(std::min(kMostExplanations, found_.size()));
    return found_;
  }

 private:
  void test(std::string text, const DeterminingRows& i, const DeterminingRows& j) {
    test(std::move(text), i, j, given_);
  }
  /// Tests a hypothesis with the rows i and j. `given`: sum of squares of the parts as given. The
  /// hypothesis must have a smaller sum.
  void test(std::string text, const DeterminingRows& i, const DeterminingRows& j, double given) {
    const double log_p = log_chi2_tail(given - pair_.squares(i, j), 1);
    if (log_p < 0.0 && agrees(pair_.disagreement(i, j), least_)) {
      found_.push_back({std::move(text), log_p});
    }
  }

  const PairProblem& pair_;
  const Part &i_, &j_;
  double least_ = 0.0;
  double given_ = pair_.squares(pair_.of_i(), pair_.of_j());
  std::vector<Explanation> found_;
};

/// Text such as "lengths of j are larger than those of i by 20.3 um/m (u 1.7 um/m)".
std::string text_of(const Direction& direction, const PairProblem::Freed& freed, const Part& i,
                    const Part& j) {
  const std::string size =
      message(" by ", freed.d(0) * kUmPerM, direction.is_angle ? " urad (u " : " um/m (u ",
              freed.root_cov_d.norm() * kUmPerM, direction.is_angle ? " urad)" : " um/m)");
  if (direction.name == kLength) {
    return message("lengths of ", j.name, " are larger than those of ", i.name, size,
                   ": temperature, expansion or unit of a length, ranges of the tracker");
  }
  return message("the ", direction.name, " of ", j.name, " is larger than that of ", i.name, size);
}

/// Adds the explanation by a difference in one direction: that direction which fits best.
void explain_by_directions(PairTest& test, const PairProblem& pair, const Part& i, const Part& j,
                           const DatumCoordinates& c, const ParameterLayout& layout) {
  std::optional<Explanation> best;
  double best_excess = 0.0;  // distance from the limit as in the directed tests
  for (const Direction& direction : directions(c, layout)) {
    const PairProblem::Freed freed = pair.freed(direction.column);
    const double log_p = log_chi2_tail(freed.drop, 1);
    const double excess = natural_logarithm(direction.share) - log_p;
    if (freed.drop_dof == 1 && agrees(freed.left, least_likely(test)) &&
        (!best || excess > best_excess)) {
      best = Explanation{text_of(direction, freed, i, j), log_p};
      best_excess = excess;
    }
  }
  if (best) {
    test.explanations.push_back(*std::move(best));
  }
}

TableDifference difference_of(const DatumGroup& group, const DatumCoordinates& c,
                              const PairProblem::Freed& freed, Eigen::Index first,
                              const ParameterLayout& layout) {
  TableDifference result{.table = group.name, .is_angle = group.is_angle()};
  const Eigen::MatrixXd N = c.N.block(group.offset, group.first, group.count, group.size);
  const Eigen::VectorXd values = N * freed.d.segment(first, group.size);
  const Eigen::MatrixXd root = N * freed.root_cov_d.middleRows(first, group.size);
  Eigen::Index at = 0;
  values.cwiseAbs().maxCoeff(&at);
  result.difference = values(at);
  result.u = root.row(at).norm();
  if (group.motion) {
    result.position_m =
        layout.nodes()[index(group.motion->axis)].nodes_m[static_cast<std::size_t>(at)];
  }
  return result;
}

/// Columns that let the coordinates of the given tables change independently.
Eigen::MatrixXd columns_of(const std::vector<const DatumGroup*>& tables, Eigen::Index m) {
  Eigen::Index size = 0;
  for (const DatumGroup* group : tables) {
    size += group->size;
  }
  Eigen::MatrixXd free = Eigen::MatrixXd::Zero(m, size);
  Eigen::Index at = 0;
  for (const DatumGroup* group : tables) {
    free.block(group->first, at, group->size, group->size).setIdentity();
    at += group->size;
  }
  return free;
}

/// The table that decreases X2 most significantly if it may differ, in addition to the tables
/// `already` free.
const DatumGroup* most_significant_table(const PairProblem& pair, const DatumCoordinates& c,
                                         const std::vector<const DatumGroup*>& already,
                                         double least, ChiSquare& best_test) {
  const Eigen::Index m = c.N.cols();
  const PairProblem::Freed before = pair.freed(columns_of(already, m));
  const DatumGroup* best = nullptr;
  double best_log_p = 0.0;

  for (const DatumGroup& group : c.groups) {
    if (group.size == 0 || std::find(already.begin(), already.end(), &group) != already.end()) {
      continue;
    }
    std::vector<const DatumGroup*> tables = already;
    tables.push_back(&group);
    const PairProblem::Freed with = pair.freed(columns_of(tables, m));
    const double drop = with.drop - before.drop;
    const std::size_t dof = with.drop_dof - std::min(with.drop_dof, before.drop_dof);
    const double log_p = dof > 0 ? log_chi2_tail(drop, dof) : 0.0;
    if (best == nullptr || log_p < best_log_p) {
      best = &group;
      best_log_p = log_p;
      best_test = {drop, dof, exponential(log_p), least};
    }
  }
  return best;
}

void explain_by_tables(PairTest& test, const PairProblem& pair, const DatumCoordinates& c,
                       const ParameterLayout& layout) {
  const double least = least_likely(test);
  std::vector<const DatumGroup*> tables;
  std::vector<ChiSquare> tests;
  bool explained = false;
  while (!explained && tables.size() < kMostTables) {
    ChiSquare of_table;
    const DatumGroup* next = most_significant_table(pair, c, tables, least, of_table);
    if (next == nullptr || of_table.p > least) {
      break;
    }
    tables.push_back(next);
    tests.push_back(of_table);
    explained = agrees(pair.freed(columns_of(tables, c.N.cols())).left, least);
  }
  if (tables.empty()) {
    return;
  }

  const PairProblem::Freed freed = pair.freed(columns_of(tables, c.N.cols()));
  std::string names;
  Eigen::Index first = 0;
  for (std::size_t k = 0; k < tables.size(); ++k) {
    test.tables.push_back(difference_of(*tables[k], c, freed, first, layout));
    test.tables.back().test = tests[k];
    names += (k == 0 ? "" : ", ") + text(test.tables.back());
    first += tables[k]->size;
  }
  if (explained) {
    const double log_p = freed.drop_dof > 0 ? log_chi2_tail(freed.drop, freed.drop_dof) : 0.0;
    test.explanations.push_back({"they differ in " + names, log_p});
  }
}

}  // namespace

std::string text(const TableDifference& d) {
  const char* unit = d.is_angle ? " urad" : " um";
  const std::string place = d.position_m ? message(" at ", kMmPerM * *d.position_m, " mm") : "";
  std::ostringstream out;
  out << std::setprecision(3) << d.table << " by " << kUmPerM * d.difference << unit << place
      << " (u " << kUmPerM * d.u << unit << ")";
  return out.str();
}

void explain(PairTest& test, const PairProblem& pair, const Part& i, const Part& j,
             const DatumCoordinates& c, const ParameterLayout& layout) {
  Hypotheses mistakes(pair, i, j, least_likely(test));
  mistakes.add_signs(c);
  mistakes.add_units();
  mistakes.add_mistakes_of_methods();
  test.explanations = mistakes.best();
  explain_by_directions(test, pair, i, j, c, layout);
  explain_by_tables(test, pair, c, layout);
  sort_by_fit(test.explanations);
}

}  // namespace abbe::calib::joint
