#include "abbe/calib/estimation/polynomial_basis.hpp"

namespace abbe::calib::estimation {
namespace {

Vector3 value_of(const evemu::DesignFunction& f, const evemu::ScaledDesign::Factors& at) {
  Vector3 v = Vector3::Zero();
  for (std::size_t p = 0; p < f.parts; ++p) {
    v(static_cast<Eigen::Index>(f.part[p].component)) +=
        evemu::ScaledDesign::value(f, f.part[p], at);
  }
  return v;
}

}  // namespace

void PolynomialBasis::append_columns(const MachineState& state, ModelColumns& columns) const {
  const evemu::ScaledDesign::Factors at = design_.factors(state.q_m);
  std::size_t parameter = 0;
  for (const evemu::DesignFunction& f : design_.functions()) {
    columns.push(parameter++, value_of(f, at));
  }
}

Vector3 PolynomialBasis::V_m(const MachineState& state, std::span<const double> c_m) const {
  const evemu::ScaledDesign::Factors at = design_.factors(state.q_m);
  Vector3 V = Vector3::Zero();
  std::size_t parameter = 0;
  for (const evemu::DesignFunction& f : design_.functions()) {
    V += value_of(f, at) * c_m[parameter++];
  }
  return V;
}

}  // namespace abbe::calib::estimation
