#pragma once
/// What every identification method ends in: the volumetric error of a machine with its
/// uncertainty. V = actual - nominal = true - reading of the functional point, in machine
/// coordinates, at the scale reading q, for the tool offset t (tool reference point to functional
/// point). Measuring: corrected = reading + V(reading). Positioning: command p + c with
/// c = -V(p + c). Not estimable, and so not in a model: a rigid motion of the whole volume (where
/// the machine stands), and anything that happened outside the validity volume. Two forms: tables
/// between nodes (rigid-body model), or polynomials (equivalent model of a ball array), which have
/// no tables. Values and uncertainties hold in the stated gauge; compare two models with
/// rigid_free_difference().

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/model.hpp"
#include "abbe/calib/gauge.hpp"
#include "abbe/calib/geometry.hpp"
#include "abbe/calib/parameter_layout.hpp"
#include "abbe/calib/validity_volume.hpp"

namespace abbe::calib {

struct VolumetricError {
  Vector3 V_m = Vector3::Zero();       ///< NaN if !tool_ok
  Matrix3 cov_V_m2 = Matrix3::Zero();  ///< k = 1, in the model's gauge; NaN if !tool_ok
  bool inside = false;                 ///< the axis position lies in the validity volume
  bool tool_ok = false;                ///< the model holds for this tool offset
};

/// What a covariance must be: square, finite, symmetric and, to rounding, positive semidefinite;
/// else BadInput or NotFinite. Costs n^3 / 3.
[[nodiscard]] Result<void> check_covariance(const Eigen::MatrixXd&);

struct Correction {
  Vector3 c_m = Vector3::Zero();  ///< add to the nominal position before commanding it
  int evaluations = 0;
  bool inside = false;
};

/// What a model in polynomials has beside its coefficients.
struct PolynomialForm {
  int order = 3;
  evemu::ReadingBox box;
  Vector3 ball1_m = Vector3::Zero();
};

/// A model as it is stored: everything from_description() needs to build it again, bit for bit.
struct ModelDescription {
  KinematicChain chain;
  MachineNodes nodes;
  Basis basis = Basis::Linear;
  Gauge gauge = Gauge::G1;
  /// One offset: the model holds for this tool only. Several (all 18 tables): for any tool where
  /// three of them are not on a line, else for tools on that line: the rotation about it is not
  /// determined.
  std::vector<Vector3> tool_offsets_m;
  std::vector<Parameter> parameters;  ///< in the order of ParameterLayout, without the rigid ones
  Eigen::MatrixXd covariance;  ///< parameters x parameters, full, symmetric, m^2, m rad, rad^2
  std::vector<Vector3> validity_hull_m;
  /// Set: `parameters` are the coefficients of the scaled design [m], nodes and basis do not count.
  std::optional<PolynomialForm> polynomials{};
};

/// Immutable value; all members are const and may be called from any thread.
class VolumetricModel {
 public:
  /// A model of 14 tables has the tool offset inside its tables. An offset differing by 0.5 mm
  /// changes V by at most 0.05 um at 100 urad, below what a run can resolve; beyond that the model
  /// does not hold.
  static constexpr double kToolTolerance_m = 0.5e-3;

  /// BadInput / NotFinite with all that is wrong with the parameters: unknown or repeated name,
  /// missing node, shape.
  [[nodiscard]] static Result<VolumetricModel> from_description(ModelDescription);
  /// `U` and `covariance` over model_size() parameters.
  [[nodiscard]] static Result<VolumetricModel> from_vector(const ParameterLayout&, Gauge,
                                                           std::span<const Vector3> tool_offsets_m,
                                                           const Eigen::VectorXd& U,
                                                           const Eigen::MatrixXd& covariance,
                                                           ValidityVolume);

  /// In polynomials. Holds for one tool. Gauge Ball1 or Ball1Blocks.
  [[nodiscard]] static Result<VolumetricModel> from_polynomials(evemu::EvemuModel, Gauge,
                                                                const Vector3& tool_offset_m,
                                                                ValidityVolume);

  /// About 1 us with covariance. No allocation.
  [[nodiscard]] VolumetricError error_at(const Vector3& axis_position_m,
                                         const Vector3& tool_offset_m) const;
  /// V alone, about four times faster. NaN for a tool the model does not hold for.
  [[nodiscard]] Vector3 V_at(const Vector3& axis_position_m, const Vector3& tool_offset_m) const;
  /// c = -V(p + c), iterated until it moves by less than 1e-9 m. NotApplicable for another tool;
  /// NotConverged after 50 evaluations (needs |dV/dq| close to 1: nonsense tables).
  [[nodiscard]] Result<Correction> command_correction(const Vector3& nominal_m,
                                                      const Vector3& tool_offset_m) const;

  [[nodiscard]] bool holds_for_tool(const Vector3& tool_offset_m) const;
  /// Of polynomials: no tables; the nodes are a grid over the validity volume, fine enough to judge
  /// the model and to publish it.
  [[nodiscard]] const ParameterLayout& layout() const { return layout_; }
  /// Null for a model of tables.
  [[nodiscard]] const evemu::EvemuModel* polynomials() const {
    return polynomials_ ? &*polynomials_ : nullptr;
  }
  [[nodiscard]] Gauge gauge() const { return gauge_; }
  [[nodiscard]] std::span<const Vector3> tool_offsets_m() const { return tool_offsets_m_; }
  [[nodiscard]] const ValidityVolume& validity() const { return validity_; }
  [[nodiscard]] const Eigen::VectorXd& U() const { return U_; }
  [[nodiscard]] const Eigen::MatrixXd& covariance() const { return covariance_; }
  [[nodiscard]] std::vector<Parameter> parameters() const;
  [[nodiscard]] ModelDescription description() const;

 private:
  VolumetricModel(ParameterLayout layout) : layout_(std::move(layout)) {}
  [[nodiscard]] Vector3 lever_offset_m(const Vector3& asked_m) const;

  ParameterLayout layout_;
  std::optional<evemu::EvemuModel> polynomials_;
  Gauge gauge_ = Gauge::G1;
  std::vector<Vector3> tool_offsets_m_;
  bool holds_for_any_tool_ = false;
  Vector3 tool_line_ = Vector3::Zero();  ///< unit length; zero: the model holds for one tool
  Eigen::VectorXd U_;
  Eigen::MatrixXd covariance_;
  ValidityVolume validity_;
};

}  // namespace abbe::calib
