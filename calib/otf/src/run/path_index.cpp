#include "abbe/calib/otf/run/path_index.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

namespace abbe::calib::otf {
namespace {

constexpr std::size_t kLegsInLeaf = 8;
constexpr double kNowhere = std::numeric_limits<double>::infinity();

/// Reduces a computed distance to a box so that rounding cannot make it larger than the distance to
/// a leg in the box. The rounding error of the distance is below 1e-12 m for any machine's travel.
double rounded_down(double off_m) {
  return off_m * (1.0 - 1e-9) - 1e-12;
}

}  // namespace

PathIndex::PathIndex(Path path) : path_(std::move(path)) {
  const std::size_t needed = (legs() + kLegsInLeaf - 1) / kLegsInLeaf;
  leaves_ = std::bit_ceil(std::max<std::size_t>(needed, 1));
  // The distance to an empty box is infinite.
  boxes_.assign(2 * leaves_, {Vector3::Constant(kNowhere), Vector3::Constant(-kNowhere)});
  for (std::size_t leaf = 0; leaf < needed; ++leaf) boxes_[leaves_ + leaf] = box_of_leaf(leaf);
  for (std::size_t node = leaves_ - 1; node > 0; --node) {
    const Box &left = boxes_[2 * node], &right = boxes_[2 * node + 1];
    boxes_[node] = {left.low_m.cwiseMin(right.low_m), left.high_m.cwiseMax(right.high_m)};
  }
}

std::size_t PathIndex::legs() const noexcept {
  return path_.vertices_m.empty() ? 0 : path_.vertices_m.size() - 1;
}

PathIndex::Box PathIndex::box_of_leaf(std::size_t leaf) const {
  const std::size_t first = leaf * kLegsInLeaf, last = std::min(first + kLegsInLeaf, legs());
  Box box{path_.vertices_m[first], path_.vertices_m[first]};
  for (std::size_t i = first + 1; i <= last; ++i) {
    box.low_m = box.low_m.cwiseMin(path_.vertices_m[i]);
    box.high_m = box.high_m.cwiseMax(path_.vertices_m[i]);
  }
  return box;
}

double PathIndex::off_box_m(std::size_t node, const Vector3& p_m) const {
  const Box& box = boxes_[node];
  if (box.low_m.x() > box.high_m.x()) return kNowhere;
  return rounded_down((box.low_m - p_m).cwiseMax(p_m - box.high_m).cwiseMax(0.0).norm());
}

std::optional<std::size_t> PathIndex::first_within(const Vector3& p_m, double within_m,
                                                   std::size_t from) const {
  std::vector<std::size_t> waiting{1};  // stack of nodes, the leftmost on top
  while (!waiting.empty()) {
    const std::size_t node = waiting.back();
    waiting.pop_back();
    // The leaves below this node are first_leaf to first_leaf + width - 1.
    const std::size_t level = std::bit_width(node) - 1;
    const std::size_t width = leaves_ >> level,
                      first_leaf = (node << (std::bit_width(leaves_) - 1 - level)) - leaves_;
    if ((first_leaf + width) * kLegsInLeaf <= from || !(off_box_m(node, p_m) <= within_m)) continue;
    if (node < leaves_) {
      waiting.push_back(2 * node + 1);
      waiting.push_back(2 * node);
      continue;
    }
    const std::size_t end = std::min((first_leaf + 1) * kLegsInLeaf, legs());
    for (std::size_t leg = std::max(first_leaf * kLegsInLeaf, from); leg < end; ++leg)
      if (nearest_on_leg(path_.vertices_m[leg], path_.vertices_m[leg + 1], p_m).off_m <= within_m)
        return leg;
  }

  return std::nullopt;
}

double PathIndex::distance_m(const Vector3& p_m) const {
  double nearest_m = kNowhere;
  std::vector<std::size_t> waiting{1};
  while (!waiting.empty()) {
    const std::size_t node = waiting.back();
    waiting.pop_back();
    if (!(off_box_m(node, p_m) < nearest_m)) continue;
    if (node < leaves_) {
      const bool left_is_nearer = off_box_m(2 * node, p_m) <= off_box_m(2 * node + 1, p_m);
      waiting.push_back(2 * node + (left_is_nearer ? 1 : 0));
      waiting.push_back(2 * node + (left_is_nearer ? 0 : 1));
      continue;
    }
    const std::size_t first = (node - leaves_) * kLegsInLeaf,
                      end = std::min(first + kLegsInLeaf, legs());
    for (std::size_t leg = first; leg < end; ++leg)
      nearest_m = std::min(
          nearest_m, nearest_on_leg(path_.vertices_m[leg], path_.vertices_m[leg + 1], p_m).off_m);
  }

  return nearest_m;
}

}  // namespace abbe::calib::otf
