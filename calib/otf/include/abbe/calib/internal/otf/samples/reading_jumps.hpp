#pragma once

#include <cstddef>
#include <optional>

#include "abbe/calib/otf/run/encoder_log.hpp"

namespace abbe::calib::otf {

/// Scale readings without those that jump away from their neighbours and back: one reading is off
/// the line through the readings before and after it, and each of these is off its own line by half
/// as much to the other side. Seven standard deviations of such distances around it, and 2 um, are
/// kept; an axis that starts or stops has no such pattern.
struct WithoutJumps {
  std::optional<EncoderLog> log{};  ///< nullopt: there are no jumps
  std::size_t jumps = 0;
};
[[nodiscard]] WithoutJumps without_jumps(const EncoderLog&);

}  // namespace abbe::calib::otf
