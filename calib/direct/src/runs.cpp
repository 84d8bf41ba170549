#include "abbe/calib/direct/runs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <string>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::direct {
namespace {

constexpr std::size_t kForward = 0, kBackward = 1;

/// Values of one run: for every target one optional value per direction (forward, backward).
struct RunValues {
  std::map<std::size_t, std::array<std::optional<double>, 2>> at;

  [[nodiscard]] bool has(std::size_t travel) const {
    return std::any_of(at.begin(), at.end(),
                       [travel](const auto& entry) { return entry.second[travel].has_value(); });
  }
};

/// Positions of the targets, ascending. Positions that differ by less than kSameTarget_m are one
/// target, at the first of them.
std::vector<double> targets_of(const MeasuredError& error) {
  std::vector<double> positions;
  for (const Reading& r : error.readings) {
    positions.push_back(r.position_m);
  }
  std::sort(positions.begin(), positions.end());
  std::vector<double> targets;
  for (const double p : positions) {
    if (targets.empty() || p - targets.back() > kSameTarget_m) {
      targets.push_back(p);
    }
  }
  return targets;
}

std::size_t target_at(const std::vector<double>& targets, double position_m) {
  const auto after = std::upper_bound(targets.begin(), targets.end(), position_m);
  return static_cast<std::size_t>(after - targets.begin()) - 1;
}

Result<std::map<int, RunValues>> by_run(const MeasuredError& error,
                                        const std::vector<double>& targets) {
  std::map<int, RunValues> runs;
  for (const Reading& r : error.readings) {
    auto& value =
        runs[r.run].at[target_at(targets, r.position_m)][r.forward ? kForward : kBackward];
    if (value) {
      return failure(ErrorCode::BadInput, message(error.name, ": run ", r.run, " has two ",
                                                  r.forward ? "forward" : "backward", " values at ",
                                                  kMmPerM * r.position_m, " mm"));
    }
    value = r.value;
  }
  return runs;
}

/// True if each run has one direction and the directions alternate (forward 1, backward 2, forward
/// 3, ...). Programs of laser interferometers number runs in this way.
bool alternate(const std::map<int, RunValues>& runs) {
  std::size_t previous = 2;
  for (const auto& [number, run] : runs) {
    const std::size_t travel = run.has(kForward) ? kForward : kBackward;
    if ((run.has(kForward) && run.has(kBackward)) || travel == previous) {
      return false;
    }
    previous = travel;
  }
  return runs.size() % 2 == 0;
}

std::string advice_on_directions(const std::map<int, RunValues>& runs) {
  const auto first = runs.begin(), second = std::next(first);
  if (!alternate(runs)) {
    return ": the mean of one direction contains half of the backlash; leave out the incomplete "
           "runs";
  }
  return message(
      ": forward and backward of one cycle have the same number; the runs of this file "
      "alternate, so number run ",
      first->first, " and run ", second->first,
      " both 1, the next two both 2, and so on (1, 1, 2, 2, ...)");
}

/// For forward and backward: true if the runs have this direction. BadInput unless all runs have
/// the same directions.
Result<std::array<bool, 2>> directions_of(const std::string& name,
                                          const std::map<int, RunValues>& runs) {
  const RunValues& first = runs.begin()->second;
  const std::array<bool, 2> wanted{first.has(kForward), first.has(kBackward)};
  for (const auto& [number, run] : runs) {
    if (run.has(kForward) != wanted[kForward] || run.has(kBackward) != wanted[kBackward]) {
      return failure(ErrorCode::BadInput,
                     message(name, ": run ", number, " has other directions than run ",
                             runs.begin()->first, advice_on_directions(runs)));
    }
  }
  return wanted;
}

/// The targets that every direction of every run has.
std::vector<std::size_t> complete_targets(const std::map<int, RunValues>& runs, std::size_t count,
                                          const std::array<bool, 2>& directions) {
  std::vector<std::size_t> complete;
  for (std::size_t target = 0; target < count; ++target) {
    const bool everywhere = std::all_of(runs.begin(), runs.end(), [&](const auto& entry) {
      const auto found = entry.second.at.find(target);
      return found != entry.second.at.end() && (!directions[kForward] || found->second[kForward]) &&
             (!directions[kBackward] || found->second[kBackward]);
    });
    if (everywhere) {
      complete.push_back(target);
    }
  }
  return complete;
}

/// Tells whether positions are readings instead of targets: such positions scatter by much less
/// than the targets are apart. `largest_m`: largest distance of a position of the first pass from
/// the nearest one of another pass. `spacing_m`: smallest distance between positions of the first
/// pass.
struct PositionScatter {
  double largest_m = 0.0, spacing_m = std::numeric_limits<double>::infinity();
};

std::vector<std::vector<double>> positions_by_pass(const std::map<int, RunValues>& runs,
                                                   const std::vector<double>& targets) {
  std::vector<std::vector<double>> passes;
  for (const auto& [number, run] : runs) {
    for (const std::size_t travel : {kForward, kBackward}) {
      std::vector<double> positions;
      for (const auto& [target, values] : run.at) {
        if (values[travel]) {
          positions.push_back(targets[target]);
        }
      }
      if (!positions.empty()) {
        passes.push_back(std::move(positions));
      }
    }
  }
  return passes;
}

PositionScatter position_scatter_of(const std::vector<std::vector<double>>& passes) {
  PositionScatter scatter;
  const std::vector<double>& first = passes.front();
  for (std::size_t i = 1; i < first.size(); ++i) {
    scatter.spacing_m = std::min(scatter.spacing_m, first[i] - first[i - 1]);
  }
  for (const double p : first) {
    for (const auto& other : passes) {
      double nearest_m = std::numeric_limits<double>::infinity();
      for (const double q : other) {
        nearest_m = std::min(nearest_m, std::abs(q - p));
      }
      scatter.largest_m = std::max(scatter.largest_m, nearest_m);
    }
  }
  return scatter;
}

/// Message that explains why no position occurs in all runs: the positions are readings instead of
/// targets.
std::string scatter_text(const std::map<int, RunValues>& runs, const std::vector<double>& targets) {
  constexpr double kReadings = 0.25;  // of the spacing; up to this scatter each reading clearly
                                      // belongs to one target
  const PositionScatter scatter = position_scatter_of(positions_by_pass(runs, targets));
  const std::string limit = message("; positions that differ by more than ",
                                    kMmPerM * kSameTarget_m, " mm are different targets");
  if (!(scatter.largest_m < kReadings * scatter.spacing_m)) {
    return limit;
  }
  return message(limit, ", and those of the runs differ by up to ", kMmPerM * scatter.largest_m,
                 " mm: write the target position instead of the reading");
}

void append_run(Runs& out, const RunValues& run, const std::vector<std::size_t>& targets,
                const std::array<bool, 2>& directions) {
  const auto n = static_cast<Eigen::Index>(targets.size());
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(n), difference = Eigen::VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& at = run.at.at(targets[static_cast<std::size_t>(i)]);
    sum(i) = at[kForward].value_or(0.0) + at[kBackward].value_or(0.0);
    difference(i) = at[kForward].value_or(0.0) - at[kBackward].value_or(0.0);
  }

