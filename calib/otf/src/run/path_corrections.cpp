#include "run/path_corrections.hpp"

#include <utility>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::otf {
namespace {

Path times(const Matrix3& M, Path path) {
  for (Vector3& vertex : path.vertices_m) {
    vertex = M * vertex;
  }
  return path;
}

/// Names the reflections after which the path is inside the travel. The fit of a rigid motion
/// cannot decide which of them is the mistake.
std::string reflections(const Path& path, const MachineNodes& travel) {
  std::vector<std::string> texts;
  for (const AxisMistake& mistake : axis_mistakes()) {
    if (mistake.M.determinant() < 0.0 &&
        outside_travel(times(mistake.M, path).vertices_m, travel).empty()) {
      texts.push_back(mistake.text);
    }
  }
  return texts.empty()
             ? "one axis of the path or of the tracker's frame reversed, or two swapped"
             : or_list(texts) +
                   ", or with the tracker frame reflected (azimuth or elevation reversed)";
}

}  // namespace

std::string corrections_that_fit(const Path& path, const MachineNodes& travel,
                                 const std::function<bool(const Path&)>& fits) {
  std::vector<std::string> texts;
  if (fits({{path.vertices_m.rbegin(), path.vertices_m.rend()}})) {
    texts.emplace_back("the path driven backwards");
  }

  if (fits(times(Vector3(-1.0, 1.0, 1.0).asDiagonal(), path))) {
    texts.push_back(reflections(path, travel));
  }

  for (const UnitMistake& mistake : unit_mistakes()) {
    for (const auto& [factor, file] :
         {std::pair{mistake.factor, "path"}, {1.0 / mistake.factor, "tracker"}}) {
      if (fits(times(factor * Matrix3::Identity(), path))) {
        texts.push_back(message(mistake.text, " (", file, ")"));
      }
    }
  }

  return texts.empty() ? "" : "; they fit with " + or_list(texts);
}

std::string angles_that_fit(const std::function<bool(const AngleMistake&)>& fits) {
  std::vector<std::string> texts;
  for (const AngleMistake& mistake : angle_mistakes()) {
    if (fits(mistake)) {
      texts.push_back(mistake.text);
    }
  }
  return texts.empty() ? "" : "; they fit with " + or_list(texts);
}

}  // namespace abbe::calib::otf
