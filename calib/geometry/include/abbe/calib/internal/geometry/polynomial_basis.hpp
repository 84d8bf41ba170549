#pragma once
/// The scaled design of a ball array (geometry/scaled_design.hpp) as columns of a model: V is a
/// polynomial in the scale readings, without tables. The polynomials are valid for one tool offset.

#include <string>

#include "abbe/calib/geometry/machine_state.hpp"
#include "abbe/calib/geometry/model_columns.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"

namespace abbe::calib {

class PolynomialBasis {
 public:
  explicit PolynomialBasis(ScaledDesign design) : design_(std::move(design)) {}

  [[nodiscard]] const ScaledDesign& design() const { return design_; }
  [[nodiscard]] std::size_t size() const { return design_.size(); }
  [[nodiscard]] std::size_t most_columns() const { return size(); }

  /// Appends the columns at this state. Does not allocate; `columns` needs space for
  /// most_columns().
  void append_columns(const MachineState&, ModelColumns&) const;
  /// V = B c at this state, B: ScaledDesign::B(). Does not allocate.
  [[nodiscard]] Vector3 V_m(const MachineState&, std::span<const double> c_m) const;

  /// Name of a coefficient, such as "k_exz2".
  [[nodiscard]] std::string label(std::size_t parameter) const {
    return design_.equivalent().names()[parameter];
  }

 private:
  ScaledDesign design_;
};

}  // namespace abbe::calib
