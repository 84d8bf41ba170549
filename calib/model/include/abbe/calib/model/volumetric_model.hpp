#pragma once
/// The result of every identification method: the volumetric error V of a machine and its
/// uncertainty. V is the error of the functional point (stylus tip or reflector)
///     V(q, t) = actual - nominal = true position - reading
/// in machine coordinates, at the scale reading q, for the tool offset t (tool reference point to
/// functional point). Use of a model, p: nominal position:
/// - measuring: corrected = reading + V(reading),
/// - positioning: command p + c with c = -V(p + c).
/// A rigid motion of the whole volume is not estimable and not part of a model; neither are errors
/// outside the validity volume.
///
/// The covariance of V contains the misfit of the model (misfit.hpp); that of the parameters
/// contains its effect on them.
///
/// With backlash (travel_differences.hpp) V depends on the direction in which each axis last moved.
/// Functions without an argument for this direction give the mean of both directions; their
/// covariance contains half the difference, but not the uncertainty of the difference. error_at()
/// with all directions Unknown contains both in its covariance.
///
/// A model has one of two forms: tables with nodes (rigid-body model; linear or cubic between the
/// nodes, with natural or not-a-knot ends), or polynomials without tables (equivalent model of a
/// ball array). Gate, grid, comparison and export treat all forms alike: nodes() and
/// linear_between_nodes() describe them. Values and uncertainties refer to the
/// datum of the model; compare two models with rigid_free_difference().

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "abbe/calib/geometry/parameter_layout.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"
#include "abbe/calib/geometry/table_basis.hpp"
#include "abbe/calib/geometry/travel_differences.hpp"
#include "abbe/calib/geometry/validity_volume.hpp"
#include "abbe/calib/model/misfit.hpp"
#include "abbe/calib/model/model_datum.hpp"
#include "abbe/calib/model/polynomial_model.hpp"

namespace abbe::calib {

struct VolumetricError {
  Vector3 V_m = Vector3::Zero();       ///< NaN if !tool_ok
  Matrix3 cov_V_m2 = Matrix3::Zero();  ///< k = 1, in the model's datum; NaN if !tool_ok
  bool inside = false;                 ///< true if the axis position is in the validity volume
  bool tool_ok = false;                ///< true if the model is valid for this tool offset
};

/// Checks that a covariance is square, finite, symmetric and, within rounding, positive
/// semidefinite; else BadInput or NotFinite. Takes n^3 / 3 operations.
[[nodiscard]] Result<void> check_covariance(const Eigen::MatrixXd&);

struct Correction {
  Vector3 c_m = Vector3::Zero();  ///< add to the nominal position to obtain the command
  int evaluations = 0;
  bool inside = false;
};

/// Data of a polynomial model in addition to its coefficients.
struct PolynomialForm {
  int order = 3;
  ReadingBox box;
  Vector3 ball1_m = Vector3::Zero();
};

/// A model as stored: all data from which from_description() restores it bit for bit.
struct ModelDescription {
  KinematicChain chain;
  MachineNodes nodes;
  ModelDatum datum = ModelDatum::G1;
  /// Tool offsets of the measurements.
  /// - One offset: the model is valid for this tool only.
  /// - Several offsets on a line (all 18 tables): valid for tools on this line; the rotation about
  ///   the line is not determined.
  /// - Three or more offsets that are not on a line (all 18 tables): valid for any tool.
  std::vector<Vector3> tool_offsets_m;
  std::vector<Parameter> parameters;  ///< in the order of ParameterLayout, no rigid unknowns
  Eigen::MatrixXd covariance;  ///< parameters x parameters, full, symmetric, m^2, m rad, rad^2
  std::vector<Vector3> validity_hull_m;
  /// If set, `parameters` are the coefficients of the scaled design [m]; nodes and basis are
  /// ignored.
  std::optional<PolynomialForm> polynomials{};
  /// interpolation of the tables of all axes between `nodes`
  Interpolation interpolation = Interpolation::Linear;
  /// Differences between the directions of travel, for tables only. `covariance` must contain half
  /// of them (TravelDifferences).
  std::optional<TravelDifferences> travel{};
  /// Misfit of the form of the model. It is not part of `covariance`, but its effect on the
  /// parameters is.
  std::optional<Misfit> misfit{};
};

/// A volumetric model in one of its forms. Immutable; all member functions may be called from any
/// thread.
class VolumetricModel {
 public:
  /// Largest difference between a tool offset and that of the model. The tables of a 14-table model
  /// include the effect of the tool offset. An offset that differs by 0.5 mm changes V by at most
  /// 0.05 um at a rotation error of 100 urad, less than the resolution of a run. With a larger
  /// difference the model is not valid.
  static constexpr double kToolTolerance_m = 0.5e-3;

