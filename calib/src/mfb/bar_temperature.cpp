#include "mfb/bar_temperature.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "message.hpp"
#include "units.hpp"

namespace abbe::calib::mfb {

std::optional<std::string> bar_far_from_reference(const Observations& o) {
  const auto from_reference_K = [](const PassObservation& pass) {
    return std::abs(pass.temperature_K - kReferenceTemperature_K);
  };
  const auto worst = std::ranges::max_element(o.passes, {}, from_reference_K);
  if (worst == o.passes.end() || from_reference_K(*worst) <= kMostFromReference_K) {
    return std::nullopt;
  }
  constexpr double kReference_C = 20.0;
  const double off_K = worst->temperature_K - kReferenceTemperature_K;
  std::string text =
      message(o.plan.measurements[worst->measurement].name, ": the temperature of the bar is ",
              kReference_C + off_K, " C, ", std::abs(off_K), " K from that of its calibration");
  if (o.bar.expansion) {
    text += message(": all lengths change by ", kUmPerM * o.bar.expansion->alpha_per_K * off_K,
                    " um/m");
  }
  return text;
}

}  // namespace abbe::calib::mfb
