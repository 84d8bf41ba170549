#include "plan/plan_exchange.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/otf/run/polyline.hpp"
#include "abbe/result/try.hpp"
#include "plan/is_enough.hpp"
#include "plan/plan_lattice.hpp"

namespace abbe::calib::otf {
namespace {

bool is_corner(const Vector3& q, const MachineNodes& nodes) {
  for (std::size_t k = 0; k < 3; ++k) {
    const double at = q[static_cast<Eigen::Index>(k)];
    if (at != nodes[k].nodes_m.front() && at != nodes[k].nodes_m.back()) {
      return false;
    }
  }
  return true;
}

enum class ExchangeKind { Remove, Insert, Move, Reverse };

/// One exchange at vertex `vertex`: Remove it, Move it to `to`, Insert `to` before it, or Reverse
/// the part of the path from it to vertex `last`.
struct Exchange {
  ExchangeKind kind = ExchangeKind::Remove;
  std::size_t vertex = 0, last = 0;
  Vector3 to = Vector3::Zero();
  double merit = 0.0;  ///< linear estimate of value times length after the exchange
};

Path exchanged(Path path, const Exchange& e) {
  const auto at = path.vertices_m.begin() + static_cast<std::ptrdiff_t>(e.vertex);
  switch (e.kind) {
    case ExchangeKind::Remove:
      path.vertices_m.erase(at);
      break;
    case ExchangeKind::Insert:
      path.vertices_m.insert(at, e.to);
      break;
    case ExchangeKind::Move:
      *at = e.to;
      break;
    case ExchangeKind::Reverse:
      std::reverse(at, path.vertices_m.begin() + static_cast<std::ptrdiff_t>(e.last) + 1);
      break;
  }
  return path;
}

/// Searches exchanges that probably improve a path.
class ExchangeSearch {
 public:
  ExchangeSearch(const PlanProblem& problem, const Path& path, const PathState& state,
                 std::span<const Vector3> lattice, double most_m)
      : problem_(problem),
        state_(state),
        v_(path.vertices_m),
        lattice_(lattice),
        value_m2_(state.value_m2),
        length_m_(lengths_to_vertices_m(path).back()),
        most_m_(most_m) {
    of_lattice_.resize(v_.size() * lattice_.size());
    of_vertex_.resize(v_.size() * v_.size());
  }

  /// Promising exchanges, sorted by merit.
  [[nodiscard]] std::vector<Exchange> found(const std::vector<bool>& fixed) {
    for (std::size_t i = 1; i <= v_.size(); ++i) {
      const bool may_move = i < v_.size() && !fixed[i];
      if (may_move) {
        try_removal(i);
      }
      for (std::size_t to = 0; to < lattice_.size(); ++to) {
        try_insertion(i, to);
        if (may_move) {
          try_move(i, to);
        }
      }
      if (may_move) {
        try_steps(i);
      }
      for (std::size_t last = i + 1; last < v_.size(); ++last) {
        try_reversal(i, last);
      }
    }
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Exchange& a, const Exchange& b) { return a.merit < b.merit; });
    return std::move(found_);
  }

 private:
  /// Effect of a leg: decrease of the value that it causes (to first order), and its length.
  struct Worth {
    double seen_m2 = 0.0, length_m = 0.0;
    Worth operator+(const Worth& o) const { return {seen_m2 + o.seen_m2, length_m + o.length_m}; }
    Worth operator-(const Worth& o) const { return {seen_m2 - o.seen_m2, length_m - o.length_m}; }
  };

