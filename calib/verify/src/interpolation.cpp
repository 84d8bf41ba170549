#include "abbe/calib/internal/verify/interpolation.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"
#include "extent.hpp"

namespace abbe::calib::verify {
namespace {

using Vector4 = Eigen::Vector4d;
using Matrix4 = Eigen::Matrix4d;

// Tolerance for rounding; scaled coordinates are of the order of 1.
constexpr double kRounding = 1e-10;

/// Basis of the simplex method: four columns, and the matrix that computes their weights for a
/// place. An index in `point` >= the number of points stands for the slack variable of a row.
struct Cell {
  std::array<Eigen::Index, 4> point{};
  Matrix4 weights_from_place = Matrix4::Identity();
};

/// The linear programme: points as columns (x, y, z, 1), with the cost |p|^2 of each.
class Programme {
 public:
  Programme(std::span<const Vector3> points, const Extent& extent)
      : columns_(4, static_cast<Eigen::Index>(points.size())), price_(columns_.cols()) {
    for (Eigen::Index i = 0; i < columns_.cols(); ++i) {
      columns_.col(i) = extent.scaled(points[static_cast<std::size_t>(i)]).homogeneous();
      price_(i) = columns_.col(i).head<3>().squaredNorm();
    }
  }

  [[nodiscard]] bool is_slack(Eigen::Index i) const { return i >= columns_.cols(); }

  /// Simplex method. nullopt if the place is not a convex combination of the points.
  [[nodiscard]] std::optional<Cell> around(const Vector4& place) const {
    // Select the column with the steepest descent first. After kSteepest steps ties may cause an
    // endless cycle; from then on the least-index rule is used, which always terminates.
    constexpr int kSteepest = 60, kMost = 5000;
    const Vector4 slack_sign =
        (place.array() < 0.0).select(Vector4::Constant(-1.0), Vector4::Ones());
    Cell cell;

    for (Eigen::Index row = 0; row < 4; ++row) {
      cell.point[static_cast<std::size_t>(row)] = columns_.cols() + row;
    }

    for (int step = 0; step < kMost; ++step) {
      cell.weights_from_place = basis(cell, slack_sign).inverse();
      const auto entering = next(cell, step >= kSteepest);
      if (!entering) {
        break;
      }
      pivot(cell, *entering, place);
    }

    const Vector4 weight = cell.weights_from_place * place;
    for (std::size_t row = 0; row < 4; ++row) {
      if (is_slack(cell.point[row]) && weight(static_cast<Eigen::Index>(row)) > kRounding) {
        return std::nullopt;
      }
    }

    return cell;
  }

 private:
  [[nodiscard]] Matrix4 basis(const Cell& cell, const Vector4& slack_sign) const {
    Matrix4 M = Matrix4::Zero();
    for (Eigen::Index k = 0; k < 4; ++k) {
      const Eigen::Index i = cell.point[static_cast<std::size_t>(k)];
      if (is_slack(i)) {
        const Eigen::Index row = i - columns_.cols();
        M(row, k) = slack_sign(row);
      } else {
        M.col(k) = columns_.col(i);
      }
    }
    return M;
  }

  /// The next point to enter the basis: one that reduces the slack or, with equal slack, the cost.
  /// nullopt if the basis is optimal.
  [[nodiscard]] std::optional<Eigen::Index> next(const Cell& cell, bool least_index) const {
    Vector4 slack, price;
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Index i = cell.point[k];
      slack(static_cast<Eigen::Index>(k)) = is_slack(i) ? 1.0 : 0.0;
      price(static_cast<Eigen::Index>(k)) = is_slack(i) ? 0.0 : price_(i);
    }

    const Eigen::RowVector4d slack_plane = slack.transpose() * cell.weights_from_place,
                             price_plane = price.transpose() * cell.weights_from_place;
    std::optional<Eigen::Index> best;
    double best_slack = -kRounding, best_price = -kRounding;

    for (Eigen::Index i = 0; i < columns_.cols(); ++i) {
      const double by_slack = -slack_plane * columns_.col(i);
      if (by_slack < best_slack) {
        best = i;
        best_slack = by_slack;
        if (least_index) {
          return best;
        }
      }
    }

    for (Eigen::Index i = 0; i < columns_.cols() && !(best && best_slack < -kRounding); ++i) {
      const double by_slack = -slack_plane * columns_.col(i),
                   by_price = price_(i) - price_plane * columns_.col(i);
      if (by_slack <= kRounding && by_price < best_price) {
        best = i;
        best_price = by_price;
        if (least_index) {
          return best;
        }
      }
    }

    return best;
  }

  /// Exchanges a column of the basis: `entering` replaces the column whose weight becomes zero
  /// first when the weight of `entering` grows. In a tie, slack variables leave before points, then
  /// lower indices before higher ones.
  void pivot(Cell& cell, Eigen::Index entering, const Vector4& place) const {
    const Vector4 weight = cell.weights_from_place * place,
                  rate = cell.weights_from_place * columns_.col(entering);
    std::size_t leaving = 0;
    double least = std::numeric_limits<double>::infinity();

    for (std::size_t k = 0; k < 4; ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      if (!(rate(row) > kRounding)) {
        continue;
      }
      const double steps = std::max(0.0, weight(row)) / rate(row);
      const bool tie = std::abs(steps - least) <= kRounding;
      if (steps < least - kRounding || (tie && leaves_first(cell.point[k], cell.point[leaving]))) {
        least = steps;
        leaving = k;
      }
    }

    cell.point[leaving] = entering;
  }
  [[nodiscard]] bool leaves_first(Eigen::Index a, Eigen::Index b) const {
    return is_slack(a) != is_slack(b) ? is_slack(a) : a < b;
  }

  Eigen::Matrix4Xd columns_;
  Eigen::VectorXd price_;
};

LinearWeights weights_in(const Cell& cell, const Vector4& place, const Programme& programme) {
  LinearWeights w;
  double sum = 0.0;
  const Vector4 raw = cell.weights_from_place * place;

  for (std::size_t k = 0; k < 4; ++k) {
    if (programme.is_slack(cell.point[k])) {
      continue;  // the place is on a face of the hull
    }
    w.point[k] = static_cast<std::size_t>(cell.point[k]);
    w.weight[k] = std::max(0.0, raw(static_cast<Eigen::Index>(k)));
    sum += w.weight[k];
  }

  for (double& weight : w.weight) {
    weight /= sum;
  }

  return w;
}

}  // namespace

Result<std::vector<std::optional<LinearWeights>>> linear_weights(std::span<const Vector3> points,
                                                                 std::span<const Vector3> places) {
  const auto extent = extent_of(points);
  ABBE_TRY(extent);

  const Programme programme(points, *extent);
  std::vector<Cell> found;  // a cell is valid for every place inside it
  std::vector<std::optional<LinearWeights>> all;

  for (const Vector3& p : places) {
    const Vector4 place = extent->scaled(p).homogeneous();
    const auto holds = [&](const Cell& c) {
      return (c.weights_from_place * place).minCoeff() >= -kRounding;
    };

    const auto known = std::find_if(found.rbegin(), found.rend(), holds);
    if (known != found.rend()) {
      all.emplace_back(weights_in(*known, place, programme));
      continue;
    }

    const auto cell = programme.around(place);
    all.push_back(cell ? std::optional(weights_in(*cell, place, programme)) : std::nullopt);
    if (cell && std::none_of(cell->point.begin(), cell->point.end(),
                             [&](Eigen::Index i) { return programme.is_slack(i); })) {
      found.push_back(*cell);
    }
  }

  return all;
}

}  // namespace abbe::calib::verify
