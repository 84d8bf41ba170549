#include "abbe/calib/otf/run/smoothness.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "abbe/calib/estimation/row_batch.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/otf/run/about_bends.hpp"
#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

/// Probability that a bend or table is left out although all errors are as smooth as stated.
constexpr double kSmoothFalseAlarm = 1e-3;

/// The largest size of the prior that can be stated.
constexpr double kWidestBend_m = 1e-3;

/// For each table: indices of its bends to which the prior is applied.
std::vector<std::vector<Eigen::Index>> rows_of_tables(const AboutBends& about,
                                                      const Smoothness& s) {
  std::vector<std::vector<Eigen::Index>> tables;
  std::optional<ErrorMotion> last;
  for (std::size_t i = 0; i < about.bends.size(); ++i) {
    if (!last || !(*last == about.bends[i].motion)) {
      last = about.bends[i].motion;
      tables.emplace_back();
    }
    if (!is_left_out(s, about.bends[i])) {
      tables.back().push_back(static_cast<Eigen::Index>(i));
    }
  }
  std::erase_if(tables, [](const auto& rows) { return rows.empty(); });
  return tables;
}

/// Estimate of a bend, divided by its standard deviation under the prior; nullopt if the data
/// hardly determine the bend.
std::optional<double> times_sigma(const BendPosterior& p, Eigen::Index i) {
  constexpr double kLeast = 1e-3;  // least share of the variance that the data explain
  const double variance = 1.0 - p.Q(i, i);
  return variance > kLeast ? std::optional(std::abs(p.mean(i)) / std::sqrt(variance))
                           : std::nullopt;
}

/// The bend that agrees least with the prior, if this is significant; else nullopt. Only the
/// largest bend is returned: a step also increases the estimated bends of other tables, because the
/// data do not separate all of them.
std::optional<Bend> sharpest(const AboutBends& about, const Smoothness& s, const BendPosterior& p,
                             const std::vector<Eigen::Index>& rows, double limit) {
  std::optional<Bend> found;
  for (const Eigen::Index i : rows) {
    const double times = times_sigma(p, i).value_or(0.0);
    if (times > (found ? found->times : 0.0) &&
        log_chi2_tail(times * times, 1) < natural_logarithm(limit)) {
      const TableBend& bend = about.bends[static_cast<std::size_t>(i)];
      found =
          Bend{bend.motion, bend.position_m, bend.from_m, bend.to_m, p.mean(i) * sigma_of(s, bend),
               times};
    }
  }
  return found;
}

/// True if the sum of squares of all bends of a table is significantly too large. The sum is
/// compared with a scaled chi-square distribution of the same mean and variance [Satterthwaite
/// 1946].
bool is_rough(const BendPosterior& p, const std::vector<Eigen::Index>& rows, double limit) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  const Eigen::MatrixXd B = Eigen::MatrixXd::Identity(n, n) - Eigen::MatrixXd(p.Q(rows, rows));
  const double mean = B.trace(), half_variance = B.squaredNorm();
  const double sum = Eigen::VectorXd(p.mean(rows)).squaredNorm();
  if (!(mean > 0.0 && half_variance > 0.0)) {
    return false;
  }
  const double dof = std::max(1.0, std::round(mean * mean / half_variance));
  return log_chi2_tail(sum * dof / mean, static_cast<std::size_t>(dof)) < natural_logarithm(limit);
}

/// Number of independent bends whose sum of squares would have the same variance as that of these
/// correlated bends; see is_rough().
double independent_bends(const BendPosterior& p, const std::vector<Eigen::Index>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(n, n) - Eigen::MatrixXd(p.Q(rows, rows));
  const Eigen::VectorXd scale = correlation.diagonal().cwiseSqrt().cwiseInverse();
  correlation = (scale.asDiagonal() * correlation * scale.asDiagonal()).eval();
  return static_cast<double>(n * n) / correlation.squaredNorm();
}

