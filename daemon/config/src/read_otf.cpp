#include "readers.hpp"

namespace abbe::daemon {

void read_otf(Section& root, OtfConfig& out) {
  Section section = root.child("otf");
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
  section.close();
}

}  // namespace abbe::daemon
