#pragma once
/// The encoders on a thread of their own. Real ones answer a SYNC whatever else the shop floor
/// does; a simulator that makes a tracker's burst first answers SYNC periods late when it is built
/// with sanitizers or the computer is busy.

#include <future>

#include "abbe/sim/simulation.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

class BusThread {
 public:
  /// `simulation` was set up with a bus and bus_apart.
  BusThread(Simulation& simulation, SimClock clock);
  ~BusThread();
  BusThread(const BusThread&) = delete;
  BusThread& operator=(const BusThread&) = delete;

  /// Throws what ended the thread, if something did.
  void check();

 private:
  Socket stop_;  ///< an eventfd
  std::future<void> turning_;
};

}  // namespace abbe::sim
