#include "abbe/tasks/direction_option.hpp"

#include <fmt/format.h>

#include <string_view>

namespace abbe::daemon {

using calib::AxisTravel;
using calib::Travel;

Result<AxisTravel> parse_direction(const std::string& text) {
  constexpr std::string_view kDirections = "-0+";
  AxisTravel travel{};
  if (text.empty()) return travel;

  bool valid = text.size() == 2 * travel.size() - 1;
  for (std::size_t i = 0; valid && i < travel.size(); ++i) {
    const auto direction = kDirections.find(text[2 * i]);
    valid = direction != std::string_view::npos && (i == 0 || text[2 * i - 1] == ',');
    travel[i] = static_cast<Travel>(static_cast<int>(direction) - 1);
  }
  if (!valid)
    return fail(
        ErrorCode::Usage,
        fmt::format("--direction \"{}\": must be three of +, -, 0, for X, Y, Z: \"+,-,0\"", text));
  return travel;
}

Result<void> require_travel(const calib::VolumetricModel& model, const std::string& name) {
  if (model.travel() != nullptr) return {};
  return fail(ErrorCode::DataInsufficient,
              fmt::format("{}: the model has no backlash, so V in one direction of travel is not "
                          "known; identify it with --backlash, or leave the direction out",
                          name));
}

}  // namespace abbe::daemon
