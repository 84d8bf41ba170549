#pragma once
/// The scaled design of a ball array (evemu/scaled_design.hpp) as columns: V is a polynomial in the
/// scale readings, without tables. The polynomials are valid for one tool offset.

#include <string>

#include "abbe/calib/estimation/machine_state.hpp"
#include "abbe/calib/estimation/model_columns.hpp"
#include "abbe/calib/evemu/scaled_design.hpp"

namespace abbe::calib::estimation {

/// Immutable value.
class PolynomialBasis {
 public:
  explicit PolynomialBasis(evemu::ScaledDesign design) : design_(std::move(design)) {}

  [[nodiscard]] const evemu::ScaledDesign& design() const { return design_; }
  [[nodiscard]] std::size_t size() const { return design_.size(); }
  [[nodiscard]] std::size_t most_columns() const { return size(); }

  /// Appends the columns. No allocation; needs space for most_columns().
  void append_columns(const MachineState&, ModelColumns&) const;
  /// V = B c. No allocation.
  [[nodiscard]] Vector3 V_m(const MachineState&, std::span<const double> c_m) const;

  /// "k_exz2".
  [[nodiscard]] std::string label(std::size_t parameter) const {
    return design_.equivalent().names()[parameter];
  }

 private:
  evemu::ScaledDesign design_;
};

}  // namespace abbe::calib::estimation