  static Worth worth(const PlanProblem& problem, const PathState& state, const Vector3& from,
                     const Vector3& to) {
    const Leg leg{from, to};
    if (from == to) {
      return {};
    }
    return {problem.trace_with(state.D, leg, problem.points_of(leg, PlanProblem::kCoarseSpacing_m)),
            leg.length_m()};
  }
  [[nodiscard]] Worth between(std::size_t i, std::size_t k) {
    std::optional<Worth>& known = of_vertex_[std::min(i, k) * v_.size() + std::max(i, k)];
    if (!known) {
      known = worth(problem_, state_, v_[i], v_[k]);
    }
    return *known;
  }
  /// Effect of the leg from vertex i to a lattice point; zero after the end of the path.
  [[nodiscard]] Worth to_lattice(std::size_t i, std::size_t point) {
    if (i >= v_.size()) {
      return {};
    }
    std::optional<Worth>& known = of_lattice_[i * lattice_.size() + point];
    if (!known) {
      known = worth(problem_, state_, v_[i], lattice_[point]);
    }
    return *known;
  }
  /// Effect of the leg that begins at vertex i; zero at the end of the path.
  [[nodiscard]] Worth leg_from(std::size_t i) {
    return i + 1 < v_.size() ? between(i, i + 1) : Worth{};
  }

  void try_removal(std::size_t i) {
    const Worth joined = i + 1 < v_.size() ? between(i - 1, i + 1) : Worth{};
    consider({.kind = ExchangeKind::Remove, .vertex = i}, joined - leg_from(i - 1) - leg_from(i));
  }
  void try_insertion(std::size_t i, std::size_t point) {
    const Vector3& to = lattice_[point];
    if (to != v_[i - 1] && (i == v_.size() || to != v_[i])) {
      consider({.kind = ExchangeKind::Insert, .vertex = i, .to = to},
               to_lattice(i - 1, point) + to_lattice(i, point) - leg_from(i - 1));
    }
  }
  void try_move(std::size_t i, std::size_t point) {
    const Vector3& to = lattice_[point];
    if (to != v_[i - 1] && (i + 1 == v_.size() || to != v_[i + 1])) {
      consider({.kind = ExchangeKind::Move, .vertex = i, .to = to},
               to_lattice(i - 1, point) + to_lattice(i + 1, point) - leg_from(i - 1) - leg_from(i));
    }
  }
  /// Tries short moves of vertex i along one axis.
  void try_steps(std::size_t i) {
    constexpr double kSteps_m[] = {0.04, 0.015, 0.005};
    const MachineNodes& travel = problem_.run().machine.nodes;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const std::vector<double>& nodes_m = travel[static_cast<std::size_t>(k)].nodes_m;
      for (const double step_m : kSteps_m) {
        for (const double sign : {1.0, -1.0}) {
          Exchange e{.kind = ExchangeKind::Move, .vertex = i, .to = v_[i]};
          e.to[k] = std::clamp(v_[i][k] + sign * step_m, nodes_m.front(), nodes_m.back());
          if (e.to != v_[i] && e.to != v_[i - 1] && (i + 1 == v_.size() || e.to != v_[i + 1])) {
            const Worth after =
                i + 1 < v_.size() ? worth(problem_, state_, e.to, v_[i + 1]) : Worth{};
            consider(e, worth(problem_, state_, v_[i - 1], e.to) + after - leg_from(i - 1) -
                            leg_from(i));
          }
        }
      }
    }
  }
  void try_reversal(std::size_t i, std::size_t last) {
    if (v_[i - 1] != v_[last] && (last + 1 == v_.size() || v_[i] != v_[last + 1])) {
      const Worth after = last + 1 < v_.size() ? between(i, last + 1) : Worth{};
      consider({.kind = ExchangeKind::Reverse, .vertex = i, .last = last},
               between(i - 1, last) + after - leg_from(i - 1) - leg_from(last));
    }
  }

  void consider(Exchange e, const Worth& more) {
    if (length_m_ + more.length_m > most_m_) {
      return;
    }
    // The value is a convex and positive function of H. This estimate is also convex and positive,
    // and agrees with value - more.seen_m2 to first order.
    const double value = more.seen_m2 > 0.0 ? value_m2_ * value_m2_ / (value_m2_ + more.seen_m2)
                                            : value_m2_ - more.seen_m2;
    e.merit = value * (length_m_ + more.length_m);
    if (e.merit < value_m2_ * length_m_) {
      found_.push_back(e);
    }
  }

  const PlanProblem& problem_;
  const PathState& state_;
  const std::vector<Vector3>& v_;
  std::span<const Vector3> lattice_;
  double value_m2_ = 0.0, length_m_ = 0.0, most_m_ = 0.0;
  std::vector<std::optional<Worth>> of_lattice_, of_vertex_;  ///< computed when first needed
  std::vector<Exchange> found_;
};

