#pragma once
/// Stage one: computes weighted linear observations of the machine's errors from tracker points and
/// path. Each used segment gives two rows, along a2 and a3 of its path frame. The component along
/// the direction of travel is not used: without synchronised clocks it carries no information
/// (weight 0 in [Sanders 2023] eq. (4)). If scale readings were recorded, along_rows.hpp adds this
/// component. In standstill mode each position gives three rows, see observe_standstills.hpp; leg
/// and segment of a row are then its position and its standstill.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/estimation/row_batch.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/otf/observe/alignment.hpp"
#include "abbe/calib/otf/run/path_frame.hpp"
#include "abbe/calib/otf/run/smoothness.hpp"
#include "abbe/calib/otf/run/travel.hpp"
#include "abbe/calib/otf/samples/tracker_drift.hpp"

namespace abbe::calib::otf {

/// Rows of a sparse design matrix, columns ascending within a row.
class SparseRows {
 public:
  using Entry = estimation::RowEntry;
  void append(std::span<const Entry> row);
  [[nodiscard]] std::size_t rows() const { return begin_.size() - 1; }
  [[nodiscard]] std::span<const Entry> row(std::size_t i) const;

 private:
  std::vector<Entry> entries_;
  std::vector<std::size_t> begin_{0};
};

/// One row: y = A U + noise.
struct Observation {
  double y_m = 0.0;      ///< measured minus nominal position along `direction`
  double sigma_m = 1.0;  ///< standard uncertainty of y
  double weight = 1.0;   ///< in 1/m^2; 1/sigma^2 unless the caller sets another weight
  std::size_t leg = 0;
  std::size_t segment = 0;
  Vector3 direction = Vector3::UnitX();       ///< a2 or a3, machine coordinates
  Vector3 axis_position_m = Vector3::Zero();  ///< closest nominal axis position
  std::size_t first_sub_point = 0;            ///< index in Observations::sub_points_m
  std::size_t sub_points = 0;
  std::size_t component = 0;  ///< 0: a2, 1: a3, kAlong: along the travel; standstill mode: x, y, z
};
inline constexpr std::size_t kAlong = 2;

/// Number of unknowns of the rigid motion of the tracker station, translation T and rotation r:
///     measured error = V + T + r x p,   p = axis position + target offset
inline constexpr std::size_t kRigidUnknowns = 6;
/// Offset [s] and drift of the machine's clock, with scale readings only (along_rows.hpp).
inline constexpr std::size_t kClockUnknowns = 2;

struct Observations {
  Mode mode = Mode::OnTheFly;
  TableBasis basis;
  Vector3 target_offset_m = Vector3::Zero();
  SparseRows A{};  ///< design matrix with unknowns() columns
  std::vector<Observation> rows{};
  /// Points within the segments, as nominal axis positions: a row of A is the mean of the model
  /// over the sub-points of its segment.
  std::vector<Vector3> sub_points_m{};
  Alignment alignment{};
  std::vector<Vector3> vertices_m{};     ///< vertices of the path, axis positions
  std::vector<AxisTravel> travel{};      ///< by Observation::leg; a missing leg has unknown
                                         ///< directions
  double u_scale = 0.0;                  ///< copy of Noise::u_scale
  std::array<double, 3> u_axis_scale{};  ///< copy of Noise::u_axis_scale
  double u_range_offset_m = 0.0;         ///< copy of Noise::u_range_offset_m
  std::vector<Vector3> covered_m{};      ///< axis positions; their hull is the validity volume
  std::size_t samples = 0;
  std::size_t lost_samples = 0;
  std::size_t segments = 0;
  std::size_t segments_used = 0;
  /// Mean time by Observation::segment, tracker's clock. Empty for segments without times.
  std::vector<double> segment_s{};
  std::size_t clock_unknowns = 0;  ///< kClockUnknowns with scale readings and unknown clocks
  std::vector<std::size_t> beam_returned{};  ///< copy of SegmentSeries::beam_returned
  SetAside set_aside{};
  std::optional<DriftObservations> drift{};  ///< data of nests, if they were visited repeatedly
  /// Prior for smooth tables; every adjustment of these rows uses it.
  std::optional<Smoothness> smoothness{};
  std::vector<std::string> notes{};  ///< notes for the verdict

  [[nodiscard]] const ParameterLayout& layout() const { return basis.layout(); }
  /// Index in U of the first of the six rigid unknowns T, r, which follow the parameters of the
  /// basis: those of the model, layout().model_size(), and backlash (backlash.hpp).
  [[nodiscard]] std::size_t rigid_offset() const { return basis.size(); }
  /// Index of the clock unknowns, which follow the rigid unknowns.
  [[nodiscard]] std::size_t clock_offset() const { return basis.size() + kRigidUnknowns; }
  [[nodiscard]] std::size_t unknowns() const { return clock_offset() + clock_unknowns; }
  /// State of the machine at an axis position on a leg, with the leg's direction of travel.
  [[nodiscard]] MachineState state_on(std::size_t leg, const Vector3& q_m) const;
  /// Name of an unknown for messages, such as "EXX at -0.300 m", "EC0Y", "rx".
  [[nodiscard]] std::string label(std::size_t unknown) const;
};

/// One measured point (or segment mean) relative to the path.
struct PointOnPath {
  std::size_t leg = 0;
  std::size_t segment = 0;
  Vector3 deviation_m = Vector3::Zero();      ///< measured minus closest nominal point
  Vector3 axis_position_m = Vector3::Zero();  ///< closest nominal axis position
  PathFrame frame;
  double samples = 1.0;  ///< number of samples in the mean
};
/// One row of a point: the component along `direction`, and the standard uncertainty of the mean.
struct MeasuredComponent {
  Vector3 direction = Vector3::UnitX();
  double sigma_m = 1.0;
  std::span<const SparseRows::Entry> clock{};  ///< entries of the clock unknowns
};
/// Appends a row for each component of a point. `frame` and `samples` of the point are not used.
void append_rows(Observations&, const PointOnPath&, std::span<const Vector3> sub_points_m,
                 std::span<const MeasuredComponent>);
/// Appends the two rows of a point, along a2 and a3 of its path frame: design P M B and observed
/// error P V of [Sanders 2023] eq. (6), not yet weighted. `sub_points_m` are the nominal axis
/// positions over which the design matrix is averaged.
void append_rows(Observations&, const PointOnPath&, std::span<const Vector3> sub_points_m);

/// Checks the noise. BadInput for a noise that is not positive, or a negative uncertainty.
[[nodiscard]] Result<void> check(const Noise&);
/// Observations without rows, for on-the-fly mode: tables of the machine and uncertainties of the
/// noise.
[[nodiscard]] Result<Observations> observations_without_rows(
    const Machine&, const Path&, const Noise&, Alignment,
    TravelDependence backlash = TravelDependence::None);

/// Derivative of the row's y_m with respect to an offset common to all ranges of the tracker.
[[nodiscard]] double drow_drange_offset(const Observations&, const Observation& row);
/// Returns the observations after subtraction of `range_offset_m` from all ranges.
[[nodiscard]] Observations without_range_offset(Observations, double range_offset_m);

/// Returns the observations with the design matrix of another basis, which has another order of the
/// axes or other nodes.
[[nodiscard]] Observations with_basis(const Observations&, TableBasis);

/// Computes the observations in on-the-fly mode from segments that are already averaged. No sample
/// is excluded.
[[nodiscard]] Result<Observations> observe_segments(const SegmentSeries&, const Machine&,
                                                    const Path&, const Noise&, const Options& = {});

}  // namespace abbe::calib::otf
