#pragma once
/// The form of a model: which functions of the machine's state its parameters multiply,
///     V(state) = B(state) U
/// An identification method uses only the columns of B, so it works with every form of model.

#include <string>
#include <utility>
#include <variant>

#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/internal/geometry/polynomial_basis.hpp"

namespace abbe::calib {

/// Holds one form of a model: tables or polynomials. Immutable.
class ModelBasis {
 public:
  using Form = std::variant<TableBasis, PolynomialBasis>;
  explicit ModelBasis(Form form) : form_(std::move(form)) {}

  [[nodiscard]] std::size_t size() const {
    return std::visit([](const auto& form) { return form.size(); }, form_);
  }
  /// Largest number of columns that columns() can return at one state.
  [[nodiscard]] std::size_t most_columns() const {
    return std::visit([](const auto& form) { return form.most_columns(); }, form_);
  }

  /// Replaces the content of `columns` by the columns of B at this state. Does not allocate;
  /// `columns` needs space for most_columns().
  void columns(const MachineState& state, ModelColumns& columns) const {
    columns.clear();
    std::visit([&](const auto& form) { form.append_columns(state, columns); }, form_);
  }
  /// V = B(state) U. `U` has size() entries. No allocation.
  [[nodiscard]] Vector3 V_m(const MachineState& state, std::span<const double> U) const {
    return std::visit([&](const auto& form) { return form.V_m(state, U); }, form_);
  }

  /// Name of a parameter for messages.
  [[nodiscard]] std::string label(std::size_t parameter) const {
    return std::visit([&](const auto& form) { return form.label(parameter); }, form_);
  }

  /// The tables, or null if the model has another form.
  [[nodiscard]] const TableBasis* tables() const { return std::get_if<TableBasis>(&form_); }
  [[nodiscard]] const PolynomialBasis* polynomials() const {
    return std::get_if<PolynomialBasis>(&form_);
  }

 private:
  Form form_;
};

}  // namespace abbe::calib
