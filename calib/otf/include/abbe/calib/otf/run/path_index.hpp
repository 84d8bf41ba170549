#pragma once
/// Search index for the legs of a path near a point: a binary tree of bounding boxes around groups
/// of consecutive legs. The results are bit-identical to those of a search with nearest_on_leg()
/// over all legs. Pure.

#include <cstddef>
#include <optional>
#include <vector>

#include "abbe/calib/otf/run/polyline.hpp"

namespace abbe::calib::otf {

class PathIndex {
 public:
  /// Builds the index in O(n) time and memory. The path may be empty.
  explicit PathIndex(Path path);

  [[nodiscard]] const Path& path() const noexcept { return path_; }
  /// The first leg with index >= `from` whose distance to `p_m` is at most `within_m`.
  [[nodiscard]] std::optional<std::size_t> first_within(const Vector3& p_m, double within_m,
                                                        std::size_t from = 0) const;
  /// Distance to the nearest leg; infinite for fewer than two vertices.
  [[nodiscard]] double distance_m(const Vector3& p_m) const;

 private:
  struct Box {
    Vector3 low_m = Vector3::Zero();
    Vector3 high_m = Vector3::Zero();
  };
  [[nodiscard]] Box box_of_leaf(std::size_t leaf) const;
  [[nodiscard]] double off_box_m(std::size_t node, const Vector3& p_m) const;
  [[nodiscard]] std::size_t legs() const noexcept;

  Path path_;
  std::size_t leaves_ = 0;  ///< a power of two; leaf i contains the legs from i * kLegsInLeaf on
  /// Binary tree in an array: node k has the children 2 k and 2 k + 1, leaf i is node leaves_ + i.
  std::vector<Box> boxes_;
};

}  // namespace abbe::calib::otf
