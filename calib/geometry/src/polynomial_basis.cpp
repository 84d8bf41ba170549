#include "abbe/calib/internal/geometry/polynomial_basis.hpp"

#include "function_value.hpp"

namespace abbe::calib {

void PolynomialBasis::append_columns(const MachineState& state, ModelColumns& columns) const {
  const ScaledDesign::Factors at = design_.factors(state.q_m);
  std::size_t parameter = 0;
  for (const DesignFunction& f : design_.functions()) {
    columns.push(parameter++, function_value(f, at));
  }
}

Vector3 PolynomialBasis::V_m(const MachineState& state, std::span<const double> c_m) const {
  const ScaledDesign::Factors at = design_.factors(state.q_m);
  Vector3 V = Vector3::Zero();
  std::size_t parameter = 0;
  for (const DesignFunction& f : design_.functions()) {
    V += function_value(f, at) * c_m[parameter++];
  }
  return V;
}

}  // namespace abbe::calib