/// Key of an exchange: its kind and the vertices concerned. Used to remember exchanges that failed.
using ExchangeKey = std::array<double, 13>;

ExchangeKey key_of(const Path& path, const Exchange& e) {
  const auto& v = path.vertices_m;
  const std::size_t at = std::min(e.vertex, v.size() - 1);
  const std::size_t after = e.kind == ExchangeKind::Reverse ? e.last : at;
  const Vector3 vertices[] = {v[e.vertex - 1], v[at], v[std::min(after + 1, v.size() - 1)],
                              e.kind == ExchangeKind::Reverse ? v[e.last] : e.to};
  ExchangeKey key{static_cast<double>(e.kind)};
  for (std::size_t i = 0; i < 12; ++i) {
    key[i + 1] = vertices[i / 3][static_cast<Eigen::Index>(i % 3)];
  }
  return key;
}

/// Adds the information of the legs between vertices first and last, times `factor`.
void add_legs(const PlanProblem& problem, const Path& path, std::size_t first, std::size_t last,
              double factor, Eigen::MatrixXd& H) {
  for (std::size_t i = first; i < std::min(last, path.vertices_m.size() - 1); ++i) {
    problem.add({path.vertices_m[i], path.vertices_m[i + 1]}, factor, H);
  }
}

/// Information H after an exchange; only the legs that differ are evaluated.
Eigen::MatrixXd information_after(const PlanProblem& problem, const Path& before, const Path& after,
                                  const Exchange& e, Eigen::MatrixXd H) {
  const std::size_t first = e.vertex - 1;
  if (e.kind == ExchangeKind::Reverse) {
    for (const std::size_t leg : {first, e.last}) {
      add_legs(problem, before, leg, leg + 1, -1.0, H);
      add_legs(problem, after, leg, leg + 1, 1.0, H);
    }
    return H;
  }
  const std::size_t old_last = e.kind == ExchangeKind::Insert ? e.vertex : e.vertex + 1;
  const std::size_t new_last = e.kind == ExchangeKind::Remove ? e.vertex : e.vertex + 1;
  add_legs(problem, before, first, old_last, -1.0, H);
  add_legs(problem, after, first, new_last, 1.0, H);
  return H;
}

/// True if the exchange `later` is still valid after `done` was made. Adapts the vertex numbers of
/// `later`.
bool adapt(Exchange& later, const Exchange& done) {
  const auto touches = [&](std::size_t vertex) {
    return vertex + 2 >= done.vertex && vertex <= done.vertex + 2;
  };
  if (done.kind == ExchangeKind::Reverse || later.kind == ExchangeKind::Reverse ||
      touches(later.vertex)) {
    return false;
  }
  if (later.vertex > done.vertex) {
    later.vertex += done.kind == ExchangeKind::Insert ? 1 : 0;
    later.vertex -= done.kind == ExchangeKind::Remove ? 1 : 0;
  }
  return true;
}

/// Merit of a path: value times length, which allows the comparison of paths of different lengths.
double merit_of(const PathState& state, const Path& path) {
  return state.value_m2 * lengths_to_vertices_m(path).back();
}

}  // namespace

