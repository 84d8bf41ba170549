#pragma once
/// The report on an independent measurement of the compensated volume, for a metrologist: the
/// residual errors, their ratio to the errors without compensation (R_resmag of [Li OMM] section
/// 5.4), and the vectors in three planes. Pure.

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/verify/compare.hpp"
#include "abbe/report/certificate_details.hpp"
#include "abbe/report/conformity.hpp"
#include "abbe/tasks/same_machine.hpp"

namespace abbe::daemon {

/// A model, with its errors at the places that are compared.
struct ModelAtPoints {
  ComparedModel model;
  calib::Vector3 tool_m = calib::Vector3::Zero();
  calib::verify::Comparison comparison{};
};

/// The result for one model, which is also compared on a grid, or for several models at the same
/// places. Only places inside the validity volume of every model are compared.
struct Verification {
  std::vector<ModelAtPoints> models;         ///< models in the order of the arguments; at least one
  calib::verify::Observations observations;  ///< observations at all places
  std::size_t inside = 0;                    ///< number of places that are compared
  std::vector<InputFile> inputs;
  std::vector<std::size_t> lines;  ///< line numbers of the shots in their file; may be empty
  std::size_t repeated = 0;        ///< rows of the file that repeat another row and are left out
  /// Single points that do not fit the model, one line each; empty for several models.
  std::vector<std::string> points_off;
  /// Usual mistakes in the points that would explain the differences: with the mistake corrected,
  /// the points fit the model far better. One line each; empty for several models.
  std::vector<std::string> likely_mistakes;
  /// reason why points are missing or may be wrong; empty: all points are complete
  std::string cut_short;
  /// result of different_machines(); for one model it is also one of its cautions
  std::string different_machines;
  /// Positions of the planes in which the vectors are drawn, one coordinate per axis; default: the
  /// middle of the grid.
  std::optional<calib::Vector3> planes_m;
  CertificateDetails details{};  ///< contents of certificate.toml; empty: not given

  /// The comparison of the first model.
  [[nodiscard]] const calib::verify::Comparison& comparison() const {
    return models.front().comparison;
  }
};

/// The verdict in one sentence, for example "better with the model: 0.090 um rms left, 41.300 um
/// without it; 340 of 343 places improved".
[[nodiscard]] std::string verdict_text(const calib::verify::Comparison&);

/// The number of shots and their repeatability: "348 shots at 343 places, 1 to 6 each; their
/// standard deviation about the means of their places is 1.20 um (3-D)".
[[nodiscard]] std::string shots_text(const calib::verify::Observations&);

/// The reason why the report does not give R_resmag (residual / error without compensation);
/// nullopt if it gives it.
[[nodiscard]] std::optional<std::string> why_no_ratio(const calib::verify::Comparison&);

/// A residual of the first model with its limit from `[verification]`. Lengths in um.
struct JudgedResidual {
  std::string name;  ///< "rms", "largest"
  double value_um = 0.0, U_um = 0.0, limit_um = 0.0;
  Conformity conformity = Conformity::Neither;
};
/// Judges the residuals with the guard band of ISO 14253-1 and the U of
/// calib::verify::expanded_uncertainty(). The result is never a pass while a usual mistake is
/// likely or points are missing. Empty: no limits are stated.
[[nodiscard]] std::vector<JudgedResidual> judged_residuals(const Verification&);

/// The text of report.html for the first model. The page needs no other file and begins with the
/// verdict.
[[nodiscard]] std::string verification_report(const Verification&);

/// grid.csv, one row per grid point: position, measured error (las), error of the model (model),
/// error of the model after its best-fit rigid motion (turned), and R_resmag of model and turned:
/// `x_mm,y_mm,z_mm,las_x_um,las_y_um,las_z_um,model_x_um,...,turned_x_um,...,R_stated,R_turned`.
[[nodiscard]] std::string to_grid_csv(const calib::verify::Comparison&);

}  // namespace abbe::daemon
