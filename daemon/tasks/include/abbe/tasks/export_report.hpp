#pragma once
/// The report of an export: what the file holds, what it loses, its sign.

#include <string>
#include <vector>

#include "abbe/exports/prove_export.hpp"
#include "abbe/exports/write_export.hpp"

namespace abbe::daemon {

struct ExportReport {
  const FormatFacts* facts = nullptr;
  WriteOptions written;  ///< with the origin
  HeldCorrection held;
  std::vector<std::string> files;
  ExportProof proof;
  calib::ExportLoss loss;
  std::vector<calib::ErrorLoss> by_error;
  std::vector<std::string> not_held;  ///< sentences
};

/// What no comparison of positions shows: uncertainty, validity, tool, backlash.
[[nodiscard]] std::vector<std::string> not_held_by(const FormatFacts&,
                                                   const calib::VolumetricModel&,
                                                   bool direction_given);

[[nodiscard]] std::string report_text(const ExportReport&);
[[nodiscard]] std::string report_json(const ExportReport&);  ///< one object, with a line end

}  // namespace abbe::daemon
