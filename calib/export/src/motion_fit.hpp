#pragma once
/// Least-squares fit of tables to vectors at the nodes of a lattice.

#include <Eigen/Cholesky>
#include <array>
#include <span>
#include <vector>

#include "abbe/calib/export/held_correction.hpp"

namespace abbe::calib {

struct LatticePlace {
  Vector3 p_m;
  std::array<std::size_t, 3> node;
};

/// The nodes of the lattice inside the validity volume. TooFewObservations if there are none.
[[nodiscard]] Result<std::vector<LatticePlace>> lattice_places(const ValidityVolume&,
                                                               const GridAxes&);

/// Index of the last node at or below `q`, but at most that of the last node but one.
[[nodiscard]] std::size_t cell_of(std::span<const double> nodes, double q);
/// Value at `q`: linear between nodes, constant beyond the end nodes.
[[nodiscard]] double linear_at(std::span<const double> nodes, std::span<const double> values,
                               double q);

class MotionFit {
 public:
  /// `anchors`: for each axis the node at which translations across the axis and rotations are set
  /// to zero. Without anchors no table is fixed.
  MotionFit(const KinematicChain&, const Vector3& tool_offset_m, std::span<const ErrorMotion>,
            const GridAxes&, std::span<const LatticePlace>,
            const std::optional<std::array<std::size_t, 3>>& anchors);
  /// Returns the values of each motion at the nodes of its axis. `targets_m`: one vector for each
  /// place.
  [[nodiscard]] std::vector<std::vector<double>> fit(std::span<const Vector3> targets_m) const;

 private:
  struct Entry {
    Eigen::Index unknown;
    Vector3 effect;
  };
  void entries_at(const LatticePlace&, std::vector<Entry>&) const;
  void number_unknowns(const std::optional<std::array<std::size_t, 3>>& anchors);
  void add_smoothness(Eigen::MatrixXd&) const;

  KinematicChain chain_;
  Vector3 tool_offset_m_;
  std::vector<ErrorMotion> motions_;
  GridAxes nodes_m_;
  std::span<const LatticePlace> places_;
  std::vector<std::vector<Eigen::Index>> unknown_;  ///< index of the unknown by motion and node;
                                                    ///< -1: the value is zero
  Eigen::Index unknowns_ = 0;
  Eigen::LDLT<Eigen::MatrixXd> factor_;
};

}  // namespace abbe::calib
