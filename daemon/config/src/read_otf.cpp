#include <algorithm>
#include <array>
#include <optional>

#include "abbe/calib/otf/run/smoothness_options.hpp"
#include "readers.hpp"

namespace abbe::daemon {
namespace {

enum class SmoothnessWord { None };

/// Reads smoothness = "none", or smoothness_um = [X, Y, Z].
void read_smoothness(Section& section, std::optional<std::array<double, 3>>& out_m) {
  SmoothnessWord word = SmoothnessWord::None;
  std::vector<double> bend_m;
  const bool has_word =
      section.get_word<SmoothnessWord>("smoothness", word, {{"none", SmoothnessWord::None}});
  const bool has_size = section.get("smoothness_um", bend_m, kMicro);
  if (has_word && has_size) {
    section.fault("smoothness_um", "must not be given beside smoothness: state one of them");
    return;
  }
  if (!has_size) return;

  const auto is_size = [](double value_m) {
    return value_m == 0.0 || calib::otf::is_bend_size(value_m);
  };
  if (bend_m.size() != 3 || !std::ranges::all_of(bend_m, is_size) ||
      std::ranges::count(bend_m, 0.0) == 3) {
    section.fault("smoothness_um",
                  "must be three numbers, for X, Y and Z, each 0.01 to 1000, or 0 for no prior");
    return;
  }
  out_m = {bend_m[0], bend_m[1], bend_m[2]};
}

}  // namespace

void read_otf(ClassifiedSection& root, OtfConfig& out) {
  Section section = root.operation_table("otf");
  section.get_word<OtfMode>(
      "mode", out.mode, {{"on-the-fly", OtfMode::OnTheFly}, {"standstill", OtfMode::Standstill}});
  section.get("u_repeatability_um", out.u_repeatability_m, kMicro, {0.0, 1000.0});
  section.get_word<OtfEstimator>(
      "estimator", out.estimator,
      {{"two-step", OtfEstimator::TwoStep}, {"simultaneous", OtfEstimator::Simultaneous}},
      Need::Optional, {{"joint", OtfEstimator::Simultaneous}});
  section.get_word<OtfBacklash>("backlash", out.backlash,
                                {{"none", OtfBacklash::None},
                                 {"per-table", OtfBacklash::PerTable},
                                 {"forward-backward", OtfBacklash::PerNode}});
  read_smoothness(section, out.smoothness_m);
  section.close();
}

}  // namespace abbe::daemon
