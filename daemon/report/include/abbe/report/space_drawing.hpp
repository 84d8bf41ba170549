#pragma once
/// Draws lines in the space of a machine in an oblique view (SVG), with equal scales on all axes.
/// Pure.

#include <array>
#include <string>
#include <vector>

#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::daemon {

/// A line in machine coordinates, mm.
struct SpaceLine {
  std::string label;  ///< printed beside the end of the line; labels at the same place are joined
  calib::Vector3 from_mm = calib::Vector3::Zero();  ///< drawn as a dot
  calib::Vector3 to_mm = calib::Vector3::Zero();
};

struct SpaceDrawing {
  std::string title;
  /// Opposite corners of a box that is drawn as a frame with the names of its axes.
  std::array<calib::Vector3, 2> box_mm{};
  std::vector<SpaceLine> lines;
  bool one_colour = false;  ///< true: all thin lines have one colour, for many vectors of one field
};

/// An SVG element. X is drawn to the right, Z upwards, and Y to the back.
[[nodiscard]] std::string svg(const SpaceDrawing& drawing);

}  // namespace abbe::daemon
