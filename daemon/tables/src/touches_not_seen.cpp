#include "abbe/tables/touches_not_seen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <vector>

namespace abbe::daemon {

std::string line_not_seen(const TouchesFile& file, const calib::evemu::Calibrator& calibrator,
                          const calib::evemu::ObserveOptions& options) {
  std::map<int, std::vector<calib::evemu::Touch>> by_position;
  for (const calib::evemu::Touch& touch : file.touches)
    by_position[touch.position].push_back(touch);
  for (const auto& [position, touches] : by_position) {
    if (calib::evemu::see_artefact(position, touches, calibrator, options)) continue;
    const auto first = std::ranges::find(file.touches, position, &calib::evemu::Touch::position);
    return fmt::format(":{}", file.lines[static_cast<std::size_t>(first - file.touches.begin())]);
  }
  return {};
}

}  // namespace abbe::daemon
