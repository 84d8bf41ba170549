#pragma once
/// Prediction of a calibration with a Multi-Feature Bar before it is measured: the covariance of
/// the 21 errors follows from bar, poses, tools and noise alone (solve.hpp). A plan determines an
/// error if its predicted uncertainty is small enough; the rank is no criterion. Example: without
/// the diagonals the rows have full rank because of the small shifts of some holes, but squareness
/// has an uncertainty of 100 urad.

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/mfb/solve/solve.hpp"

namespace abbe::calib::mfb {

struct ErrorUncertainty {
  std::string name;    ///< such as "EXX", "EC0Y"
  double rms_u = 0.0;  ///< root mean square of u over the nodes that the datum leaves free; m or
                       ///< rad
  double max_u = 0.0;
  bool is_angle = false;
};

struct PlanPrediction {
  std::vector<ErrorUncertainty> errors;  ///< EXX .. ECZ, then EA0Z EB0Z EC0Y
  Eigen::MatrixXd covariance;            ///< covariance of the parameters in the order of
                                         ///< ParameterLayout
  std::vector<std::string> not_seen;     ///< errors whose uncertainty exceeds
                                         ///< SolveOptions::most_u_m or most_u_rad
  std::size_t observations = 0, unknowns = 0, rank = 0;
  double condition = 0.0;  ///< condition number of the column-scaled rows after elimination of the
                           ///< nuisances
  /// Largest ratio of max_u to its limit: at most 1 if the plan determines every error.
  double worst = 0.0;

  /// Standard uncertainty of each parameter.
  [[nodiscard]] Eigen::VectorXd u() const;
};

/// Predicts the uncertainties for all measurements of a plan. Errors: those of check(), and
/// readings outside the nodes. A plan that does not determine all errors is not an error.
[[nodiscard]] Result<PlanPrediction> predict(const Bar&, const Plan&, const MfbMachine&,
                                             const SolveOptions& = {});

/// Information of the passes of one position about the unknowns that all positions share: whitened
/// rows without the unknowns of the position. Computed once for each candidate when plans are
/// compared.
struct PositionInformation {
  std::string position;
  Eigen::MatrixXd rows;
  std::size_t observations = 0, nuisances = 0;
};

/// Predicts the uncertainties for sets of positions of one bar, with one machine and noise.
/// Immutable; member functions may be called from any thread.
class PlanPredictor {
 public:
  PlanPredictor(PlanPredictor&&) noexcept;
  PlanPredictor& operator=(PlanPredictor&&) noexcept;
  ~PlanPredictor();

  /// `plan`: tip, noise and gravity; its measurements are not used. BadInput as check(Bar).
  [[nodiscard]] static Result<PlanPredictor> of(const Bar&, const Plan& plan, const MfbMachine&,
                                                const SolveOptions& = {});

  /// Computes the information of all passes of one position. The errors of predict(). Takes about 2
  /// ms.
  [[nodiscard]] Result<PositionInformation> position(std::span<const Measurement>) const;
  /// Prediction for a set of positions. Takes about 10 ms.
  [[nodiscard]] PlanPrediction predict(std::span<const PositionInformation* const>) const;

 private:
  struct Parts;
  explicit PlanPredictor(std::unique_ptr<const Parts>);
  std::unique_ptr<const Parts> parts_;
};

}  // namespace abbe::calib::mfb
