#pragma once

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

/// The observations without one pass. The remaining tools and pairs of its position are renumbered;
/// a position without passes is removed.
[[nodiscard]] Observations without_pass(const Observations&, std::size_t pass);

}  // namespace abbe::calib::mfb
