#pragma once
/// Pure data.

namespace abbe::drivers {

enum class RealTimeMode {
  Enforce,  ///< a refused setting (memory lock, priority, affinity) is an error: do not start
  Ignore,   ///< a refused setting is a warning: for tests and laptops
};

}  // namespace abbe::drivers
