#pragma once
/// Compares a model with directly measured error motions, table by table and in the volume.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/direct/volume.hpp"
#include "abbe/calib/model/volumetric_model.hpp"
#include "abbe/tables/measured_file.hpp"

namespace abbe::daemon {

struct MeasuredOptions {
  std::string file;  ///< measured.csv or .rtl; empty: no comparison with a file
  std::string straightness = "end-points";
  double u_um = 0.0, u_urad = 0.0, u_ppm = 0.0;  ///< standard uncertainties of the device, k = 1
  std::string error{}, line{}, unit{};           ///< information that an .rtl file does not contain
};

struct MeasuredComparison {
  MeasuredFile file;
  std::vector<calib::direct::TableComparison> tables;
  calib::Result<calib::direct::VolumeComparison> volume;
  calib::Vector3 tool_m;
  std::vector<std::string> rows_off;  ///< single values that do not fit the others, one line each
};

/// BadInput with file and line. Error::details lists single values that do not fit the others.
[[nodiscard]] Result<MeasuredComparison> compare_measured(const calib::VolumetricModel& model,
                                                          const MeasuredOptions& options);

}  // namespace abbe::daemon
