#include "abbe/calib/model/model_drift.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib {
namespace {

/// Relative limit of rounding: the covariances have rounding errors of 1e-13 of their largest
/// entries. A column of a scaled matrix that is smaller than this fraction consists of rounding
/// errors.
constexpr double kRoundingOfCovariance = 1e-10;

/// Share of the false-alarm probability for the tests with one degree of freedom.
constexpr double kSmoothShare = 0.9;

Result<void> not_comparable(std::string_view what) {
  return failure(ErrorCode::NotApplicable, message("parameters of two models: ", what));
}

bool same_nodes(const AxisNodes& a, const AxisNodes& b) {
  constexpr double kSame_m = 1e-9;  // larger than the rounding of decimal numbers in files (mm)
  const auto same = [](double x_m, double y_m) { return std::abs(x_m - y_m) < kSame_m; };
  return std::equal(a.nodes_m.begin(), a.nodes_m.end(), b.nodes_m.begin(), b.nodes_m.end(), same) &&
         same(a.reference_m, b.reference_m);
}

bool same_tables(const ParameterLayout& a, const ParameterLayout& b) {
  return std::equal(
      a.tables().begin(), a.tables().end(), b.tables().begin(), b.tables().end(),
      [](const Table& x, const Table& y) { return x.motion == y.motion && x.offset == y.offset; });
}

bool holds_for_tools_of(const VolumetricModel& a, const VolumetricModel& b) {
  return std::all_of(b.tool_offsets_m().begin(), b.tool_offsets_m().end(),
                     [&](const Vector3& t) { return a.holds_for_tool(t); });
}

/// The difference of two models in whitened coordinates: w ~ N(0, I) if the machine has not
/// changed.
struct WhitenedDifference {
  DatumCoordinates coordinates;
  Eigen::VectorXd w;
  Eigen::MatrixXd W;  ///< change of w per unit of each coordinate
  std::size_t untested = 0;
};

Result<WhitenedDifference> whitened_difference(const VolumetricModel& run,
                                               const VolumetricModel& active) {
  WhitenedDifference d{.coordinates = datum_coordinates(*run.tables()), .w = {}, .W = {}};
  const Eigen::MatrixXd& N = d.coordinates.N;
  const Eigen::MatrixXd C = N.transpose() * (run.covariance() + active.covariance()) * N;
  const Eigen::VectorXd scale = C.diagonal().unaryExpr(
      [](double variance) { return variance > 0.0 ? 1.0 / std::sqrt(variance) : 1.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * C *
                                                             scale.asDiagonal());
  const Eigen::VectorXd& values = eigen.eigenvalues();  // in ascending order
  const Eigen::Index n = values.size();
  const double least = kRoundingOfCovariance * (n > 0 ? values(n - 1) : 0.0);
  const auto first = std::upper_bound(values.data(), values.data() + n, least) - values.data();
  if (first == n) {
    return failure(ErrorCode::NotApplicable,
                   "drift: neither model states an uncertainty of its parameters");
  }

  const Eigen::Index kept = n - first;
  d.untested = static_cast<std::size_t>(first);
  d.W = values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal() *
        eigen.eigenvectors().rightCols(kept).transpose() * scale.asDiagonal();
  d.w = d.W * (N.transpose() * (run.U() - active.U()));

  return d;
}

/// A test with the logarithm of its p. Large changes have p = 0 in double precision; the logarithm
/// still orders them.
struct Significance {
  ChiSquare test;
  double log_p = 0.0;
  bool smooth = false;

  [[nodiscard]] double excess() const { return natural_logarithm(test.limit) - log_p; }
  [[nodiscard]] bool alarms() const { return excess() > 0.0; }
};

Significance significance(double statistic, std::size_t dof, double limit, bool smooth) {
  const double log_p = dof > 0 ? log_chi2_tail(statistic, dof) : 0.0;
  return {{statistic, dof, exponential(log_p), limit}, log_p, smooth};
}

/// Limits of p for a test of each kind. Their sum over all tests is the probability of a false
/// alarm.
struct Limits {
  double smooth = 0.0, any = 0.0;
};

Limits limits_of(const DatumCoordinates& c, double false_alarm) {
  double smooth = 0.0, any = 1.0;  // any = 1: the test of all tables together
  for (const DatumGroup& group : c.groups) {
    smooth += group.size > 0 ? 1.0 : 0.0;
    any += group.size > 1 ? 1.0 : 0.0;
  }
  return {kSmoothShare * false_alarm / std::max(smooth, 1.0),
          (1.0 - kSmoothShare) * false_alarm / any};
}

/// Whitened columns of the tables that may have changed.
class Freed {
 public:
  Freed(const WhitenedDifference& d, const std::vector<bool>& drifted,
        const DatumGroup* except = nullptr) {
    std::vector<Eigen::Index> columns;
    for (std::size_t i = 0; i < drifted.size(); ++i) {
      const DatumGroup& group = d.coordinates.groups[i];
      for (Eigen::Index k = 0; drifted[i] && &group != except && k < group.size; ++k) {
        columns.push_back(group.first + k);
      }
    }
    if (columns.empty()) {
      return;
    }

    Eigen::MatrixXd A = d.W(Eigen::all, columns);
    A.colwise().normalize();
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
    qr.setThreshold(kRoundingOfCovariance);
    qr.compute(A);
    Q_ = qr.householderQ() * Eigen::MatrixXd::Identity(A.rows(), qr.rank());
  }

  [[nodiscard]] std::size_t dof() const { return static_cast<std::size_t>(Q_.cols()); }
  [[nodiscard]] Eigen::MatrixXd without(const Eigen::MatrixXd& A) const {
    return Q_.cols() > 0 ? Eigen::MatrixXd(A - Q_ * (Q_.transpose() * A)) : A;
  }

 private:
  Eigen::MatrixXd Q_;
};

/// The difference w and the columns W of a table after the other free tables have been fitted.
struct Projected {
  Eigen::VectorXd w;
  Eigen::MatrixXd W;

  Projected(const WhitenedDifference& d, const DatumGroup& group, const Freed& freed)
      : w(freed.without(d.w)), W(freed.without(d.W.middleCols(group.first, group.size))) {}
};

Significance smooth_test(const WhitenedDifference& d, const DatumGroup& group, const Projected& p,
                         const ParameterLayout& layout, double limit) {
  Eigen::VectorXd of_all = Eigen::VectorXd::Zero(d.coordinates.N.rows());
  of_all.segment(group.offset, group.count) = smooth_change(group, layout);
  const Eigen::VectorXd a = p.W * d.coordinates.of_group(group, of_all);
  const double squares = a.squaredNorm(), along = a.dot(p.w);
  return squares > 0.0 ? significance(along * along / squares, 1, limit, true)
                       : significance(0.0, 0, limit, true);
}

Eigen::ColPivHouseholderQR<Eigen::MatrixXd> decomposed(const Eigen::MatrixXd& W) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kRoundingOfCovariance);
  qr.compute(W);
  return qr;
}