/// True if significantly more than half of the determined bends exceed the median of their absolute
/// values under the prior. The test does not react to a few steps. It uses the binomial
/// distribution for independent_bends() bends.
bool is_too_narrow(const BendPosterior& p, const std::vector<Eigen::Index>& rows) {
  constexpr double kMedian = 0.6745;  // of |bend|, in standard deviations
  constexpr double kNormal999 = 3.090;
  constexpr double kFewest = 20.0;
  std::vector<Eigen::Index> determined;
  double above = 0.0;
  for (const Eigen::Index i : rows) {
    if (const std::optional<double> times = times_sigma(p, i)) {
      determined.push_back(i);
      above += *times > kMedian ? 1.0 : 0.0;
    }
  }
  if (static_cast<double>(determined.size()) < kFewest) {
    return false;
  }

  const double n = independent_bends(p, determined);
  const double excess = n * (above / static_cast<double>(determined.size()) - 0.5);
  return excess - 0.5 > kNormal999 * 0.5 * std::sqrt(n);  // normal approximation with continuity
                                                          // correction
}

void leave_out_all(Smoothness& s, const AboutBends& about,
                   const std::vector<std::vector<Eigen::Index>>& tables) {
  s.sharp.clear();
  for (const std::vector<Eigen::Index>& rows : tables) {
    s.rough_tables.push_back(about.bends[static_cast<std::size_t>(rows.front())].motion);
  }
}

/// Leaves out the bends that agree least with the prior: the sharpest bend; if there is none, the
/// tables that are rough as a whole; if there are none, all tables if they are rough together.
/// Returns false if nothing was left out.
bool leave_out_next(Smoothness& s, const AboutBends& about, const BendPosterior& p) {
  const auto tables = rows_of_tables(about, s);
  const double per_bend = kSmoothFalseAlarm / static_cast<double>(about.bends.size()),
               per_table =
                   kSmoothFalseAlarm / static_cast<double>(std::max<std::size_t>(1, tables.size()));
  std::vector<Eigen::Index> all;
  for (const std::vector<Eigen::Index>& rows : tables) {
    all.insert(all.end(), rows.begin(), rows.end());
  }
  if (is_too_narrow(p, all)) {
    leave_out_all(s, about, tables);
    return true;
  }

  if (std::optional<Bend> bend = sharpest(about, s, p, all, per_bend)) {
    s.sharp.push_back(*bend);
    return true;
  }

  bool added = false;
  for (const std::vector<Eigen::Index>& rows : tables) {
    if (is_rough(p, rows, per_table)) {
      s.rough_tables.push_back(about.bends[static_cast<std::size_t>(rows.front())].motion);
      added = true;
    }
  }
  if (!added && is_rough(p, all, kSmoothFalseAlarm)) {
    leave_out_all(s, about, tables);
    return true;
  }
  return added;
}

/// Replaces many sharp bends of a table by an entry for the whole table.
void join_sharp_bends(Smoothness& s, const AboutBends& about) {
  constexpr double kMany = 0.25;
  for (const TableBend& bend : about.bends) {
    const auto is_of_table = [&](const auto& b) { return b.motion == bend.motion; };
    const auto sharp = std::count_if(s.sharp.begin(), s.sharp.end(), is_of_table),
               all = std::count_if(about.bends.begin(), about.bends.end(), is_of_table);
    constexpr std::ptrdiff_t kFew = 4;  // bends of two steps
    if (sharp > kFew && static_cast<double>(sharp) > kMany * static_cast<double>(all)) {
      std::erase_if(s.sharp, is_of_table);
      s.rough_tables.push_back(bend.motion);
    }
  }
}

}  // namespace

Smoothness first_smoothness(const SmoothnessOptions& options) {
  Smoothness s{.bend_m = options.bend_m};
  for (double& bend_m : s.bend_m) {
    bend_m = bend_m > 0.0 ? kWidestBend_m : 0.0;
  }
  return s;
}

void add_smoothness(estimation::Information& data, const TableBasis& basis, const Smoothness& s) {
  estimation::RowBatch batch(data.unknowns());
  for (const TableBend& bend : bends_of(basis.layout())) {
    if (is_left_out(s, bend)) {
      continue;
    }
    batch.append(bend.row, 0.0, std::sqrt(s.variance_factor) / sigma_of(s, bend));
    if (batch.full()) {
      data.add(batch);
    }
  }
  data.add(batch);
}

