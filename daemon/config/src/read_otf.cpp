#include <algorithm>

#include "readers.hpp"

namespace abbe::daemon {
namespace {

enum class SmoothnessWord { None };

/// smoothness = "none", or smoothness_um = [X, Y, Z].
void read_smoothness(Section& section, std::optional<calib::otf::SmoothnessOptions>& out) {
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
  out = calib::otf::SmoothnessOptions{};
  std::ranges::copy(bend_m, out->bend_m.begin());
}

}  // namespace

void read_otf(ClassifiedSection& root, OtfConfig& out) {
  Section section = root.operation_table("otf");
  section.get_word<calib::otf::Mode>(
      "mode", out.mode,
      {{"on-the-fly", calib::otf::Mode::OnTheFly}, {"standstill", calib::otf::Mode::Standstill}});
  section.get("u_repeatability_um", out.u_repeatability_m, kMicro, {0.0, 1000.0});
  section.get_word<calib::otf::Estimator>(
      "estimator", out.estimator,
      {{"two-step", calib::otf::Estimator::TwoStep}, {"joint", calib::otf::Estimator::Joint}});
  section.get_word<calib::estimation::TravelDependence>(
      "backlash", out.backlash,
      {{"none", calib::estimation::TravelDependence::None},
       {"per-table", calib::estimation::TravelDependence::Backlash},
       {"forward-backward", calib::estimation::TravelDependence::Tables}});
  read_smoothness(section, out.smoothness);
  section.close();
}

}  // namespace abbe::daemon
