#include "abbe/calib/otf/plan/plan.hpp"

namespace abbe::calib::otf {
namespace {

/// Vertices of the path. '-', '0' and '+': smallest, middle and largest position of an axis.
constexpr const char* kBaseVertices[] = {
    "---", "+++", "--+", "++-", "---", "+-+", "-+-", "+--", "-++", "+-+", "++-", "-++", "---",
    "+--", "--+", "-+-", "+++", "+--", "++-", "-+-", "---", "--+", "+-+", "+++", "-++", "--+",
    "--0", "++0", "-+0", "+-0", "--0", "-+0", "-+-", "-++", "-0+", "+0-", "-0-", "+0+", "-0+",
    "-0-", "-00", "+00", "+0-", "+0+", "+-+", "+--", "+-0", "++0", "++-", "+++", "0++", "0--",
    "0+-", "0-+", "0++", "0+-", "0+0", "0-0", "0--", "0-+", "00+", "00-",
};

double base_position_m(char place, const AxisNodes& axis) {
  const double least_m = axis.nodes_m.front(), most_m = axis.nodes_m.back();
  switch (place) {
    case '-':
      return least_m;
    case '+':
      return most_m;
    default:
      return 0.5 * (least_m + most_m);
  }
}

}  // namespace

Path base_path(const MachineNodes& nodes) {
  Path path;
  for (const char* vertex : kBaseVertices) {
    path.vertices_m.emplace_back(base_position_m(vertex[0], nodes[0]),
                                 base_position_m(vertex[1], nodes[1]),
                                 base_position_m(vertex[2], nodes[2]));
  }
  return path;
}

}  // namespace abbe::calib::otf
