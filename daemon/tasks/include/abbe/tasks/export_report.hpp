#pragma once
/// The report of an export: the part of the correction that the file contains, the part that it
/// does not contain, and the sign.

#include <string>
#include <vector>

#include "abbe/exports/prove_export.hpp"
#include "abbe/exports/write_export.hpp"

namespace abbe::daemon {

struct ExportReport {
  const FormatFacts* facts = nullptr;
  WriteOptions written;  ///< options of the writer, with the origin
  HeldCorrection held;
  std::vector<std::string> files;
  ExportProof proof;
  calib::ExportLoss loss;
  std::vector<calib::ErrorLoss> by_error;
  /// properties of the model that the format cannot hold, in sentences
  std::vector<std::string> not_held;
};

/// Properties of the model that a comparison of positions does not show: uncertainty, validity,
/// tool, backlash.
[[nodiscard]] std::vector<std::string> not_held_by(const FormatFacts&,
                                                   const calib::VolumetricModel&,
                                                   bool direction_given);

[[nodiscard]] std::string report_text(const ExportReport&);
[[nodiscard]] std::string report_json(const ExportReport&);  ///< one JSON object, with a line end

}  // namespace abbe::daemon