  /// Builds the model from its stored form. BadInput or NotFinite if the parameters are wrong
  /// (unknown or repeated name, missing node, wrong size); the text names the first wrong
  /// parameter.
  [[nodiscard]] static Result<VolumetricModel> from_description(ModelDescription);
  /// Builds a model of tables. `U`: the model_size() parameters of the layout; `covariance`: their
  /// covariance; `interpolation`: that of all tables.
  [[nodiscard]] static Result<VolumetricModel> from_vector(
      const ParameterLayout&, ModelDatum, std::span<const Vector3> tool_offsets_m,
      const Eigen::VectorXd& U, const Eigen::MatrixXd& covariance, ValidityVolume,
      Interpolation interpolation = Interpolation::Linear);
  /// Builds a model with the tables of a basis and their interpolation.
  [[nodiscard]] static Result<VolumetricModel> from_vector(const TableBasis&, ModelDatum,
                                                           std::span<const Vector3> tool_offsets_m,
                                                           const Eigen::VectorXd& U,
                                                           const Eigen::MatrixXd& covariance,
                                                           ValidityVolume);

  /// Builds a polynomial model, valid for one tool. Datum Ball1 or Ball1Blocks.
  [[nodiscard]] static Result<VolumetricModel> from_polynomials(PolynomialModel, ModelDatum,
                                                                const Vector3& tool_offset_m,
                                                                ValidityVolume);

  /// Returns the same model with differences between the directions of travel. `covariance()` must
  /// already contain half of them: half_differences() times its transpose. BadInput for
  /// polynomials, for wrong sizes, or if the covariance of tables and differences together is not
  /// positive semidefinite; NotFinite for NaN.
  [[nodiscard]] Result<VolumetricModel> with_travel(TravelDifferences) const;
  /// Returns the same model with another misfit; without misfit if Misfit::any() is false. BadInput
  /// for a wrong size or a negative value, NotFinite for NaN.
  [[nodiscard]] Result<VolumetricModel> with_misfit(Misfit) const;

  /// V with its covariance, mean of both directions of travel. Takes about 1 us, 4 us for cubic
  /// tables. Does not allocate.
  [[nodiscard]] VolumetricError error_at(const Vector3& axis_position_m,
                                         const Vector3& tool_offset_m) const;
  /// V alone, mean of both directions of travel; about four times faster than error_at(). NaN for a
  /// tool for which the model is not valid.
  [[nodiscard]] Vector3 V_at(const Vector3& axis_position_m, const Vector3& tool_offset_m) const;
  /// Solves c = -V(p + c) for the nominal position p, by iteration until c changes by less than
  /// 1e-9 m. NotApplicable for a tool for which the model is not valid. NotConverged after 50
  /// evaluations; this occurs only if |dV/dq| is close to 1 (implausible tables).
  /// `travel`: the direction in which the axes reach the position.
  [[nodiscard]] Result<Correction> command_correction(const Vector3& nominal_m,
                                                      const Vector3& tool_offset_m,
                                                      const AxisTravel& travel = {}) const;

  /// V and covariance for the direction in which each axis last moved. For an axis with Unknown
  /// direction V is the mean of both directions, and the covariance contains half the difference
  /// and its uncertainty. In a model without differences the direction has no effect. error_at()
  /// allocates if the model has differences.
  [[nodiscard]] VolumetricError error_at(const Vector3& axis_position_m,
                                         const Vector3& tool_offset_m, const AxisTravel&) const;
  [[nodiscard]] Vector3 V_at(const Vector3& axis_position_m, const Vector3& tool_offset_m,
                             const AxisTravel&) const;