std::vector<bool> fixed_vertices(const Path& path, const MachineNodes& nodes) {
  std::vector<bool> fixed;
  std::vector<Vector3> corners;
  for (const Vector3& q : path.vertices_m) {
    const bool first_visit =
        is_corner(q, nodes) && std::find(corners.begin(), corners.end(), q) == corners.end();
    if (first_visit) {
      corners.push_back(q);
    }
    fixed.push_back(first_visit || fixed.empty());
  }
  return fixed;
}

Result<Path> exchange_vertices(const PlanProblem& problem, Path path,
                               std::span<const Vector3> lattice, const PathBudget& budget,
                               const PlanOptions& options) {
  // A search takes as much time as 400 evaluations. After a few accepted exchanges its order is no
  // longer valid.
  constexpr std::size_t kOfOneSearch = 1000, kAccepted = 4;
  constexpr double kBetter = 1.0 - 1e-5;
  const Drive& drive = problem.run().drive;
  PathState state = problem.state_of(path);
  std::set<ExchangeKey> failed;
  bool of_earlier_paths = false;
  std::size_t evaluated = 0;

  while (evaluated < options.exchanges) {
    state = problem.with_slope(std::move(state));
    const std::vector<Exchange> found =
        ExchangeSearch(problem, path, state, lattice,
                       longest_path_m(budget, drive, path.vertices_m.size()))
            .found(fixed_vertices(path, problem.run().machine.nodes));
    const std::size_t most = std::min(evaluated + kOfOneSearch, options.exchanges);
    std::vector<Exchange> done;

    for (std::size_t i = 0; i < found.size() && evaluated < most && done.size() < kAccepted; ++i) {
      if (is_enough(options)) {
        return path;
      }
      ABBE_TRY(check_stopped(options.stopped));
      Exchange e = found[i];
      if (!std::all_of(done.begin(), done.end(), [&](const Exchange& d) { return adapt(e, d); }) ||
          !failed.insert(key_of(path, e)).second) {
        continue;
      }

      Path to = exchanged(path, e);
      if (lengths_to_vertices_m(to).back() >
          longest_path_m(budget, drive, to.vertices_m.size() - 1)) {
        continue;
      }
      PathState there = problem.state_of(information_after(problem, path, to, e, state.H));
      ++evaluated;
      if (merit_of(there, to) < kBetter * merit_of(state, path)) {
        path = std::move(to);
        state = std::move(there);
        done.push_back(e);
      }
    }

    if (options.progress) {
      options.progress(static_cast<double>(evaluated) / static_cast<double>(options.exchanges),
                       std::sqrt(state.value_m2));
    }
    of_earlier_paths = of_earlier_paths || !done.empty();
    if (done.empty() && evaluated < most) {
      if (!of_earlier_paths) {
        break;
      }
      failed.clear();  // an exchange that failed on an earlier path may succeed on this one
      of_earlier_paths = false;
    }
  }
  return path;
}

Path reach_corners(const PlanProblem& problem, Path path, const PathBudget& budget) {
  const MachineNodes& nodes = problem.run().machine.nodes;
  for (const Vector3& corner : plan_lattice(nodes, 2)) {
    if (std::find(path.vertices_m.begin(), path.vertices_m.end(), corner) !=
        path.vertices_m.end()) {
      continue;
    }

    const std::vector<bool> fixed = fixed_vertices(path, nodes);
    const double most_m = longest_path_m(budget, problem.run().drive, path.vertices_m.size() - 1);
    std::optional<Path> best;
    double best_merit = 0.0;
    for (std::size_t i = 1; i < path.vertices_m.size(); ++i) {
      Path to = exchanged(path, {.kind = ExchangeKind::Move, .vertex = i, .to = corner});
      if (fixed[i] || lengths_to_vertices_m(to).back() > most_m) {
        continue;
      }
      if (const double merit = merit_of(problem.state_of(to), to); !best || merit < best_merit) {
        best_merit = merit;
        best = std::move(to);
      }
    }
    path = best.value_or(path);
  }
  return path;
}

}  // namespace abbe::calib::otf
