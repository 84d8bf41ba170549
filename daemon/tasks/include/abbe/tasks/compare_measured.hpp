#pragma once
/// A model against directly measured error motions, table by table and in the volume.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/direct/volume.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/tables/measured_file.hpp"

namespace abbe::daemon {

struct MeasuredOptions {
  std::string file;  ///< measured.csv or .rtl; empty: not wanted
  std::string straightness = "end-points";
  double u_um = 0.0, u_urad = 0.0, u_ppm = 0.0;  ///< of the device, k = 1
  std::string error{}, line{}, unit{};           ///< what an .rtl file does not state
};

struct MeasuredComparison {
  MeasuredFile file;
  std::vector<calib::direct::TableComparison> tables;
  calib::Result<calib::direct::VolumeComparison> volume;
  calib::Vector3 tool_m;
  std::vector<std::string> rows_off;  ///< values that alone do not fit, one line each
};

/// BadInput with file and line; the details name values that alone do not fit.
[[nodiscard]] Result<MeasuredComparison> compare_measured(const calib::VolumetricModel& model,
                                                          const MeasuredOptions& options);

}  // namespace abbe::daemon
