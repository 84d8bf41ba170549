#include "lane_batch.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>

#include "abbe/calib/internal/sparse/sweep.hpp"

namespace abbe::calib::sparse {
namespace {

using Index = Eigen::Index;

/// Runs the paths of all tasks in the lanes of one vector batch.
class LaneBatch {
 public:
  LaneBatch(const GramProblem& problem, std::span<const PathTask> tasks)
      : problem_(problem),
        tasks_(tasks),
        solved_(tasks.size()),
        in_use_(static_cast<std::size_t>(problem.columns()), 0) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      load_next(lane);
    }
  }

  std::vector<SolvedPath> run() {
    while (busy()) {
      const SweepProblem sweeps{columns_.size(), gram_.data(), xty_.data(), mask_.data(),
                                b_.data()};
      const SweepOutcome outcome = sweep_(sweeps, parameters_, shortest_budget());
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        if (lanes_[lane].path) advance(lane, outcome.sweeps, (outcome.converged >> lane & 1U) != 0);
      }
    }
    return std::move(solved_);
  }

 private:
  struct Lane {
    std::optional<PathLane> path;
    std::size_t task = 0;
  };

  [[nodiscard]] bool busy() const {
    return std::any_of(lanes_.begin(), lanes_.end(),
                       [](const Lane& lane) { return lane.path.has_value(); });
  }

  [[nodiscard]] long shortest_budget() const {
    long budget = std::numeric_limits<long>::max();
    for (const Lane& lane : lanes_) {
      if (lane.path) budget = std::min(budget, lane.path->sweeps_left());
    }
    return budget;
  }

  void advance(std::size_t lane, long sweeps, bool converged) {
    PathLane& path = *lanes_[lane].path;
    const bool stops = converged || path.sweeps_left() == sweeps;
    if (stops) read_back(lane);
    path.swept(sweeps, converged);
    if (path.finished()) {
      solved_[lanes_[lane].task] = std::move(path).take();
      lanes_[lane].path.reset();
      load_next(lane);
    } else if (stops) {
      write_out(lane);
    }
  }

  void load_next(std::size_t lane) {
    while (!lanes_[lane].path && next_ < tasks_.size()) {
      lanes_[lane].task = next_;
      lanes_[lane].path.emplace(problem_, tasks_[next_]);
      ++next_;
      if (lanes_[lane].path->finished()) {
        solved_[lanes_[lane].task] = std::move(*lanes_[lane].path).take();
        lanes_[lane].path.reset();
      }
    }
    write_out(lane);
  }

  void read_back(std::size_t lane) {
    PathLane& path = *lanes_[lane].path;
    for (const Index j : path.active()) {
      path.coefficient(j) = b_[place_[static_cast<std::size_t>(j)]].of[lane];
    }
  }

  /// Copies coefficients, active columns and parameters of a lane's path to the arrays of the sweep
  /// function; zeros if the lane has no path.
  void write_out(std::size_t lane) {
    std::optional<PathLane>& path = lanes_[lane].path;
    if (path) make_room(path->active());
    for (std::size_t k = 0; k < b_.size(); ++k) {
      b_[k].of[lane] = 0.0;
      mask_[k].of[lane] = 0;
    }

    set_parameters(lane);
    if (!path) return;
    for (const Index j : path->active()) {
      const std::size_t k = place_[static_cast<std::size_t>(j)];
      b_[k].of[lane] = path->coefficient(j);
      mask_[k].of[lane] = -1;
    }
  }

  void set_parameters(std::size_t lane) {
    const bool idle = !lanes_[lane].path;
    const Shrinkage shrink = idle ? Shrinkage{} : lanes_[lane].path->shrinkage_now();
    parameters_.lambda.of[lane] = shrink.lambda;
    parameters_.inner_end.of[lane] = shrink.inner_end;
    parameters_.outer_end.of[lane] = shrink.outer_end;
    parameters_.offset.of[lane] = shrink.offset;
    parameters_.factor.of[lane] = shrink.factor;
    parameters_.tolerance.of[lane] = idle ? -1.0 : lanes_[lane].path->tolerance();
  }

  /// Adds columns to those that a sweep visits. Columns are never removed, so that these arrays and
  /// their Gram matrix are rarely rebuilt.
  void make_room(const std::vector<Index>& wanted) {
    bool added = false;
    for (const Index j : wanted) {
      char& in_use = in_use_[static_cast<std::size_t>(j)];
      added |= in_use == 0;
      in_use = 1;
    }
    if (added) rebuild();
  }

  void rebuild() {
    const std::vector<Index> old = std::exchange(columns_, {});
    for (std::size_t j = 0; j < in_use_.size(); ++j) {
      if (in_use_[j] != 0) columns_.push_back(static_cast<Index>(j));
    }
    const std::size_t used = columns_.size();
    columns_.resize((used + kBlock - 1) / kBlock * kBlock, -1);
    move_lanes(old);
    gather_gram(used);
  }

  void move_lanes(const std::vector<Index>& old) {
    std::vector<Lanes> b(columns_.size());
    std::vector<LaneMask> mask(columns_.size());
    place_.assign(in_use_.size(), 0);

    for (std::size_t k = 0; k < columns_.size() && columns_[k] >= 0; ++k) {
      place_[static_cast<std::size_t>(columns_[k])] = k;
    }

    for (std::size_t k = 0; k < old.size() && old[k] >= 0; ++k) {
      const std::size_t place = place_[static_cast<std::size_t>(old[k])];
      b[place] = b_[k];
      mask[place] = mask_[k];
    }

    b_ = std::move(b);
    mask_ = std::move(mask);
  }

  void gather_gram(std::size_t used) {
    const std::size_t n = columns_.size();
    gram_.assign(n * n, 0.0);
    xty_.assign(n, 0.0);
    for (std::size_t i = 0; i < used; ++i) {
      xty_[i] = problem_.xty(columns_[i]);
      for (std::size_t k = 0; k < used; ++k) {
        gram_[i * n + k] = problem_.gram(columns_[i], columns_[k]);
      }
    }
  }

  const GramProblem& problem_;
  std::span<const PathTask> tasks_;
  std::vector<SolvedPath> solved_;
  std::array<Lane, kLanes> lanes_;
  std::size_t next_ = 0;
  SweepFunction sweep_ = sweep_variants().front().sweep;
  LaneParameters parameters_;
  std::vector<char> in_use_;        ///< by problem column: nonzero if any path has used it
  std::vector<Index> columns_;      ///< problem column at each place; -1: padding
  std::vector<std::size_t> place_;  ///< place of each problem column in use
  std::vector<double> gram_, xty_;
  std::vector<Lanes> b_;
  std::vector<LaneMask> mask_;
};

}  // namespace

std::vector<SolvedPath> solve_paths(const GramProblem& problem, std::span<const PathTask> tasks) {
  return LaneBatch(problem, tasks).run();
}

}  // namespace abbe::calib::sparse
