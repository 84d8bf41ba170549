#pragma once
/// Polls the encoder bus on a separate thread. Real encoders answer a SYNC independently of all
/// other devices. If all devices shared one thread, the answer would wait until a burst of the
/// tracker is computed, which takes several SYNC periods with sanitizers or on a busy computer.

#include <future>

#include "abbe/sim/simulation.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

class BusThread {
 public:
  /// Precondition: `simulation` was set up with a bus and bus_apart. It must outlive the thread.
  BusThread(Simulation& simulation, SimClock clock);
  ~BusThread();
  BusThread(const BusThread&) = delete;
  BusThread& operator=(const BusThread&) = delete;

  /// Rethrows the exception that ended the thread, if any.
  void check();

 private:
  Socket stop_;  ///< an eventfd
  std::future<void> polling_;
};

}  // namespace abbe::sim
