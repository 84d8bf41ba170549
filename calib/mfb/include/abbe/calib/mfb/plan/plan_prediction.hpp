#pragma once
/// Prediction of a calibration with a Multi-Feature Bar before it is measured: the covariance of
/// the 21 errors follows from bar, poses, tools and noise alone (solve.hpp). Whether a plan shows
/// an error is judged by its predicted uncertainty, never by the rank: without the diagonals the
/// rows have full rank because of the small shifts of some holes, but squareness has 100 urad.

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
  std::string name;    ///< "EXX", "EC0Y"
  double rms_u = 0.0;  ///< over the nodes that the datum leaves free; m or rad
  double max_u = 0.0;
  bool is_angle = false;
};

struct PlanPrediction {
  std::vector<ErrorUncertainty> errors;  ///< EXX .. ECZ, then EA0Z EB0Z EC0Y
  Eigen::MatrixXd covariance;            ///< of the parameters in the order of ParameterLayout
  std::vector<std::string> not_seen;     ///< errors beyond SolveOptions::most_u_m, most_u_rad
  std::size_t observations = 0, unknowns = 0, rank = 0;
  double condition = 0.0;  ///< of the column-scaled rows, nuisances eliminated
  /// Largest ratio of max_u to its limit: at most 1 if every error is shown.
  double worst = 0.0;

  /// Standard uncertainty of each parameter.
  [[nodiscard]] Eigen::VectorXd u() const;
};

/// Prediction for all measurements of a plan. Errors: those of check(), and readings outside the
/// nodes. A plan that does not show all errors is no error.
[[nodiscard]] Result<PlanPrediction> predict(const Bar&, const Plan&, const MfbMachine&,
                                             const SolveOptions& = {});

/// What the passes of one position state about the unknowns that all positions share: whitened rows
/// without the unknowns of the position. Computed once for each candidate when plans are compared.
struct PositionInformation {
  std::string position;
  Eigen::MatrixXd rows;
  std::size_t observations = 0, nuisances = 0;
};

/// Predicts the uncertainty that positions of a bar give, for one bar, machine and noise. Immutable
/// value; member functions may be called from any thread.
class PlanPredictor {
 public:
  PlanPredictor(PlanPredictor&&) noexcept;
  PlanPredictor& operator=(PlanPredictor&&) noexcept;
  ~PlanPredictor();

  /// `plan`: tip, noise and gravity; its measurements are not used. BadInput as check(Bar).
  [[nodiscard]] static Result<PlanPredictor> of(const Bar&, const Plan& plan, const MfbMachine&,
                                                const SolveOptions& = {});

  /// All passes of one position; the errors of predict(). Takes about 2 ms.
  [[nodiscard]] Result<PositionInformation> position(std::span<const Measurement>) const;
  /// Prediction for a set of positions. Takes about 10 ms.
  [[nodiscard]] PlanPrediction predict(std::span<const PositionInformation* const>) const;

 private:
  struct Parts;
  explicit PlanPredictor(std::unique_ptr<const Parts>);
  std::unique_ptr<const Parts> parts_;
};

}  // namespace abbe::calib::mfb
