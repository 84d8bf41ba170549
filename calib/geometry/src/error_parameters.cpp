#include "abbe/calib/geometry/error_parameters.hpp"

#include <algorithm>

namespace abbe::calib {
namespace {
constexpr std::string_view kMotionLetters = "XYZABC";
}

std::string name(ErrorMotion e) {
  return {'E', kMotionLetters[static_cast<std::size_t>(e.motion)], letter(e.axis)};
}

std::optional<ErrorMotion> error_motion(std::string_view iso_name) {
  if (iso_name.size() != 3 || iso_name[0] != 'E' || iso_name[2] < 'X' || iso_name[2] > 'Z') {
    return std::nullopt;
  }
  const std::size_t motion = kMotionLetters.find(iso_name[1]);
  if (motion == std::string_view::npos) {
    return std::nullopt;
  }
  return ErrorMotion{kAllMotions[motion], kAllAxes[static_cast<std::size_t>(iso_name[2] - 'X')]};
}

bool is_positioning(ErrorMotion e) {
  return !is_rotation(e.motion) && direction(e.motion) == index(e.axis);
}
bool is_straightness(ErrorMotion e) {
  return !is_rotation(e.motion) && direction(e.motion) != index(e.axis);
}

bool Parameter::is_angle() const {
  if (name.rfind("k_", 0) == 0) {
    return false;
  }
  const std::optional<ErrorMotion> motion = error_motion(name);
  return motion ? is_rotation(motion->motion) : true;
}

}  // namespace abbe::calib