Significance any_test(const Projected& p, double limit) {
  const auto qr = decomposed(p.W);
  const Eigen::VectorXd of_table = (qr.householderQ().adjoint() * p.w).head(qr.rank());
  return significance(of_table.squaredNorm(), static_cast<std::size_t>(qr.rank()), limit, false);
}

Significance most_significant(const WhitenedDifference& d, const DatumGroup& group,
                              const Freed& freed, const ParameterLayout& layout,
                              const Limits& limits) {
  const Projected p(d, group, freed);
  const Significance smooth = smooth_test(d, group, p, layout, limits.smooth);
  if (group.size < 2) {
    return smooth;
  }
  const Significance any = any_test(p, limits.any);
  return any.excess() > smooth.excess() ? any : smooth;
}

/// Estimates the change of a table at the position where it is largest.
void estimate_change(TableChange& change, const WhitenedDifference& d, const DatumGroup& group,
                     const Freed& freed, const ParameterLayout& layout) {
  const Projected p(d, group, freed);
  const auto qr = decomposed(p.W);
  const Eigen::Index rank = qr.rank();
  const auto R = qr.matrixQR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>();
  // Coordinates that the data do not determine stay 0.
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(group.size, rank);
  root.topRows(rank) = R.solve(Eigen::MatrixXd::Identity(rank, rank));
  root = qr.colsPermutation() * root;

  const Eigen::MatrixXd N =
      d.coordinates.N.block(group.offset, group.first, group.count, group.size);
  const Eigen::MatrixXd root_of_table = N * root;
  const Eigen::VectorXd of_table = (qr.householderQ().adjoint() * p.w).head(rank);
  const Eigen::VectorXd values = root_of_table * of_table;
  Eigen::Index at = 0;
  if (values.size() > 0) {
    values.cwiseAbs().maxCoeff(&at);
    change.change = values(at);
    change.u = root_of_table.row(at).norm();
  }
  if (group.motion) {
    change.position_m =
        layout.nodes()[index(group.motion->axis)].nodes_m[static_cast<std::size_t>(at)];
  }
}

