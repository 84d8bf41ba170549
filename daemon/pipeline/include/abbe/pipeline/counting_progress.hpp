#pragma once

#include "abbe/drivers/counter_card/progress.hpp"

namespace abbe::daemon {

/// State of the counters of the card that reads the axes (counted_axes()), at one of its scans.
using CountingProgress = drivers::CounterCardProgress;

}  // namespace abbe::daemon
