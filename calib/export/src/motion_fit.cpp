#include "motion_fit.hpp"

#include <algorithm>

#include "abbe/calib/internal/geometry/rigid_body_effects.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"

namespace abbe::calib {
namespace {

/// Weight of the second differences of a table relative to its observations. At a node without
/// observations the table continues its neighbours in a straight line. At other nodes it changes by
/// less than 1e-6 of its second difference.
constexpr double kSmoothness = 1e-6;
/// Keeps the matrix regular for unknowns with neither observations nor second differences.
constexpr double kRidge = 1e-12;

}  // namespace

std::size_t cell_of(std::span<const double> nodes, double q) {
  const auto above = std::upper_bound(nodes.begin(), nodes.end(), q);
  const auto i = static_cast<std::size_t>(above - nodes.begin());
  return std::clamp<std::size_t>(i, 1, nodes.size() - 1) - 1;
}

double linear_at(std::span<const double> nodes, std::span<const double> values, double q) {
  const std::size_t i = cell_of(nodes, q);
  const double w = std::clamp((q - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0, 1.0);
  return (1.0 - w) * values[i] + w * values[i + 1];
}

Result<std::vector<LatticePlace>> lattice_places(const ValidityVolume& validity,
                                                 const GridAxes& axes) {
  std::vector<LatticePlace> places;
  for (std::size_t i = 0; i < axes[0].size(); ++i) {
    for (std::size_t j = 0; j < axes[1].size(); ++j) {
      for (std::size_t k = 0; k < axes[2].size(); ++k) {
        const Vector3 p(axes[0][i], axes[1][j], axes[2][k]);
        if (validity.contains(p)) places.push_back({p, {i, j, k}});
      }
    }
  }
  if (places.empty()) {
    return failure(ErrorCode::TooFewObservations,
                   "tables of a control: no node is inside the validity volume of the model");
  }
  return places;
}

MotionFit::MotionFit(const KinematicChain& chain, const Vector3& tool_offset_m,
                     std::span<const ErrorMotion> motions, const GridAxes& nodes_m,
                     std::span<const LatticePlace> places,
                     const std::optional<std::array<std::size_t, 3>>& anchors)
    : chain_(chain),
      tool_offset_m_(tool_offset_m),
      motions_(motions.begin(), motions.end()),
      nodes_m_(nodes_m),
      places_(places) {
  number_unknowns(anchors);

  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(unknowns_, unknowns_);
  std::vector<Entry> entries;
  for (const LatticePlace& place : places_) {
    entries_at(place, entries);
    for (const Entry& a : entries) {
      for (const Entry& b : entries) N(a.unknown, b.unknown) += a.effect.dot(b.effect);
    }
  }

  add_smoothness(N);
  factor_.compute(N);
}

void MotionFit::number_unknowns(const std::optional<std::array<std::size_t, 3>>& anchors) {
  for (const ErrorMotion& motion : motions_) {
    const std::size_t a = index(motion.axis);
    std::vector<Eigen::Index> numbers(nodes_m_[a].size(), -1);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const bool fixed = anchors && !is_positioning(motion) && (*anchors)[a] == i;
      if (!fixed) numbers[i] = unknowns_++;
    }
    unknown_.push_back(std::move(numbers));
  }
}

void MotionFit::entries_at(const LatticePlace& place, std::vector<Entry>& entries) const {
  entries.clear();
  const auto levers = levers_m(chain_, place.p_m, tool_offset_m_);
  for (std::size_t m = 0; m < motions_.size(); ++m) {
    const std::size_t a = index(motions_[m].axis);
    const Eigen::Index unknown = unknown_[m][place.node[a]];
    if (unknown >= 0) entries.push_back({unknown, effect(motions_[m], levers[a])});
  }
}

void MotionFit::add_smoothness(Eigen::MatrixXd& N) const {
  constexpr std::array<double, 3> kDifference{1.0, -2.0, 1.0};
  for (const auto& numbers : unknown_) {
    double largest = 0.0;
    for (const Eigen::Index u : numbers) largest = std::max(largest, u < 0 ? 0.0 : N(u, u));

    for (std::size_t i = 0; i + 2 < numbers.size(); ++i) {
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t s = 0; s < 3; ++s) {
          const Eigen::Index u = numbers[i + r], v = numbers[i + s];
          if (u >= 0 && v >= 0) N(u, v) += kSmoothness * largest * kDifference[r] * kDifference[s];
        }
      }
    }

    for (const Eigen::Index u : numbers) {
      if (u >= 0) N(u, u) += kRidge * largest;
    }
  }
}

std::vector<std::vector<double>> MotionFit::fit(std::span<const Vector3> targets_m) const {
  Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns_);
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    entries_at(places_[i], entries);
    for (const Entry& entry : entries) right[entry.unknown] += entry.effect.dot(targets_m[i]);
  }

  const Eigen::VectorXd solution = factor_.solve(right);
  std::vector<std::vector<double>> tables;
  for (const auto& numbers : unknown_) {
    std::vector<double> values(numbers.size(), 0.0);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i] >= 0) values[i] = solution[numbers[i]];
    }
    tables.push_back(std::move(values));
  }
  return tables;
}

}  // namespace abbe::calib
