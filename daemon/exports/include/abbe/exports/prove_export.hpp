#pragma once
/// Proves an exported file: it is read as the control reads it, and must give the intended
/// correction at random places.

#include <span>

#include "abbe/calib/export/held_correction.hpp"
#include "abbe/exports/control_reading.hpp"

namespace abbe::daemon {

/// Largest allowed difference between a file and the correction that its format can hold. Values in
/// files have a resolution of 1e-12 m; the positions of 5,000 nodes with a constant step deviate by
/// at most 1e-9 m.
inline constexpr double kExportTolerance_m = 1e-9;
inline constexpr std::size_t kExportPlaces = 1000;

struct ExportProof {
  std::size_t places = 0;
  double largest_difference_m = 0.0;
};

/// BadInput for a file that read_as_control() does not accept. Refused if a component differs by
/// more than kExportTolerance_m; the text names the first such place, and states if the sign is
/// opposite.
[[nodiscard]] Result<ExportProof> prove_export(ExportFormat, std::span<const ExportFile>,
                                               const ControlSettings&,
                                               std::span<const calib::ExportPlace>,
                                               const calib::CorrectionFunction& held);

}  // namespace abbe::daemon
