#include "abbe/calib/otf/observe/known_travel.hpp"

#include <algorithm>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::otf {
namespace {

/// Letters of the axes whose direction of travel is unknown, such as "Y, Z".
std::string axes_without_travel(const AxisTravel& travel) {
  std::string axes;
  for (const Axis axis : kAllAxes) {
    if (travel[index(axis)] == Travel::Unknown) {
      axes += message(axes.empty() ? "" : ", ", letter(axis));
    }
  }
  return axes;
}

}  // namespace

bool estimates_backlash(const Observations& o) {
  return o.basis.travel() != TravelDependence::None;
}

Result<std::size_t> first_with_known_travel(std::span<const AxisTravel> travel) {
  const auto is_known = [](const AxisTravel& t) { return axes_without_travel(t).empty(); };
  const auto found = std::find_if(travel.begin(), travel.end(), is_known);
  if (found == travel.end()) {
    return failure(ErrorCode::RankDeficient,
                   message("backlash: the path does not move ",
                           axes_without_travel(travel.empty() ? AxisTravel{} : travel.back()),
                           ": drive a path that moves all axes, or do not estimate backlash"));
  }
  return static_cast<std::size_t>(found - travel.begin());
}

std::string note_on_unused(const Observations& o) {
  const Result<std::size_t> first =
      estimates_backlash(o) ? first_with_known_travel(o.travel) : Result<std::size_t>(0);
  if (!first || *first == 0) {
    return {};
  }
  const char* const part = o.mode == Mode::Standstill ? "positions" : "legs";
  return message("the ", part, " before ", *first,
                 " are not used: ", axes_without_travel(o.travel[*first - 1]),
                 " had not moved yet, so the state of the backlash is unknown; begin "
                 "the path with a motion of all axes");
}

Result<std::size_t> first_with_backlash(Observations& o) {
  if (!estimates_backlash(o)) {
    return 0;
  }
  if (std::string unused = note_on_unused(o); !unused.empty()) {
    o.notes.push_back(std::move(unused));
  }
  return first_with_known_travel(o.travel);
}

}  // namespace abbe::calib::otf
