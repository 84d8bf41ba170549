#pragma once
/// Information of every tracker sample of a run, accumulated while the machine moves. The time for
/// a sample does not depend on the number of nodes, and the memory does not depend on the number of
/// samples.
///
/// On a straight leg, within one cell of the nodes of all axes, each entry of a row is a polynomial
/// of the position along the leg, of degree 2 at most: linear interpolation times a lever. With x,
/// -1 to 1, the position within the cell, e_1 and e_2 fixed unit vectors across the leg, w the 2 x
/// 2 weight matrix of a sample and r its deviation from the leg:
///     rows along e_l:  sum_p x^p C_lp,  p = 0, 1, 2   (C_lp: a row over the unknowns)
///     M_lp,l'p' = sum over samples of w_ll' x^(p+p')
///     G_lp      = sum over samples of (w r)_l x^p
/// M and G replace the samples of the cell. With M = L L^T the six rows L^T C with the observations
/// L^-1 G contain the same information about the unknowns as all rows of the samples. The
/// information is not approximated, and the normal equations of the unknowns are not formed.
///
/// The weights are those of path_frame.hpp, for every sample:
///     w = a2 a2^T / sigma_2^2 + a3 a3^T / sigma_3^2

#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "abbe/calib/estimation/information.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Sums over the samples of one cell of a leg.
struct CellMoments {
  std::array<std::array<double, 5>, 3> weight{};     ///< w_11, w_12, w_22 times x^0 .. x^4 [1/m^2]
  std::array<std::array<double, 3>, 2> deviation{};  ///< (w r)_1, (w r)_2 times x^0 .. x^2 [1/m]
  double chi2 = 0.0;                                 ///< sum of r^T w r
  std::size_t samples = 0;
};

/// Accumulates the samples of a run. Not thread-safe. The pose of the tracker is constant during
/// the accumulation; the six rigid unknowns after the parameters of the basis (observe.hpp,
/// kRigidUnknowns) estimate its error.
class MomentAccumulator {
 public:
  struct Setup {
    TableBasis basis;
    Vector3 target_offset_m = Vector3::Zero();
    RigidTransform T_machine_tracker;
    Noise noise;              ///< noise of one sample
    double corner_m = 0.010;  ///< as Options::corner_m
    /// True: one more unknown after the rigid ones, the offset common to all ranges
    /// (Noise::u_range_offset_m). Its column is approximated by a quadratic function of x, with an
    /// error of (half cell / range)^3: 2e-5 of the offset for nodes 50 mm apart, 1 m from the
    /// tracker.
    bool range_offset = false;
  };
  /// Creates an accumulator. NotApplicable if the interpolation of an axis is not linear. BadInput
  /// if a sigma of the noise is not positive.
  [[nodiscard]] static Result<MomentAccumulator> of(Setup);

  /// Begins a leg: the next samples are measured on it. Axis positions in m; the ends must differ.
  void begin_leg(const Vector3& from_m, const Vector3& to_m);
  /// Adds a sample in the tracker frame; it must be finite. The sample is ignored if it is within
  /// `corner_m` of an end of the leg, or if no leg has begun.
  void add(const Vector3& p_tracker_m);

  /// Number of samples that were not ignored.
  [[nodiscard]] std::size_t samples() const { return samples_; }
  [[nodiscard]] std::size_t unknowns() const { return in_R_.unknowns(); }
  /// The part of Information::rest() and rows() that no polynomial of degree 2 within a cell can
  /// change. It contains only the noise from sample to sample.
  struct WithinCells {
    double chi2 = 0.0;
    std::size_t rows = 0;
  };
  [[nodiscard]] WithinCells within_cells() const;
  /// Information of all samples added so far; more samples can be added afterwards. Takes about as
  /// long as the adjustment of segment means (otf/solve/solve.hpp).
  [[nodiscard]] estimation::Information information() const;

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  struct Leg {
    Vector3 from_m = Vector3::Zero(), direction = Vector3::UnitX();
    Vector3 e1 = Vector3::UnitY(), e2 = Vector3::UnitZ();  ///< unit vectors across the leg
    double length_m = 0.0;
    std::vector<double> crossing_m;  ///< 0, distances at which an axis passes a node, length_m;
                                     ///< ascending
  };

  /// The samples between two neighbouring values of Leg::crossing_m.
  struct Cell {
    std::size_t number = kNone;  ///< index in crossing_m of the begin of the cell
    double centre_m = 0.0, half_m = 1.0;
    CellMoments moments;
  };

  /// Rows of cells that are not yet part of R, because rows are added to R in batches (RowBatch).
  /// The rows of a cell have up to 6 x 40 entries of 16 bytes: 4 MB for kMostCells.
  struct WaitingRows {
    static constexpr std::size_t kMostCells = 1024;
    SparseRows A;
    std::vector<double> y;
    std::size_t cells = 0;
    double rest = 0.0;             ///< part of chi2 that no unknown can change
    std::size_t removed_rows = 0;  ///< number of rows of the samples minus number of rows of A
    void add_to(estimation::Information&) const;
  };

  /// Coefficients C_lp of one unknown in a cell, in the order l p = 10, 11, 12, 20, 21, 22.
  struct PolynomialColumn {
    std::size_t unknown = 0;
    Vector6 C = Vector6::Zero();
  };

  explicit MomentAccumulator(Setup setup);
  [[nodiscard]] std::vector<PolynomialColumn> columns_in(const Cell&) const;
  [[nodiscard]] Cell& cell_with(double along_m);
  [[nodiscard]] bool contains(const Cell&, double along_m) const;
  void append_rows(const Cell&, WaitingRows&) const;
  void close(Cell&);

  Setup setup_;
  MachineState state_;
  Leg leg_;
  /// The two cells used last. Two are kept because a machine that stands where an axis passes a
  /// node gives samples in both cells.
  std::array<Cell, 2> cells_;
  std::size_t current_ = 0, samples_ = 0;
  WaitingRows waiting_;
  WithinCells within_R_;  ///< for the cells that are part of in_R_
  estimation::Information in_R_;
};

}  // namespace abbe::calib::otf