  const bool both = directions[kForward] && directions[kBackward];
  out.values.push_back(both ? 0.5 * sum : sum);
  if (both) {
    out.reversal.push_back(difference);
  }
}

/// BadInput if two runs have the same values.
Result<void> check_copies(const std::string& name, const std::map<int, RunValues>& runs) {
  constexpr std::size_t kLeast = 3;  // fewer values may be equal by chance
  for (auto a = runs.begin(); a != runs.end(); ++a) {
    for (auto b = std::next(a); b != runs.end(); ++b) {
      if (a->second.at.size() >= kLeast && a->second.at == b->second.at) {
        return failure(ErrorCode::BadInput,
                       message(name, ": run ", b->first, " has exactly the values of run ",
                               a->first, ": leave out the copy, their scatter would be zero"));
      }
    }
  }
  return {};
}

Result<void> check_readings(const MeasuredError& error) {
  if (error.readings.empty()) {
    return failure(ErrorCode::BadInput, message(error.name, ": no values"));
  }
  for (const Reading& r : error.readings) {
    if (!std::isfinite(r.position_m) || !std::isfinite(r.value)) {
      return failure(ErrorCode::NotFinite, message(error.name, ": run ", r.run, ": not a number"));
    }
  }
  return {};
}

Eigen::VectorXd mean_of_runs(const std::vector<Eigen::VectorXd>& runs) {
  Eigen::VectorXd sum = runs.front();
  for (std::size_t i = 1; i < runs.size(); ++i) {
    sum += runs[i];
  }
  return sum / static_cast<double>(runs.size());
}

}  // namespace

Eigen::VectorXd Runs::mean() const {
  return mean_of_runs(values);
}

Eigen::MatrixXd Runs::covariance_of_mean(const Eigen::MatrixXd& P) const {
  const Eigen::VectorXd centre = P * mean();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(P.rows(), P.rows());
  for (const Eigen::VectorXd& run : values) {
    const Eigen::VectorXd d = P * run - centre;
    sum += d * d.transpose();
  }
  const double n = static_cast<double>(values.size());
  return values.size() < 2 ? sum : Eigen::MatrixXd(sum / (n * (n - 1.0)));
}

Result<Runs> runs_of(const MeasuredError& error) {
  ABBE_TRY(check_readings(error));
  const std::vector<double> targets = targets_of(error);
  const auto runs = by_run(error, targets);
  ABBE_TRY(runs);
  ABBE_TRY(check_copies(error.name, *runs));
  const auto directions = directions_of(error.name, *runs);
  ABBE_TRY(directions);

  const auto complete = complete_targets(*runs, targets.size(), *directions);
  if (complete.empty()) {
    return failure(ErrorCode::TooFewObservations,
                   message(error.name, ": no position occurs in all of its ", runs->size(),
                           " runs and directions", scatter_text(*runs, targets)));
  }

  Runs out;
  out.left_out = targets.size() - complete.size();
  for (const std::size_t target : complete) {
    out.positions_m.push_back(targets[target]);
  }
  for (const auto& [number, run] : *runs) {
    append_run(out, run, complete, *directions);
  }

  return out;
}

std::optional<Reversal> reversal_of(const Runs& runs) {
  if (runs.reversal.empty()) {
    return std::nullopt;
  }
  const Eigen::VectorXd mean = mean_of_runs(runs.reversal);
  Eigen::Index at = 0;
  mean.cwiseAbs().maxCoeff(&at);
  Reversal out{.mean = mean.mean(),
               .largest = mean(at),
               .at_m = runs.positions_m[static_cast<std::size_t>(at)]};

  const double n = static_cast<double>(runs.reversal.size());
  if (runs.reversal.size() > 1) {
    double squares = 0.0;
    for (const Eigen::VectorXd& run : runs.reversal) {
      squares += (run.mean() - out.mean) * (run.mean() - out.mean);
    }
    out.u = std::sqrt(squares / (n * (n - 1.0)));
  }

  return out;
}

}  // namespace abbe::calib::direct
