#pragma once
/// What a metrologist looks at after an independent measurement of the compensated volume: what is
/// left, how it compares with what was there (R_resmag of [Li OMM] section 5.4), and the vectors in
/// three planes. Pure.

#include <optional>
#include <string>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/calib/verify/compare.hpp"
#include "abbe/model/model_document.hpp"

namespace abbe::daemon {

struct Verification {
  calib::verify::Observations observations;
  calib::verify::Comparison comparison;
  std::vector<InputFile> inputs;
  std::vector<std::size_t> lines;  ///< of the points in their file; may be empty
  std::string cut_short{};  ///< why some of the points are missing or may be wrong; empty: none is
  /// Where the planes of vectors lie, one coordinate for each axis; default: the middle of the
  /// grid.
  std::optional<calib::Vector3> planes_m;
};

/// "better with the model: 0.090 um rms left, 41.300 um without it; 340 of 343 points gained".
[[nodiscard]] std::string verdict_text(const calib::verify::Comparison&);

/// Why R_resmag is not given. None: it is.
[[nodiscard]] std::optional<std::string> why_no_ratio(const calib::verify::Comparison&);

/// report.html, self-contained. Begins with the verdict.
[[nodiscard]] std::string verification_report(const ModelDocument&, const Verification&);

/// grid.csv:
/// `x_mm,y_mm,z_mm,las_x_um,las_y_um,las_z_um,model_x_um,...,turned_x_um,...,R_stated,R_turned`.
[[nodiscard]] std::string to_grid_csv(const calib::verify::Comparison&);

}  // namespace abbe::daemon
