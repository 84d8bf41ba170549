#pragma once
/// Error tables with nodes as columns: the rigid-body model of rigid_body_model.hpp with linear or
/// cubic interpolation, and with tables that depend on the direction of travel. Parameters:
/// 1. those of ParameterLayout: nodes of the tables, then squareness,
/// 2. for TravelDependence::Backlash one value b per table, for Tables one difference D per node,
///    in the order of the tables.
/// The value of a table at position q, with s = 1 while its axis travels forward, -1 backward, and
/// 0 before the first motion of the axis:
///     U(q) + s b / 2    or    U(q) + s D(q) / 2

#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "abbe/calib/geometry/axis_interpolation.hpp"
#include "abbe/calib/geometry/machine_state.hpp"
#include "abbe/calib/geometry/model_columns.hpp"
#include "abbe/calib/geometry/parameter_layout.hpp"

namespace abbe::calib {

enum class TravelDependence { None, Backlash, Tables };

struct TableOptions {
  std::array<Interpolation, 3> interpolation{};  ///< interpolation of the tables of X, Y, Z
  TravelDependence travel = TravelDependence::None;

  /// Options with the same interpolation for all axes and no dependence on the direction of travel.
  [[nodiscard]] static TableOptions all_axes(Interpolation kind) {
    return {.interpolation = {kind, kind, kind}};
  }
};

/// A model of tables as columns: which nodes of which tables contribute to V at a state. Immutable.
class TableBasis {
 public:
  /// Returns BadInput if a cubic table has too many nodes (AxisInterpolation::kMostCubicNodes).
  [[nodiscard]] static Result<TableBasis> of(ParameterLayout, const TableOptions& = {});

  [[nodiscard]] const ParameterLayout& layout() const { return layout_; }
  [[nodiscard]] const AxisInterpolation& interpolation(Axis a) const { return axis_[index(a)]; }
  [[nodiscard]] TravelDependence travel() const { return travel_; }
  /// The options with which the basis was made.
  [[nodiscard]] TableOptions options() const {
    return {{axis_[0].kind(), axis_[1].kind(), axis_[2].kind()}, travel_};
  }
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Largest number of columns that append_columns() can add at one state.
  [[nodiscard]] std::size_t most_columns() const { return most_columns_; }

  /// Appends the columns M B at this state. Does not allocate; `columns` needs space for
  /// most_columns().
  void append_columns(const MachineState&, ModelColumns&) const;
  /// V = M B U at this state. Does not allocate.
  [[nodiscard]] Vector3 V_m(const MachineState&, std::span<const double> U) const;

  /// Name of a parameter for messages: "EXX at -0.300 m", "EC0Y", "backlash of EXX", "travel
  /// difference of EXX at -0.300 m".
  [[nodiscard]] std::string label(std::size_t parameter) const;

 private:
  explicit TableBasis(ParameterLayout layout) : layout_(std::move(layout)) {}
  void append_travel_columns(const MachineState&, ModelColumns&) const;

  ParameterLayout layout_;
  std::array<AxisInterpolation, 3> axis_;
  TravelDependence travel_ = TravelDependence::None;
  std::size_t size_ = 0, most_columns_ = 0;
};

}  // namespace abbe::calib