  [[nodiscard]] bool holds_for_tool(const Vector3& tool_offset_m) const;
  [[nodiscard]] const KinematicChain& chain() const;
  /// Positions at which the model is checked, compared and published. Linear tables: their nodes;
  /// cubic tables: their nodes and the middles of the cells between them, the nodes alone if there
  /// would be more than 300,000 positions; polynomials: a grid over the bounding box of the
  /// validity volume. The nodes of any tables are in tables()->layout().
  [[nodiscard]] const MachineNodes& nodes() const { return nodes_; }
  /// True if V is linear between nodes() along each axis.
  [[nodiscard]] bool linear_between_nodes() const {
    return interpolation() == Interpolation::Linear;
  }
  /// Interpolation of the tables; nullopt for a model of polynomials.
  [[nodiscard]] std::optional<Interpolation> interpolation() const {
    return tables() == nullptr ? std::nullopt
                               : std::optional(tables()->interpolation(Axis::X).kind());
  }
  /// The tables; null for a model of polynomials.
  [[nodiscard]] const TableBasis* tables() const { return std::get_if<TableBasis>(&form_); }
  [[nodiscard]] const PolynomialModel* polynomials() const {
    return std::get_if<PolynomialModel>(&form_);
  }
  /// The differences between the directions of travel; null if V does not depend on the direction.
  [[nodiscard]] const TravelDifferences* travel() const {
    return travel_ ? &travel_->differences : nullptr;
  }
  /// The tables with their dependence on the direction of travel; null if V does not depend on it.
  [[nodiscard]] const TableBasis* travel_tables() const {
    return travel_ ? &travel_->basis : nullptr;
  }
  /// The misfit; null if the model has none.
  [[nodiscard]] const Misfit* misfit() const { return misfit_ ? &*misfit_ : nullptr; }
  /// Part of the covariance of V that is caused by the misfit, for a tool for which the model is
  /// valid.
  [[nodiscard]] Matrix3 misfit_cov_V_m2(const Vector3& axis_position_m,
                                        const Vector3& tool_offset_m) const;
  [[nodiscard]] ModelDatum datum() const { return datum_; }
  [[nodiscard]] std::span<const Vector3> tool_offsets_m() const { return tool_offsets_m_; }
  [[nodiscard]] const ValidityVolume& validity() const { return validity_; }
  [[nodiscard]] const Eigen::VectorXd& U() const { return U_; }
  [[nodiscard]] const Eigen::MatrixXd& covariance() const { return covariance_; }
  [[nodiscard]] std::vector<Parameter> parameters() const;
  [[nodiscard]] ModelDescription description() const;

 private:
  using Form = std::variant<TableBasis, PolynomialModel>;
  VolumetricModel(Form form, MachineNodes nodes)
      : form_(std::move(form)), nodes_(std::move(nodes)) {}
  [[nodiscard]] Vector3 lever_offset_m(const Vector3& offset_m) const;

  struct TravelForm {
    TableBasis basis;
    TravelDifferences differences;
    Eigen::VectorXd U_and_D;
  };

  Form form_;
  MachineNodes nodes_;
  ModelDatum datum_ = ModelDatum::G1;
  std::vector<Vector3> tool_offsets_m_;
  bool holds_for_any_tool_ = false;
  Vector3 tool_line_ = Vector3::Zero();  ///< unit vector; zero: the model is valid for one tool
  Eigen::VectorXd U_;
  Eigen::MatrixXd covariance_;
  /// For cubic tables only: U and its covariance in the coordinates Z of geometry/cell_form.hpp.
  Eigen::VectorXd Z_;
  Eigen::MatrixXd cov_Z_;
  ValidityVolume validity_;
  std::optional<TravelForm> travel_;
  std::optional<Misfit> misfit_;
};

}  // namespace abbe::calib
