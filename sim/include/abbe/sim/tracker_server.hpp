#pragma once
/// The simulated tracker on its port.

#include "abbe/sim/controller_server.hpp"
#include "abbe/sim/tracker_device.hpp"

namespace abbe::sim {

using TrackerServer = ControllerServer<TrackerDevice>;

}  // namespace abbe::sim
