#include "abbe/calib/otf/run.hpp"

namespace abbe::calib::otf {

std::string_view name(Stage stage) {
  switch (stage) {
    case Stage::Observe:
      return "observe";
    case Stage::Align:
      return "align";
    case Stage::Solve:
      return "solve";
    case Stage::Judge:
      return "judge";
  }
  return "";
}

}  // namespace abbe::calib::otf
