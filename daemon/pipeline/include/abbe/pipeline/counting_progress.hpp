#pragma once

#include "abbe/drivers/counter_card/progress.hpp"

namespace abbe::daemon {

/// State of the counters of counted_axes() at one scan.
using CountingProgress = drivers::CounterCardProgress;

}  // namespace abbe::daemon
