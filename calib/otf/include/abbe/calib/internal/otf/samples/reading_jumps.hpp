#pragma once

#include <cstddef>
#include <optional>

#include "abbe/calib/otf/run/encoder_log.hpp"

namespace abbe::calib::otf {

/// Removes scale readings that jump away from their neighbours and back. Pattern of a jump: one
/// reading deviates from the line through the readings before and after it, and each of these
/// deviates from its own line by half as much to the other side. Deviations up to seven standard
/// deviations of those around it, and up to 2 um, are kept. An axis that starts or stops does not
/// have this pattern.
struct WithoutJumps {
  std::optional<EncoderLog> log{};  ///< log without the jumps; nullopt: there are none
  std::size_t jumps = 0;
};
[[nodiscard]] WithoutJumps without_jumps(const EncoderLog&);

}  // namespace abbe::calib::otf