ChiSquare rest_test(const WhitenedDifference& d, const Freed& freed, double limit) {
  const auto all = static_cast<std::size_t>(d.w.size());
  const std::size_t dof = all - std::min(all, freed.dof());
  return significance(freed.without(d.w).squaredNorm(), dof, limit, false).test;
}

/// Text such as " by 4.2 um at 300 mm (u 0.5 um)". `before_u`: text before the value of the
/// uncertainty.
std::string size_of(const TableChange& c, std::string_view before_u) {
  constexpr double kMicro = 1e6, kMmPerM = 1e3;
  const char* unit = c.is_angle ? " urad" : " um";
  const std::string place = c.position_m ? message(" at ", kMmPerM * *c.position_m, " mm") : "";
  // Three digits, because the values are not known more precisely.
  std::ostringstream out;
  out << std::setprecision(3) << " by " << kMicro * c.change << unit << place << " (" << before_u
      << kMicro * c.u << unit << ")";
  return out.str();
}

/// Takes the table with the most significant test as changed and repeats the tests, until no test
/// exceeds its limit.
std::vector<bool> find_drifted(const WhitenedDifference& d, const ParameterLayout& layout,
                               const Limits& limits, std::vector<Significance>& found) {
  const std::vector<DatumGroup>& groups = d.coordinates.groups;
  std::vector<bool> drifted(groups.size(), false);
  found.assign(groups.size(), {});

  for (std::size_t round = 0; round < groups.size(); ++round) {
    const Freed freed(d, drifted);
    std::size_t best = groups.size();
    for (std::size_t i = 0; i < groups.size(); ++i) {
      if (drifted[i] || groups[i].size == 0) {
        continue;
      }
      found[i] = most_significant(d, groups[i], freed, layout, limits);
      const bool larger = best == groups.size() || found[i].excess() > found[best].excess();
      best = found[i].alarms() && larger ? i : best;
    }
    if (best == groups.size()) {
      break;
    }
    drifted[best] = true;
  }

  return drifted;
}

}  // namespace

std::string text(const TableChange& c) {
  return message(c.table, " changed", size_of(c, "standard uncertainty "), ": chi-square ",
                 c.test.statistic, " with ", c.test.dof, c.test.dof == 1 ? " degree" : " degrees",
                 " of freedom, p ", c.test.p);
}

std::vector<std::string> DriftTest::drifted_tables() const {
  std::vector<std::string> names;
  for (const TableChange& change : tables) {
    if (change.drifted) {
      names.push_back(change.table);
    }
  }
  return names;
}

std::string text(const DriftTest& drift) {
  std::vector<const TableChange*> drifted;
  for (const TableChange& change : drift.tables) {
    if (change.drifted) {
      drifted.push_back(&change);
    }
  }
  std::stable_sort(drifted.begin(), drifted.end(), [](const auto* a, const auto* b) {
    return a->test.statistic > b->test.statistic;
  });

  constexpr std::size_t kMostNamed = 3;
  std::string all;
  for (std::size_t i = 0; i < std::min(kMostNamed, drifted.size()); ++i) {
    all += message(i == 0 ? "" : ", ", drifted[i]->table, size_of(*drifted[i], "u "));
  }
  if (drifted.size() > kMostNamed) {
    all += message(" and ", drifted.size() - kMostNamed, " more");
  }
  if (drift.drifted && drifted.empty()) {
    all = message("no single table explains the change: chi-square ", drift.all.statistic, " with ",
                  drift.all.dof, " degrees of freedom");
  }
  return all;
}

