#include <algorithm>

#include "abbe/base/units.hpp"
#include "abbe/calib/geometry/error_parameters.hpp"
#include "readers.hpp"

namespace abbe::daemon {
namespace {

bool is_table(const std::string& name) {
  return calib::error_motion(name).has_value() ||
         std::ranges::find(calib::kSquarenessNames, name) != calib::kSquarenessNames.end();
}

}  // namespace

void read_drift(ClassifiedSection& root, Config& out) {
  Section section = root.operation_table("drift");
  DriftConfig& drift = out.drift;
  section.get("test", drift.test);
  section.get("hold", drift.hold);
  section.get("continuous", drift.continuous);
  section.get("forgetting", drift.forgetting, kPlain, {0.01, 1.0});
  section.get("noise_um", drift.length_m_per_root_day, kMicro, kNotNegative);
  section.get("noise_urad", drift.angle_rad_per_root_day, kMicro, kNotNegative);
  section.get("place_days", drift.place_days, kPlain, kPositive);
  if (drift.continuous && !drift.test)
    section.fault("continuous", "needs test = true: a table that drifted must not be averaged");
  if (drift.continuous && out.otf.backlash != OtfBacklash::None)
    section.fault("continuous",
                  "needs backlash = \"none\" in [otf]. With another setting the uncertainty of "
                  "every run contains half the backlash, which an update would average as noise");
  if (drift.continuous && out.otf.smoothness_m)
    section.fault("continuous",
                  "needs [otf] without smoothness_um: every run would contain the prior, and an "
                  "update would count it once for each of them");
  if (drift.hold && !drift.test) section.fault("hold", "needs test = true");

  Section tables = section.child("tables");
  for (const std::string& name : tables.keys()) {
    if (!is_table(name)) {
      tables.fault(name,
                   "is no error table or squareness error: EXX, EYX ... ECZ, EA0Z, EB0Z, EC0Y");
      (void)tables.has(name);
    } else {
      tables.get(name, drift.of_tables[name], kMicro, kNotNegative);
    }
  }

  tables.close();
  section.close();
}

}  // namespace abbe::daemon
