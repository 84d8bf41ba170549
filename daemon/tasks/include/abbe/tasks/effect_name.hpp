#pragma once

#include "abbe/calib/verify/compare.hpp"

namespace abbe::daemon {

/// The word for an effect: "better", "not seen", "worse".
[[nodiscard]] constexpr const char* effect_name(calib::verify::Effect effect) {
  switch (effect) {
    case calib::verify::Effect::Better:
      return "better";
    case calib::verify::Effect::NotSeen:
      return "not seen";
    case calib::verify::Effect::Worse:
      return "worse";
  }
  return "";
}

}  // namespace abbe::daemon
