#include "backlash_lines.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"

namespace abbe::daemon {

nlohmann::json backlash_json(std::span<const calib::Backlash> backlash) {
  auto all = nlohmann::json::array();
  for (const auto& b : backlash) {
    const bool angle = calib::is_rotation(b.motion.motion);
    nlohmann::json one{{"name", calib::name(b.motion)},
                       {angle ? "value_urad" : "value_um", b.value * kUmPerM},
                       {angle ? "u_urad" : "u_um", b.u * kUmPerM}};
    if (b.position_m) one["position_mm"] = *b.position_m * kMmPerM;
    all.push_back(std::move(one));
  }
  return all;
}

void print_backlash(std::span<const calib::Backlash> backlash) {
  for (const auto& b : calib::largest_of_tables(backlash))
    fmt::print("backlash    {} {:.3f} {}, standard uncertainty {:.3f}{}\n", calib::name(b.motion),
               b.value * kUmPerM, calib::is_rotation(b.motion.motion) ? "urad" : "um",
               b.u * kUmPerM,
               b.position_m ? fmt::format(", at {:.1f} mm", *b.position_m * kMmPerM) : "");
}

}  // namespace abbe::daemon
