#pragma once
/// The proof of a file: read as the control reads it, it must give what was meant at random places.

#include <span>

#include "abbe/calib/export/held_correction.hpp"
#include "abbe/exports/control_reading.hpp"

namespace abbe::daemon {

/// Largest difference between a file and what its format can hold: files have 1e-12 m, and the
/// positions of 5,000 nodes of a constant step at most 1e-9 m.
inline constexpr double kExportTolerance_m = 1e-9;
inline constexpr std::size_t kExportPlaces = 1000;

struct ExportProof {
  std::size_t places = 0;
  double largest_difference_m = 0.0;
};

/// BadInput as read_as_control(). Refused if a component differs by more than kExportTolerance_m;
/// the text names the first place, and an opposite sign as such.
[[nodiscard]] Result<ExportProof> prove_export(ExportFormat, std::span<const ExportFile>,
                                               const ControlSettings&,
                                               std::span<const calib::ExportPlace>,
                                               const calib::CorrectionFunction& held);

}  // namespace abbe::daemon
