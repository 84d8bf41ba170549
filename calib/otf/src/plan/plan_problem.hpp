#pragma once
/// Quantities that planning evaluates very often: the information of one leg, and trace(G C) of a
/// path.
/// A leg is evaluated at evenly spaced points of constant speed, so that its information is a
/// smooth function of its ends; predict() uses the segments of a real run instead.

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/internal/geometry/rigid_body_model.hpp"
#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::calib::otf {

struct Leg {
  Vector3 from_m, to_m;
  [[nodiscard]] double length_m() const { return (to_m - from_m).norm(); }
};

/// The two whitened rows of one point, along a2 and a3; both have the same columns.
struct PointRows {
  // one more column, for the range offset
  static constexpr std::size_t kCapacity = DesignColumns::kCapacity + 1;
  std::array<Eigen::Index, kCapacity> column;
  std::array<double, kCapacity> along_a2, along_a3;
  std::size_t count = 0;
};

/// A path, represented by its information H.
struct PathState {
  Eigen::MatrixXd H;      ///< information, lower triangle
  double value_m2 = 0.0;  ///< the value trace(G C), in m^2
  Eigen::MatrixXd C;      ///< the inverse of H; set only by with_slope()
  /// C G C, the derivative of -value with respect to H: the information A^T A of a short leg
  /// decreases the value by trace(A^T A D). Set only by with_slope().
  Eigen::MatrixXd D;
};

/// The run to be planned, with the matrices that do not depend on the path. Immutable.
class PlanProblem {
 public:
  static constexpr double kSpacing_m = 0.0125;
  static constexpr double kCoarseSpacing_m = 0.025;  ///< coarser spacing, for the choice of a leg

  PlanProblem(const PlannedRun&, const ParameterLayout&);

  [[nodiscard]] const PlannedRun& run() const { return run_; }
  [[nodiscard]] const Eigen::MatrixXd& G() const { return G_; }
  /// Number of points of a leg at most `spacing_m` apart; 0 if the whole leg is within
  /// Options::corner_m of its ends.
  [[nodiscard]] std::size_t points_of(const Leg&, double spacing_m = kSpacing_m) const;

  /// Information H without any leg: a prior of 50 um and 100 urad for each node, and the prior of
  /// the range offset. The prior of the nodes is negligible when a path determines the model.
  [[nodiscard]] Eigen::MatrixXd prior() const;
  /// Adds `factor` times the information of the leg to the lower triangle of H.
  void add(const Leg&, double factor, Eigen::MatrixXd& H, double spacing_m = kSpacing_m) const;
  /// trace(H_leg D). `points`: number of points; the same number must be used for legs that are
  /// compared.
  [[nodiscard]] double trace_with(const Eigen::MatrixXd& D, const Leg&, std::size_t points) const;
  /// Exact decrease of the value by the leg, evaluated at `points` points.
  [[nodiscard]] double gain(const PathState&, const Leg&, std::size_t points) const;

  [[nodiscard]] PathState state_of(const Path&) const;
  [[nodiscard]] PathState state_of(Eigen::MatrixXd H) const;
  [[nodiscard]] PathState with_slope(PathState) const;

 private:
  [[nodiscard]] PointRows rows_at(const Leg&, double share, std::size_t points) const;

  /// True if the offset of all ranges is an unknown (Noise::u_range_offset_m > 0). It is the last
  /// unknown.
  [[nodiscard]] bool has_range_offset() const { return run_.noise.u_range_offset_m > 0.0; }
  [[nodiscard]] Eigen::Index unknowns() const {
    return static_cast<Eigen::Index>(layout_.fit_size()) + (has_range_offset() ? 1 : 0);
  }

  PlannedRun run_;
  ParameterLayout layout_;
  Eigen::MatrixXd G_;       ///< unknowns() x unknowns(), zero for unknowns that do not belong to
                            ///< the model
  Eigen::MatrixXd root_G_;  ///< G = root_G root_G^T
};

}  // namespace abbe::calib::otf
