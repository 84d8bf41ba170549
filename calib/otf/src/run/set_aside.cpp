#include "abbe/calib/otf/run/set_aside.hpp"

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::otf {

std::string set_aside_text(const SetAside& a) {
  std::string all;
  if (a.samples() > 0) {
    const double share = static_cast<double>(a.samples()) / static_cast<double>(a.of_samples);
    all = message(a.samples(), " samples (", 100.0 * share, " %) are excluded: ", a.off_line,
                  " off the line through their neighbours, ", a.unreachable,
                  " at places that the target cannot have reached; the most on leg ", a.worst_leg,
                  " (", a.on_worst_leg, "), the longest part ", a.longest, " samples at ",
                  a.longest_from_s, " s");
    if (share > kManySetAside) {
      all += message("; more than ", 100.0 * kManySetAside,
                     " %: check reflector, line of sight and vibration");
    }
  }

  if (a.noisy_segments > 0) {
    all += message(all.empty() ? "" : "; ", a.noisy_segments,
                   " segments are noisier than the others and have a larger uncertainty");
  }

  return all;
}

}  // namespace abbe::calib::otf