Smoothness smoothness_for(const estimation::Information& data, const TableBasis& basis,
                          const SmoothnessOptions& options, double variance_factor) {
  Smoothness s{.bend_m = options.bend_m, .variance_factor = variance_factor};
  const AboutBends about = about_bends(data, basis, variance_factor);

  constexpr int kMostRounds = 40;
  BendPosterior p;
  for (int round = 0; round < kMostRounds; ++round) {
    p = posterior_of(about, s);
    if (!leave_out_next(s, about, p)) {
      break;
    }
    join_sharp_bends(s, about);
  }

  for (const std::vector<Eigen::Index>& rows : rows_of_tables(about, s)) {
    for (const Eigen::Index i : rows) {
      ++s.rows;
      s.chi2 += p.mean(i) * p.mean(i);
      s.expected_chi2 += 1.0 - p.Q(i, i);
    }
  }
  return s;
}

Result<Smoothness> permitted_smoothness(
    const estimation::Information& data, const TableBasis& basis, const SmoothnessOptions& options,
    double first_factor, const std::function<Result<double>(const Smoothness&)>& factor_with) {
  constexpr int kMostRounds = 4;  // rounds are enough: the variance factor depends little on a
                                  // permitted prior
  Smoothness s = smoothness_for(data, basis, options, first_factor);
  for (int round = 1;; ++round) {
    const Result<double> factor = factor_with(s);
    ABBE_TRY(factor);
    Smoothness next = smoothness_for(data, basis, options, *factor);
    if (is_same(next, s) || round == kMostRounds) {
      return s;
    }
    s = std::move(next);
  }
}

bool is_same(const Smoothness& a, const Smoothness& b) {
  constexpr double kSame = 1e-2;
  const auto near = [](double x, double y) { return std::abs(x - y) <= kSame * std::abs(y); };
  return std::equal(a.bend_m.begin(), a.bend_m.end(), b.bend_m.begin(), near) &&
         near(std::sqrt(a.variance_factor), std::sqrt(b.variance_factor)) &&
         a.rough_tables == b.rough_tables &&
         std::equal(a.sharp.begin(), a.sharp.end(), b.sharp.begin(), b.sharp.end(),
                    [](const Bend& x, const Bend& y) {
                      return x.motion == y.motion && x.position_m == y.position_m;
                    });
}

std::string size_text(const Smoothness& s) {
  const auto um = [](double bend_m) {
    return bend_m > 0.0 ? message(kUmPerM * bend_m, " um") : std::string("none");
  };
  if (s.bend_m[0] == s.bend_m[1] && s.bend_m[1] == s.bend_m[2]) {
    return um(s.bend_m[0]);
  }
  return message(um(s.bend_m[0]), " (X), ", um(s.bend_m[1]), " (Y), ", um(s.bend_m[2]), " (Z)");
}

std::vector<std::string> notes_on(const Smoothness& s) {
  std::vector<std::string> notes{message(
      "a prior for smooth tables was used: standard deviation of the bend over three nodes 50 mm "
      "apart ",
      size_text(s),
      ", as stated, twice as many urad for angles; the uncertainties hold for errors as smooth as "
      "that")};

  std::string sharp, rough;
  for (const Bend& b : s.sharp) {
    sharp +=
        message(sharp.empty() ? "" : ", ", name(b.motion), " at ", kMmPerM * b.position_m,
                " mm (bend ", kUmPerM * b.value, is_rotation(b.motion.motion) ? " urad, " : " um, ",
                b.times, " times its standard deviation)");
  }
  for (const ErrorMotion& motion : s.rough_tables) {
    rough += message(rough.empty() ? "" : ", ", name(motion));
  }
  if (!sharp.empty()) {
    notes.push_back("the errors are not as smooth as the prior: " + sharp +
                    "; there the prior is not used");
  }
  if (!rough.empty()) {
    notes.push_back("tables that are rougher than the prior, and were computed without it: " +
                    rough + "; state a larger value, or do not use the prior");
  }
  return notes;
}

}  // namespace abbe::calib::otf