Result<void> check_same_parameters(const VolumetricModel& a, const VolumetricModel& b) {
  if (a.tables() == nullptr || b.tables() == nullptr) {
    return not_comparable("one of them is a polynomial model, not one of tables");
  }
  if (!is_of_tables(a.datum()) || !is_of_tables(b.datum())) {
    return not_comparable("one of them is not in datum G1 or G2");
  }

  if (a.chain().order_w_to_t() != b.chain().order_w_to_t() ||
      !same_tables(a.tables()->layout(), b.tables()->layout())) {
    return not_comparable(message("axes ", a.chain().text(), " with ",
                                  a.tables()->layout().tables().size(), " tables, and ",
                                  b.chain().text(), " with ", b.tables()->layout().tables().size(),
                                  ": other axes, tables or nodes"));
  }

  if (a.interpolation() != b.interpolation()) {
    return not_comparable("the tables of one of them are linear, those of the other cubic");
  }

  for (const Axis axis : kAllAxes) {
    const std::size_t i = index(axis);
    if (!same_nodes(a.tables()->layout().nodes()[i], b.tables()->layout().nodes()[i])) {
      return not_comparable(
          message("axis ", letter(axis), " has other nodes or another reference"));
    }
  }

  if (!holds_for_tools_of(a, b) || !holds_for_tools_of(b, a)) {
    return not_comparable(message("tool offsets ", mm_text(a.tool_offsets_m().front()), " and ",
                                  mm_text(b.tool_offsets_m().front()),
                                  ": the tables contain the effect of the tool"));
  }

  return {};
}

Result<DriftTest> test_drift(const VolumetricModel& run, const VolumetricModel& active,
                             const DriftOptions& options) {
  if (!(options.false_alarm > 0.0 && options.false_alarm < 1.0)) {
    return failure(ErrorCode::BadInput, message("drift: false-alarm probability ",
                                                options.false_alarm, " must be in (0, 1)"));
  }
  ABBE_TRY(check_same_parameters(run, active));

  const Result<WhitenedDifference> d = whitened_difference(run, active);
  ABBE_TRY(d);

  const ParameterLayout& layout = run.tables()->layout();
  const std::vector<DatumGroup>& groups = d->coordinates.groups;
  const Limits limits = limits_of(d->coordinates, options.false_alarm);
  std::vector<Significance> found;
  const std::vector<bool> drifted = find_drifted(*d, layout, limits, found);
  DriftTest result;
  result.untested = d->untested;

  for (std::size_t i = 0; i < groups.size(); ++i) {
    TableChange change{.table = groups[i].name,
                       .drifted = drifted[i],
                       .smooth = found[i].smooth,
                       .test = found[i].test,
                       .is_angle = groups[i].is_angle()};
    estimate_change(change, *d, groups[i], Freed(*d, drifted, &groups[i]), layout);
    result.drifted = result.drifted || drifted[i];
    result.tables.push_back(std::move(change));
  }

  result.all = rest_test(*d, Freed(*d, std::vector<bool>(groups.size(), false)), limits.any);
  result.rest = rest_test(*d, Freed(*d, drifted), limits.any);
  result.drifted = result.drifted || result.all.p < result.all.limit;

  return result;
}

bool shows_machine(const Verdict& verdict) {
  constexpr std::array<std::string_view, 3> kRelative{"held-out", "volume", "scale-change"};
  const HeldOutFigures& h = verdict.held_out;
  return h.observations > 0 && h.candidate < h.no_compensation &&
         std::all_of(verdict.causes.begin(), verdict.causes.end(), [&](const std::string& cause) {
           return std::find(kRelative.begin(), kRelative.end(), cause) != kRelative.end();
         });
}

}  // namespace abbe::calib
