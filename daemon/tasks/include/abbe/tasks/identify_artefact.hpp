#pragma once
/// Makes the calibrator file of a ball array, from touches in one position on an accurate machine.

#include <cstddef>
#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/evemu/run/artefact.hpp"

namespace abbe::daemon {

/// Arguments as given by the user: file names, and values in the unit of their name.
struct IdentifyArtefactArguments {
  std::string touches, name;
  std::string out;  ///< calibrator.toml
  /// Approximate outward normals of the faces of the blocks, "x,y,z".
  std::string outward_1 = "0,0,1", outward_2 = "0,1,0";
  double tip_radius_mm = 0.0;  ///< tip radius of these touches
  /// Tip radius on the machine to be calibrated; negative: the same as `tip_radius_mm`.
  double machine_tip_radius_mm = -1.0;
  std::optional<double> u_touch_um;  ///< default: estimated from the touches
};

struct IdentifiedArtefact {
  calib::evemu::Calibrator calibrator;
  InputFile source;
  std::size_t touches = 0;
};

/// Writes `arguments.out`. BadInput: touches in more than one position.
[[nodiscard]] Result<IdentifiedArtefact> identify_artefact(
    const IdentifyArtefactArguments& arguments);

}  // namespace abbe::daemon
