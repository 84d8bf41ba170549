#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "lines.hpp"

namespace abbe::calib::iso {
namespace {

constexpr std::size_t kPointsOfDiagonal = 21;
constexpr std::array<std::string_view, 4> kDiagonals{"PPP", "NPP", "PNP", "NNP"};

/// A body diagonal with the component of V along it.
class DiagonalLine {
 public:
  DiagonalLine(const ErrorFunctions& functions, const Diagonal& d)
      : functions_(&functions),
        from_m_(d.from_m),
        along_((d.to_m - d.from_m).normalized()),
        length_m_((d.to_m - d.from_m).norm()),
        first_(functions.row(from_m_, along_)) {}

  [[nodiscard]] double length_m() const { return length_m_; }
  /// Row a: a U is the component of V along the diagonal, relative to its value at the beginning.
  [[nodiscard]] Eigen::RowVectorXd row(double at_m, const AxisTravel& travel) const {
    return functions_->row(from_m_ + at_m * along_, along_, travel) - first_;
  }
  [[nodiscard]] double value(double at_m, const AxisTravel& travel) const {
    return functions_->value(row(at_m, travel));
  }
  [[nodiscard]] Eigen::MatrixXd rows(const std::vector<double>& at_m,
                                     const AxisTravel& travel) const {
    Eigen::MatrixXd rows(std::ssize(at_m), first_.size());
    for (std::size_t i = 0; i < at_m.size(); ++i) {
      rows.row(static_cast<Eigen::Index>(i)) = row(at_m[i], travel);
    }
    return rows;
  }

  /// Distances of the beginning, the end, and all positions at which an axis is at a node. If the
  /// model is curved between its nodes, each part between two of these is divided by eight.
  [[nodiscard]] std::vector<double> kinks_m() const {
    std::vector<double> at_m{0.0, length_m_};
    for (const Axis axis : kAllAxes) {
      const auto a = static_cast<Eigen::Index>(index(axis));
      for (const double node_m : functions_->model().nodes()[index(axis)].nodes_m) {
        const double along_m = (node_m - from_m_(a)) / along_(a);
        if (along_m > 0.0 && along_m < length_m_) {
          at_m.push_back(along_m);
        }
      }
    }
    std::sort(at_m.begin(), at_m.end());
    return functions_->model().linear_between_nodes() ? at_m : divided(at_m);
  }

 private:
  [[nodiscard]] static std::vector<double> divided(const std::vector<double>& at_m) {
    constexpr int kParts = 8;
    std::vector<double> all{at_m.front()};
    for (std::size_t i = 1; i < at_m.size(); ++i) {
      for (int k = 1; k <= kParts; ++k) {
        all.push_back(at_m[i - 1] + k * (at_m[i] - at_m[i - 1]) / kParts);
      }
    }
    return all;
  }

  const ErrorFunctions* functions_;
  Vector3 from_m_, along_;
  double length_m_ = 0.0;
  Eigen::RowVectorXd first_;
};

/// Position of the vertex of the parabola through the values f at 0, 1/2 and 1, if it is between 0
/// and 1.
std::optional<double> vertex_of(double f0, double f_half, double f1) {
  const double bend = f0 - 2.0 * f_half + f1;  // f(t) = f0 + (f1 - f0 - 2 bend) t + 2 bend t^2
  if (bend == 0.0) {
    return std::nullopt;
  }
  const double t = 0.5 - (f1 - f0) / (4.0 * bend);
  return t > 0.0 && t < 1.0 ? std::optional(t) : std::nullopt;
}

/// A quantity as a function of the distance along the diagonal.
using Curve = std::function<double(double at_m)>;

/// The positions kinks_m(), and the extremes of each curve between them.
std::vector<double> positions_of_extremes_m(const DiagonalLine& line,
                                            std::span<const Curve> curves) {
  const std::vector<double> kinks_m = line.kinks_m();
  std::vector<double> all_m = kinks_m;
  for (const Curve& f : curves) {
    for (std::size_t i = 1; i < kinks_m.size(); ++i) {
      const double a_m = kinks_m[i - 1], b_m = kinks_m[i];
      if (const auto t = vertex_of(f(a_m), f(0.5 * (a_m + b_m)), f(b_m))) {
        all_m.push_back(a_m + *t * (b_m - a_m));
      }
    }
  }
  return all_m;
}

Diagonal diagonal_of(const ErrorFunctions& functions, const LineBox& box, std::string_view name) {
  Diagonal d{.name = std::string(name), .from_m = box.low_m, .to_m = box.high_m};
  AxisTravel forward{}, backward{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto i = static_cast<Eigen::Index>(a);
    const bool positive = name[a] == 'P';
    if (!positive) {
      std::swap(d.from_m(i), d.to_m(i));
    }
    forward[a] = positive ? Travel::Forward : Travel::Backward;
    backward[a] = positive ? Travel::Backward : Travel::Forward;
  }

  const DiagonalLine line(functions, d);
  for (std::size_t i = 0; i < kPointsOfDiagonal; ++i) {
    d.along_m.push_back(line.length_m() * static_cast<double>(i) / (kPointsOfDiagonal - 1.0));
  }
  const Eigen::MatrixXd mean = line.rows(d.along_m, {});
  for (Eigen::Index i = 0; i < mean.rows(); ++i) {
    d.mean.push_back(functions.with_u(mean.row(i)));
  }

  std::vector<Curve> curves{[&](double at_m) { return line.value(at_m, {}); }};
  if (functions.has_travel()) {
    curves.emplace_back([&](double at_m) { return line.value(at_m, forward); });
    curves.emplace_back([&](double at_m) { return line.value(at_m, backward); });
    curves.emplace_back(
        [&](double at_m) { return line.value(at_m, forward) - line.value(at_m, backward); });
  }
  const std::vector<double> all_m = positions_of_extremes_m(line, curves);
  d.M = range_of(functions, line.rows(all_m, {}));
  if (functions.has_travel()) {
    if (const auto both =
            bidirectional_of(functions, line.rows(all_m, forward), line.rows(all_m, backward))) {
      d.E = both->E;
      d.B = both->B;
    }
  }
  return d;
}

}  // namespace

std::array<Diagonal, 4> diagonals_of(const ErrorFunctions& functions, const LineBox& box) {
  std::array<Diagonal, 4> all;
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i] = diagonal_of(functions, box, kDiagonals[i]);
  }
  return all;
}

}  // namespace abbe::calib::iso
